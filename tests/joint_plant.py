"""A joint between tendons, written without the package's models: many masses, explicit steps of about 2 us, in C."""

import copy
import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.parameters import JointTendon, Mechanism
from tendonff.ocp.codegen.compiler import load_library

Array = NDArray[np.float64]
_FIELDS = ("k1", "k2", "tau", "c", "mass", "sigma", "viscous", "p", "radius", "arm", "arm_by_q", "from", "tension")
_ARRAYS = ("angle", "angle_by_q", "mu_pull", "mu_release", "share", "share_by_q", "gain", "piece")
_WORK = ("u", "v", "f", "z", "b", "old", "to", "fro", "stiff", "shift", "drift", "s0", "inverse")


class _Tendon(ctypes.Structure):
    _fields_ = (
        ("masses", ctypes.c_int),
        *((name, ctypes.c_double) for name in _FIELDS),
        *((name, ctypes.c_void_p) for name in (*_ARRAYS, *_WORK)),
        ("moves", ctypes.c_int),
    )


@dataclass(frozen=True, kw_only=True)
class PlantResponse:
    """Rows at the times of the motor."""

    angle_rad: Array
    torque_N_m: Array
    tension_N: Array  # at the joint
    drum_N: Array
    lowest_N: Array  # along each tendon, since the row before


def _cut(tendon: JointTendon, masses: int, joint: str) -> dict[str, Array]:
    """Equal pieces, `masses` for each radian of the whole wrap angle and at least four for a section that touches."""
    sections = tendon.path.sections
    if not sections:
        n = masses
        share = np.full(n + 1, 1 / n)
        share[[0, -1]] /= 2
        mu = np.full(n, tendon.friction.mu_dynamic)
        back = np.full(n, tendon.friction.release_dynamic)
        still = np.zeros(n)
        angle = np.full(n, tendon.path.total_angle_rad / n)
        zero = np.zeros(n + 1)
        return dict(zip(_ARRAYS, (angle, still, mu, back, share, zero, zero, np.full(n, 1 / n)), strict=True))
    total = sum(s.length_m or 0.0 for s in sections)
    theta = sum(s.angle_rad for s in sections)
    rows: list[tuple[float, ...]] = []
    links: list[list[float]] = [[0.0, 0.0, 0.0]]
    for s in sections:
        on_it = float(s.joint == joint)
        n = max(round(masses * s.angle_rad / theta), 4) if s.angle_rad > 0 else 0
        whole = np.array([s.length_m or 0.0, on_it * s.length_per_rad_m, on_it * s.length_per_rad_m])
        if n == 0:
            links[-1] = list(np.array(links[-1]) + whole)
        for _ in range(n):
            links[-1] = list(np.array(links[-1]) + whole / (2 * n))
            links.append(list(whole / (2 * n)))
            mu = tendon.friction.mu_dynamic if s.mu_dynamic is None else s.mu_dynamic
            rows.append((s.angle_rad / n, on_it * s.angle_per_rad / n, mu, mu, (s.length_m or 0.0) / n))
    table, link = np.array(rows), np.array(links)
    piece = table[:, 4] / table[:, 4].sum()
    columns = (*table[:, :4].T, link[:, 0] / total, link[:, 1] / total, link[:, 2], piece)
    return dict(zip(_ARRAYS, columns, strict=True))


class Plant:
    """A mechanism at rest at an angle, under tensions that are uniform along each tendon; `turn` goes on from there."""

    def __init__(
        self,
        mechanism: Mechanism,
        row_s: float,
        start_rad: float,
        *,
        tensions_N: Array,
        soft: bool = True,
        masses: int = 40,
        step_s: float = 2e-6,
        arm_by_q: tuple[float, ...] = (0.0, 0.0),
    ) -> None:
        joint, tendons = mechanism.joint, mechanism.tendons
        count = len(tendons)
        self._records, self._kept, self._count = (_Tendon * count)(), [], count
        for k, tendon in enumerate(tendons):
            t, f = tendon.tendon, tendon.friction
            arrays = {
                name: np.ascontiguousarray(a, dtype=float) for name, a in _cut(tendon, masses, joint.name).items()
            }
            n = len(arrays["angle"])
            work = {name: np.zeros(n + 2) for name in _WORK}
            arm = tendon.arm.moment_arm_m or 0.0
            sigma = f.soft_bristle_stiffness_N_per_m if soft else f.bristle_stiffness_N_per_m
            loop = mechanism.drive.kind == "loop"
            way = (1 if arm - arrays["gain"].sum() > 0 else -1) if loop else 1
            numbers = (
                *(t.stiffness_N_per_m, t.relaxing_stiffness_N_per_m, t.relaxation_time_s),
                *(t.damping_N_s_per_m, t.mass_kg, sigma, f.viscous_N_s_per_m, f.adhesion_N),
                *(way * mechanism.drum_radius_m[k], arm, arm_by_q[k], 0.0, float(tensions_N[k])),
            )
            self._records[k] = _Tendon(n, *numbers, *(a.ctypes.data for a in (*arrays.values(), *work.values())))
            self._kept += [arrays, work]
        self._numbers = np.array(
            [
                *(joint.inertia_kg_m2, joint.damping_N_m_s_per_rad, joint.stiffness_N_m_per_rad, joint.rest_rad),
                *(joint.gravity_N_m, joint.gravity_zero_rad, joint.coulomb_N_m, 50.0),
                *(*joint.stops_rad, joint.stop_stiffness_N_m_per_rad),
            ]
        )
        self._row_s, self._inner, self._start = row_s, round(row_s / step_s), start_rad
        self._gear, self._state = mechanism.drive.gear_ratio, np.zeros(6)
        self._stiff = (mechanism.drive.gear_stiffness_N_m_per_rad or 0.0) * self._gear**2
        self._loop = mechanism.drive.kind == "loop"
        self._library = load_library((Path(__file__).parent / "joint_plant.c").read_text("utf-8"))

    def copy(self) -> "Plant":
        """Another in the same state."""
        other = copy.copy(self)
        other._state = self._state.copy()
        other._kept = [{name: array.copy() for name, array in each.items()} for each in self._kept]
        other._records = type(self._records).from_buffer_copy(self._records)
        for k, record in enumerate(other._records):
            for arrays in other._kept[2 * k : 2 * k + 2]:
                for name, array in arrays.items():
                    setattr(record, name, array.ctypes.data)
        return other

    def turn(self, motor_rad: Array, contact_N_m: Array | float = 0.0, led_rad: Array | None = None) -> Array:
        """Rows of angle, torque, and of each tendon tension at the joint, at the drum and its least, after each row.

        The first motor angle is that of the present.
        """
        motor = np.asarray(motor_rad, float).reshape(len(motor_rad), -1) / self._gear
        motor = np.ascontiguousarray(np.broadcast_to(motor, (len(motor), self._count)))
        rows, pointer = len(motor) - 1, ctypes.c_void_p
        contact = np.ascontiguousarray(np.broadcast_to(np.asarray(contact_N_m, float), (rows + 1,)))
        led = None if led_rad is None else np.ascontiguousarray(led_rad, dtype=float)
        out = np.empty((rows, 2 + 3 * self._count))
        self._library.plant(
            *(pointer(self._numbers.ctypes.data), self._records, ctypes.c_int(self._count)),
            *(ctypes.c_double(self._stiff), ctypes.c_int(self._loop)),
            *(ctypes.c_double(self._row_s), ctypes.c_long(rows), ctypes.c_int(self._inner)),
            *(pointer(motor.ctypes.data), pointer(contact.ctypes.data)),
            *(pointer(None if led is None else led.ctypes.data), ctypes.c_double(self._start)),
            *(pointer(self._state.ctypes.data), pointer(out.ctypes.data)),
        )
        return out


def respond(  # noqa: PLR0913
    mechanism: Mechanism,
    motor_rad: Array,
    row_s: float,
    start_rad: float,
    *,
    tensions_N: Array,
    soft: bool = True,
    masses: int = 40,
    step_s: float = 2e-6,
    contact_N_m: Array | float = 0.0,
    led_rad: Array | None = None,
    arm_by_q: tuple[float, ...] = (0.0, 0.0),
) -> PlantResponse:
    """Response to motor angles, linear between rows: one column for a loop, or one for each tendon."""
    count = len(mechanism.tendons)
    plant = Plant(
        mechanism,
        row_s,
        start_rad,
        tensions_N=tensions_N,
        soft=soft,
        masses=masses,
        step_s=step_s,
        arm_by_q=arm_by_q,
    )
    first = np.concatenate([[start_rad, 0.0], *(3 * [tensions_N])])
    out = np.vstack([first, plant.turn(motor_rad, contact_N_m, led_rad)])
    parts = (slice(2 + k * count, 2 + (k + 1) * count) for k in range(3))
    return PlantResponse(
        angle_rad=out[:, 0],
        torque_N_m=out[:, 1],
        **dict(zip(("tension_N", "drum_N", "lowest_N"), (out[:, p] for p in parts), strict=True)),
    )
