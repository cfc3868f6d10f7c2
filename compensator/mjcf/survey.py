"""Survey of imported tendons: bends, what they multiply tensions by, moment arms, and how well the tables fit."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import linprog

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.mjcf.dynamics import Dynamics
from tendonff.compensator.mjcf.measure import measure
from tendonff.compensator.mjcf.model import Hand, sweep_poses
from tendonff.compensator.reporting.colours import BLUE, INK
from tendonff.compensator.reporting.plots import new_figure
from tendonff.models.mechanism.geometry import Geometry

POSES = 300
LENGTH_M, WRAP_RAD, ARM_M = 1e-5, 2e-3, 1e-4  # bounds of a table's error
ASSUMED_MU = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class TendonSurvey:
    """A tendon over random poses within the joints' ranges.

    Attributes
    ----------
    name, motor : str
    wrap_rad : tuple of float
        Least and largest sum of its bends.
    factor : tuple of float
        e^{mu theta} for those, with the scenario's mu.
    arms_m : dict of str to tuple of float
        Least and largest moment arm about each joint that it crosses.
    length_error_m, arm_error_m : float
        Largest differences of the tables from MuJoCo.
    wrap_rms_rad : float
        RMS difference of the sum of bends.
    """

    name: str
    motor: str
    wrap_rad: tuple[float, float]
    factor: tuple[float, float]
    arms_m: dict[str, tuple[float, float]]
    length_error_m: float
    arm_error_m: float
    wrap_rms_rad: float

    @property
    def fits(self) -> bool:
        """Whether its tables are within all bounds."""
        return self.length_error_m < LENGTH_M and self.wrap_rms_rad < WRAP_RAD and self.arm_error_m < ARM_M

    def miss(self) -> str:
        """Warning of tables that miss the model, with their differences."""
        return (
            f'the tables of tendon "{self.name}" miss the model by {1e3 * self.length_error_m:.2g} mm of length, '
            f"{1e3 * self.wrap_rms_rad:.2g} mrad of wrap angle (RMS), {1e3 * self.arm_error_m:.2g} mm of moment arm "
            f"(bounds {1e3 * LENGTH_M:g}, {1e3 * WRAP_RAD:g}, {1e3 * ARM_M:g}), where a wrap begins; limit a joint by "
            "--joint NAME=LOW:HIGH"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """Survey of all tendons of an import.

    Attributes
    ----------
    tendons : tuple of TendonSurvey
    reachable : float
        Share of the poses in which tensions hold the joints at rest, each at least the least tension, without friction.
    unreachable_rad : dict of str to float
        A pose in which none do; empty where there is none.
    """

    tendons: tuple[TendonSurvey, ...]
    reachable: float
    unreachable_rad: dict[str, float]

    def text(self) -> str:
        """A table for people."""
        lines = [f"{'tendon':<18} {'wrap [rad]':>12} {'e^(mu wrap)':>12} {'fit: mm, mrad, mm':>20}  moment arms [mm]"]
        for t in self.tendons:
            arms = ", ".join(f"{joint} {1e3 * low:.3g}..{1e3 * high:.3g}" for joint, (low, high) in t.arms_m.items())
            fit = f"{1e3 * t.length_error_m:.1g}, {1e3 * t.wrap_rms_rad:.1g}, {1e3 * t.arm_error_m:.1g}"
            wrap = f"{t.wrap_rad[0]:.2f}..{t.wrap_rad[1]:.2f}"
            lines.append(f"{t.name:<18} {wrap:>12} {t.factor[0]:>5.2f}..{t.factor[1]:<5.2f} {fit:>20}  {arms}")
        return "\n".join(lines)

    def messages(self) -> tuple[str, ...]:
        """Warnings: tables that miss the model, poses that tendons cannot hold."""
        return (*(t.miss() for t in self.tendons if not t.fits), *self._reach())

    def _reach(self) -> tuple[str, ...]:
        if not self.unreachable_rad:
            return ()
        pose = ", ".join(f"{name} {q:.3g} rad" for name, q in self.unreachable_rad.items())
        message = (
            f"in {100 * (1 - self.reachable):.0f} % of {POSES} poses no tensions of at least {self.least_N:g} N hold "
            f"the joints, friction not counted, such as at {pose}: keep the reference out of them, or name fewer "
            "joints by --joint"
        )
        return (message,)

    least_N: float = 0.0


def survey(hand: Hand, geometry: Geometry, least_N: float, mu: float = ASSUMED_MU) -> Survey:
    """Compare a geometry, its bodies the hand's joints, with MuJoCo at random poses."""
    poses = sweep_poses(hand, POSES, seed=7)
    length, wrap, arm = geometry.length_m(poses), geometry.wrap_angle_rad(poses), geometry.moment_arm_m(poses)
    names = [tendon.name for tendon in geometry.tendons]
    found = []
    for route, measured in zip(hand.routes, measure(hand, poses), strict=True):
        t = names.index(route.name)
        off = length[:, t] - measured.whole_m
        off -= off.mean() if not route.intervals else 0.0
        spans = [(float(arm[:, t, k].min()), float(arm[:, t, k].max())) for k in range(len(hand.names))]
        ends = float(wrap[:, t].min()), float(wrap[:, t].max())
        wraps = measured.wrap_rad if route.intervals else wrap[:, t]
        found.append(
            TendonSurvey(
                name=route.name,
                motor=route.motor,
                wrap_rad=ends,
                factor=(float(np.exp(mu * ends[0])), float(np.exp(mu * ends[1]))),
                arms_m={name: span for name, span in zip(hand.names, spans, strict=True) if name in route.joints},
                length_error_m=float(np.abs(off).max()),
                arm_error_m=float(np.abs(arm[:, t] - measured.arm_m).max()),
                wrap_rms_rad=float(np.sqrt(np.mean((wrap[:, t] - wraps) ** 2))),
            )
        )
    held = Dynamics(hand).holding_N_m(poses)
    holds = np.array([holdable(arm[k], held[k], least_N) for k in range(POSES)])
    lost = dict(zip(hand.names, poses[int(np.argmin(holds))].tolist(), strict=True)) if not holds.all() else {}
    return Survey(tendons=tuple(found), reachable=float(holds.mean()), unreachable_rad=lost, least_N=least_N)


def holdable(arm_m: FloatArray, torque_N_m: FloatArray, least_N: float, most_N: float = 1e4) -> bool:
    """Whether tensions from `least_N` to `most_N` give torques; arms of shape (tendons, joints)."""
    scale = np.maximum(np.abs(arm_m).max(axis=0), 1e-6)
    found = linprog(
        np.ones(len(arm_m)), A_eq=(arm_m / scale).T, b_eq=torque_N_m / scale, bounds=[(least_N, most_N)] * len(arm_m)
    )
    return bool(found.status == 0)


def survey_figure(found: Survey) -> Figure:
    """Ranges of bends and of moment arms, tendon by tendon."""
    rows = [(t, joint, span) for t in found.tendons for joint, span in t.arms_m.items()]
    height = 1.2 + 0.22 * max(len(rows), len(found.tendons))
    figure, [[left, right]] = new_figure(1, 2, height_in=height)
    # Marks at its ends: a moment arm that is constant has no length.
    bar: dict[str, Any] = {"color": BLUE, "linewidth": 5, "solid_capstyle": "butt", "marker": "|", "markersize": 5}
    for k, t in enumerate(found.tendons):
        left.plot(t.wrap_rad, (-k, -k), **bar)
    left.set_yticks([-k for k in range(len(found.tendons))], [t.name for t in found.tendons])
    left.set_xlabel("wrap angle [rad]")
    left.set_xlim(left=0)
    for k, (_, _, span) in enumerate(rows):
        right.plot([1e3 * end for end in span], (-k, -k), **bar)
    right.axvline(0.0, color=INK, linewidth=0.7)
    right.set_yticks([-k for k in range(len(rows))], [f"{t.name}, {joint}" for t, joint, _ in rows])
    right.set_xlabel("moment arm [mm]")
    return figure
