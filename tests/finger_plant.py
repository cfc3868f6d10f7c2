"""Several joints on tendons that cross them, without the package's models: many masses, steps of 2 us, in C."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.parameters import DrivenJoint, JointTendon
from tendonff.ocp.codegen.compiler import load_library

Array = NDArray[np.float64]
_NUMBERS = ("k1", "k2", "tau", "c", "mass", "sigma", "viscous", "p", "tension", "growth", "grown")
_ARRAYS = ("angle", "mu", "angle_by", "share", "piece", "gain", "share_by", "arm")
_WORK = ("u", "v", "f", "z", "b", "phi")


class _Tendon(ctypes.Structure):
    _fields_ = (
        ("masses", ctypes.c_int),
        *((name, ctypes.c_double) for name in _NUMBERS),
        *((name, ctypes.c_void_p) for name in (*_ARRAYS, *_WORK)),
    )


@dataclass(frozen=True, kw_only=True)
class FingerResponse:
    """Rows at the times of the motors, without the first."""

    angle_rad: Array  # shape (rows, joints)
    tension_N: Array  # shape (rows, tendons); at the far end
    drum_N: Array
    motor_rad: Array  # shape (rows, motors)


def _cut(tendon: JointTendon, joints: Sequence[str], masses: int) -> dict[str, Array]:
    """Equal pieces of every section that touches, at least two; a link from middle to middle."""
    sections = tendon.path.parts
    theta = sum(s.angle_rad for s in sections)
    total = sum(s.length_m or 0.0 for s in sections)
    pieces, links = [], [np.zeros(1 + len(joints))]
    for s in sections:
        n = max(round(masses * s.angle_rad / theta), 2) if s.angle_rad > 0 else 0
        by = np.array([s.length_per_rad_m * (s.joint == name) for name in joints])
        bend = np.array([s.angle_per_rad * (s.joint == name) for name in joints])
        whole = np.concatenate([[s.length_m or 0.0], by])
        if n == 0:
            links[-1] = links[-1] + whole
        for _ in range(n):
            links[-1] = links[-1] + whole / (2 * n)
            links.append(whole / (2 * n))
            mu = tendon.friction.mu_dynamic if s.mu_dynamic is None else s.mu_dynamic
            pieces.append((s.angle_rad / n, mu, (s.length_m or 0.0) / n, bend / n))
    length = np.array([p[2] for p in pieces])
    gain = np.array(links)[:, 1:].T
    arms = {arm.joint: arm.moment_arm_m or 0.0 for arm in tendon.arms}
    return {
        "angle": np.array([p[0] for p in pieces]),
        "mu": np.array([p[1] for p in pieces]),
        "angle_by": np.array([p[3] for p in pieces]).T,
        "share": np.array(links)[:, 0] / total,
        "piece": length / length.sum(),
        "gain": gain,
        "share_by": gain / total,
        "arm": np.array([arms.get(name, 0.0) for name in joints]),
    }


def respond(  # noqa: PLR0913
    joints: Sequence[DrivenJoint],
    tendons: Sequence[JointTendon],
    radius_m: Array,
    motor: Array,
    row_s: float,
    start_rad: Array,
    tension_N: Array,
    *,
    forced: Array | None = None,
    stiff: Array | None = None,
    stiffening: tuple[float, float] = (0.0, 1.0),
    masses: int = 40,
    step_s: float = 2e-6,
) -> FingerResponse:
    """Turn the motors, shape (rows + 1, motors); of those with an inertia in `forced` [kg m2], the torque is given, and
    those in `stiff` hang on a spring [N m/rad] from where they start.

    `stiffening`: share by which every tendon's stiffness grows from its value at a tension [N] to twice that tension.
    `radius_m`, shape (motors, tendons): travel of each tendon per radian of each motor.
    """
    names = [joint.name for joint in joints]
    records, kept = (_Tendon * len(tendons))(), []
    for k, tendon in enumerate(tendons):
        t, f = tendon.tendon, tendon.friction
        arrays = {name: np.ascontiguousarray(each) for name, each in _cut(tendon, names, masses).items()}
        n = len(arrays["angle"])
        work = [np.zeros(n + 2) for _ in _WORK]
        numbers = (
            *(t.stiffness_N_per_m, t.relaxing_stiffness_N_per_m, t.relaxation_time_s, t.damping_N_s_per_m, t.mass_kg),
            *(f.soft_bristle_stiffness_N_per_m, f.viscous_N_s_per_m, f.adhesion_N, float(tension_N[k]), *stiffening),
        )
        records[k] = _Tendon(n, *numbers, *(each.ctypes.data for each in (*(arrays[a] for a in _ARRAYS), *work)))
        kept += [arrays, work]
    rows = np.array(
        [
            (j.inertia_kg_m2, j.damping_N_m_s_per_rad, j.stiffness_N_m_per_rad, j.rest_rad, j.coulomb_N_m, 50.0)
            for j in joints
        ]
    )
    motors = len(radius_m)
    inertia = np.zeros(motors) if forced is None else np.asarray(forced, dtype=float)
    led = (inertia == 0).astype(np.intc)
    given, radius = np.ascontiguousarray(motor, dtype=float), np.ascontiguousarray(radius_m, dtype=float)
    start, state = np.ascontiguousarray(start_rad, dtype=float), np.zeros(3 * len(joints) + 2 * motors)
    out = np.empty((len(given) - 1, len(joints) + 2 * len(tendons) + motors))
    spring = np.zeros(motors) if stiff is None else np.asarray(stiff, dtype=float)
    at = [ctypes.c_void_p(each.ctypes.data) for each in (rows, radius, inertia, led, spring, given, start, state, out)]
    library = load_library((Path(__file__).parent / "finger_plant.c").read_text("utf-8"))
    library.finger(
        *(ctypes.c_int(len(joints)), at[0], ctypes.c_int(len(tendons)), records, ctypes.c_int(motors), *at[1:5]),
        *(ctypes.c_double(row_s), ctypes.c_long(len(out)), ctypes.c_int(round(row_s / step_s)), *at[5:]),
    )
    cuts = np.cumsum([len(joints), len(tendons), len(tendons)])
    angle, tension, drum, turned = np.split(out, cuts, axis=1)
    return FingerResponse(angle_rad=angle, tension_N=tension, drum_N=drum, motor_rad=turned)
