"""Friction, pre-tension and gear friction of a stretch of use, by a small fit of the fitted mechanism."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.law import MechanismLaw, covariance_of
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.parameters import Parameter
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.errors import SolveError

N = Parameter
WINDOW_S, LEAST_S = 30.0, 8.0
"""Length of a window, and the shortest rest of a file that is one."""

LEAST_STROKE_SHARE = 3.0
"""A window in which the motor moves by less than so many lost motions tells nothing."""

WATCHED = (N.MU, N.TENSION, N.COULOMB)
STEPS, TOLERANCE = 15, 1e-4
MOST_PERCENT = 6.0
"""A window whose torque is left with more than this share of its range was touched by something else."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Window:
    """A stretch of use.

    Attributes
    ----------
    name : str
        Of its file.
    used_s : float
        Time of use at its end, since the first file began [s].
    values : mapping
        Of what is watched; empty where the window tells nothing.
    covariance : ndarray, shape (3, 3)
        Of the logarithms of what is watched, in the order of `WATCHED`.
    percent : float
        RMS error of the torque in % of its range.
    why : str
        Why it tells nothing.
    """

    name: str
    used_s: float
    values: Mapping[Parameter, float]
    covariance: Array
    percent: float = 0.0
    why: str = ""


def ratio_of(mechanism: Mechanism, angle_rad: float) -> float:
    """Turn of the joint per radian of the motor, without friction."""
    return mechanism.drum_radius_m[0] / (mechanism.drive.gear_ratio * abs(mechanism.arms_at(angle_rad)[0]))


def windows_of(log: MotorsLog, mechanism: Mechanism, window_s: float = WINDOW_S) -> Iterator[MotorsLog]:
    """Stretches of a log, one after the other."""
    rows, total = max(round(window_s / log.run.step_s), 1), len(log.torque_N_m)
    ratio = ratio_of(mechanism, float(log.run.start_rad[0]))
    for first in range(0, total, rows):
        last = total if total - first - rows < LEAST_S / log.run.step_s else first + rows
        yield log.part(slice(first, last), ratio)
        if last == total:
            return


def fit_window(part: MotorsLog, mechanism: Mechanism, used_s: float, lost_rad: float) -> Window:
    """Fit a window, from the identified values: from those of the window before, a wrong minimum would be inherited."""
    nothing = Window(name=part.name, used_s=used_s, values={}, covariance=np.zeros((3, 3)))
    start = first_values(mechanism)
    if float(np.ptp(part.run.motor_rad)) < LEAST_STROKE_SHARE * lost_rad:
        return replace(nothing, why="the motor hardly moves")
    law = MechanismLaw(mechanism=mechanism, logs=(part,), fixed={})
    try:
        solution = law.fit(start, most=STEPS, tolerance=TOLERANCE)
        values = solution.values
        percent = law.percent(values)
        covariance = covariance_of(law, solution)
    except (SolveError, ParameterError) as error:
        return replace(nothing, why=str(error))
    least = {n: 0.05 * start[n] for n in WATCHED}
    if percent > MOST_PERCENT:
        return replace(nothing, percent=percent, why="something else moved the joint")
    places = [list(values).index(n) for n in WATCHED]
    size = np.array([max(values[n], least[n]) for n in WATCHED])
    own = covariance[np.ix_(places, places)] / np.outer(size, size)
    if not np.isfinite(own).all():
        return replace(nothing, percent=percent, why="the motor moves too little")
    watched = {n: float(x) for n, x in zip(WATCHED, size, strict=True)}
    return replace(nothing, values=watched, covariance=own, percent=percent)


def first_values(mechanism: Mechanism) -> dict[str, float]:
    """Start of a window's fit: what is watched, and the load, which may change."""
    coulomb = max(N.COULOMB.of(mechanism), 1e-4)
    return {
        N.MU: N.MU.of(mechanism),
        N.TENSION: N.TENSION.of(mechanism),
        N.COULOMB: coulomb,
        N.GRAVITY: N.GRAVITY.of(mechanism),
        N.OFFSET: 0.0,
    }
