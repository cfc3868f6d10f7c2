"""The loop of a surgical tool as a virtual sensor: jaw angle from what the motor's side feels."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tendonff.models.capstan import CapstanLaw
from tendonff.models.joint.quasi_static import LoopSensor, mean_tension

Array = NDArray[np.float64]


def read(folder: Path) -> list[Array]:
    """Input torque [mN m], input angle and jaw angle [rad] of each file, at 20 Hz."""
    names = sorted(folder.glob("*.csv"))
    tables = [np.loadtxt(name, delimiter=",", skiprows=1, usecols=(1, 3, 4))[::10] for name in names]
    return [table * np.array([1e3, 1.0, 1.0]) for table in tables]


def law(x: Array) -> CapstanLaw:
    return CapstanLaw(pull_exponent=math.exp(x[0]), release_exponent=math.exp(x[1]), adhesion_N=math.exp(x[2]))


def columns(f: Array, x: Array) -> Array:
    """Drum's angle and torque, and the mean of the tension along the path."""
    return np.column_stack([f[:, 1], f[:, 0], mean_tension(law(x), f[:, 0])])


def linear_part(files: list[Array], x: Array, own_zero: bool) -> tuple[Array, Array]:
    """Gain, compliance and elongation by least squares, and the residual [rad]; a zero for each file or for all."""
    rows, wanted = [columns(f, x) for f in files], [f[:, 2] for f in files]
    if own_zero:
        rows, wanted = [r - r.mean(axis=0) for r in rows], [w - w.mean() for w in wanted]
    whole, aim = np.vstack(rows), np.concatenate(wanted)
    if not own_zero:
        whole, aim = whole - whole.mean(axis=0), aim - aim.mean()
    found, *_ = np.linalg.lstsq(whole, aim, rcond=None)
    return found, whole @ found - aim


def fitted(files: list[Array], own_zero: bool) -> LoopSensor:
    start = np.log([0.8, 0.8, 80.0])
    x = least_squares(lambda x: linear_part(files, x, own_zero)[1], start, diff_step=1e-3, max_nfev=12).x
    gain, compliance, elongation = linear_part(files, x, own_zero)[0].tolist()
    sensor = LoopSensor(law=law(x), gain=gain, compliance=compliance, elongation=elongation)
    off = np.concatenate([f[:, 2] - sensor.angle_rad(f[:, 1], f[:, 0]) for f in files])
    return replace(sensor, zero_rad=float(off.mean()))


def errors_deg(sensor: LoopSensor, files: list[Array]) -> tuple[float, float]:
    """RMS with one zero for all files, and with one for each."""
    each = [sensor.angle_rad(f[:, 1], f[:, 0]) - f[:, 2] for f in files]
    own = [e - e.mean() for e in each]
    return tuple(float(np.rad2deg(np.sqrt(np.mean(np.concatenate(e) ** 2)))) for e in (each, own))  # type: ignore[return-value]


@pytest.mark.slow
def test_the_memory_of_friction_gives_the_jaw_angle_of_unseen_files(measured_data: Path, record_property) -> None:
    tool = measured_data / "davinci_tool4"
    seen, unseen = read(tool / "identify"), read(tool / "validate")
    one = errors_deg(fitted(seen, own_zero=False), unseen)[0]
    own = errors_deg(fitted(seen, own_zero=True), unseen)[1]
    record_property("figure", f"jaw angle unseen: {one:.2f} deg with one zero, {own:.2f} with one each")
    assert one <= 0.60
    assert own <= 0.40
