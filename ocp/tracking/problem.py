"""The optimal-control problem, read from top to bottom.

::

    minimise    M_p[mean (T_s - r)^2 + c (S_s - s)^2] + w mean f^2 + v (travel of f)    over the force f(t)
    subject to  the chain of every plant s, from its state: T_s is its output     dynamics
                minimum_N <= f <= maximum_N, abs(df/dt) <= rate_N_per_s           limits of the actuator
                low_N <= tension anywhere along the tendon <= high_N              bounds of the tendon
                abs(dq_a/dt) <= speed, low_m <= q_a - q_a(0) <= high_m            limits of the actuator's motion
                abs(f + stall_N/no_load dq_a/dt) <= stall_N                       torque-speed line of its motor

r is the reference and M_p the mean of order p over the plants: one plant and p = 1 for a nominal design. S is the
output by the static law and s what the exact inverse gives there: no force pumps it (`ratcheting`). The dynamics
are simulated (single shooting), so every iterate is a profile that could be used; the tension bounds carry an exact
penalty. `cost` evaluates and linearises the problem, `sqp` solves it on one grid of knots, `grids` from coarse to
fine, `receding_horizon` cuts long ones into pieces, `track` puts the answer into words.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainState
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.band import Band
from tendonff.ocp.tracking.limits import ForceLimits, MotionLimits
from tendonff.ocp.tracking.motion import APPROACH_S
from tendonff.ocp.tracking.ratcheting import StaticGoal

WORST_POWER = 8.0
"""Order of a mean that is close to the largest value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """What the profile is optimised for, and how hard.

    Parameters
    ----------
    effort_weight : float
        Weight of the mean squared force beside the mean squared tension error [-]; 0 for tracking alone.
    travel_weight : float
        What doubling the travel of the clipped inverse's force costs, as a mean square error relative to the squared
        range of the reference [-]: force that shakes to no purpose is not worth its while. 0 for none.
    static_weight : float
        Weight of the error by the static law beside that of the model, where that law speaks for stiff bristles [-]:
        soft bristles can be pumped by a force that shakes, which no rig was measured to do. 0 trusts the model; a
        robust design does not use it.
    minimum_tension_N : float
        Least tension anywhere along the tendon [N]; 0 means no link may go slack.
    maximum_tension_N : float
        Largest tension anywhere along the tendon [N]; infinite for none.
    max_iterations : int
        Quadratic programs per window.
    tolerance : float
        Relative decrease of the mean squared error that is not worth another iteration [-].
    restarts : int or None
        Turns in which the profile between two reversals is moved or changed at random and searched again, that may
        bring next to nothing in a row before it is left as it is; 0 for a single search, which takes a quarter of the
        time. None: 6 on a short horizon of one plant, fewer for several plants, none where the horizon is cut in
        windows.
    window_s : float or None
        Length of the pieces a long horizon is cut into [s]; None: chosen from the reference.
    """

    effort_weight: float = 0.0
    travel_weight: float = 1e-6
    static_weight: float = 0.003
    minimum_tension_N: float = 0.0
    maximum_tension_N: float = math.inf
    max_iterations: int = 400
    tolerance: float = 3e-3
    restarts: int | None = None
    window_s: float | None = None

    def __post_init__(self) -> None:
        for name in ("effort_weight", "travel_weight", "static_weight"):
            if not 0 <= (value := getattr(self, name)) < math.inf:
                raise ParameterError(f"{name} must be a finite number >= 0, got {value}; 0 for none")
        if not 0 <= self.minimum_tension_N < self.maximum_tension_N:
            raise ParameterError(
                f"minimum_tension_N must be >= 0 and below maximum_tension_N = {self.maximum_tension_N:g}, "
                f"got {self.minimum_tension_N}; 0 means no slack"
            )
        if self.max_iterations < 3:
            raise ParameterError(f"max_iterations must be >= 3, got {self.max_iterations}; 400 is a good start")
        if not 0 < self.tolerance < 1:
            raise ParameterError(f"tolerance must lie between 0 and 1, got {self.tolerance}; 0.003 is a good start")
        if self.restarts is not None and not 0 <= self.restarts <= 100:
            raise ParameterError(f"restarts must lie between 0 and 100, got {self.restarts}; 0 for a single search")
        if self.window_s is not None and not self.window_s > 0:
            raise ParameterError(f"window_s must be > 0, got {self.window_s}; leave it out to have it chosen")


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionBounds:
    """Bounds on the tension anywhere along the tendon."""

    # low_N, high_N: [N]; infinite for none
    low_N: float
    high_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """What is made small."""

    reference_N: Array  # shape (n,); desired output tension at 0, h, 2 h ... [N]
    effort_weight: float  # weight of the mean squared force beside the mean squared tension error [-]
    travel_weight: float  # cost of a newton of travel of the force, up and down [N]
    least_travel_N: float  # travel in one step below this costs less [N]
    power: float  # mean of order `power` of the plants' mean squared errors: 1 is the mean, large is the worst
    penalty_N: float  # cost of a newton outside the tension bounds [N]
    band: Band | None = None  # where the output shall be kept

    def rows(self, taken: "slice | np.typing.NDArray[np.int_]") -> "Goal":
        """The same goal on some rows."""
        band = None if self.band is None else self.band.rows(taken)
        return replace(self, reference_N=self.reference_N[taken], band=band)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionBound:
    """A bound on a sum of force, travel and speed of the actuator's end: low <= sum <= high."""

    # per_force, per_travel_per_m, per_speed_s_per_m: weights of the three; the sum has the unit of the bound
    per_force: float = 0.0
    per_travel_per_m: float = 0.0
    per_speed_s_per_m: float = 0.0
    ahead_s: float = 0.0  # the speed counts that is reached after so long with the present acceleration [s]
    # low, high: infinite for none
    low: float
    high: float
    newtons: float  # how much tension an excess of 1 counts [N]

    def sums(self, force: Array, travel_m: Array, step_s: float) -> Array:
        """The bounded sum on all rows, or its slopes, of force and travel of shape (n, ...)."""
        speed = np.diff(travel_m, axis=0, prepend=travel_m[:1]) / step_s
        if self.ahead_s:
            speed = speed + self.ahead_s / step_s * np.diff(speed, axis=0, prepend=speed[:1])
        total: Array = self.per_force * force + self.per_travel_per_m * travel_m + self.per_speed_s_per_m * speed
        return total


def motion_bounds(motion: MotionLimits, span_N: float, stiffness_N_per_m: float) -> tuple[MotionBound, ...]:
    """Speed, travel and torque-speed line as bounds.

    Going as fast again counts a tenth of `span_N`, the range of the reference [N], and a travel of the actuator's end
    as much as the stiffness makes of it [N/m].
    """
    speed, stall = motion.speed_m_per_s, motion.stall_N
    bounds = (
        MotionBound(per_speed_s_per_m=1.0, ahead_s=APPROACH_S, low=-speed, high=speed, newtons=0.1 * span_N / speed),
        MotionBound(per_travel_per_m=1.0, low=motion.low_m, high=motion.high_m, newtons=stiffness_N_per_m),
        MotionBound(
            per_force=1.0,
            per_speed_s_per_m=motion.line_N_s_per_m,
            low=-stall,
            high=stall,
            newtons=0.1 * span_N / stall,
        ),
    )
    return tuple(bound for bound in bounds if math.isfinite(bound.low) or math.isfinite(bound.high))


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantModel:
    """A chain, its start, its near end at rest [m], the bounds of that end, its goal by the static law, its weight."""

    chain: Chain
    state: ChainState
    origin_m: float
    static: StaticGoal
    bounds: tuple[MotionBound, ...] = ()
    weight: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingProblem:
    """Goal, dynamics, limits and bounds over a horizon."""

    step_s: float  # grid h [s]
    goal: Goal
    plants: tuple[PlantModel, ...]  # every one is driven by the same force
    limits: ForceLimits
    bounds: TensionBounds
    start_N: float  # force of row 0, which is given [N]
    rest_N: float  # tension of the rest that travel counts from [N]

    @classmethod
    def of(
        cls,
        chains: tuple[Chain, ...],
        reference_N: Array,
        step_s: float,
        limits: ForceLimits,
        options: TrackOptions,
        *,
        initial_tension_N: float,
        inverse_N: Array,
        power: float = 1.0,
    ) -> "TrackingProblem":
        """The problem of chains that start at rest at a tension T0 [N].

        The travel of the exact inverse, shape (n,) [N], within the limits is what the task needs.
        """
        span = max(float(np.ptp(reference_N)), 1e-3 * float(reference_N.max()))
        margin = 1e-4 * span  # the search aims a little inside, so that what it finds is inside
        travel = max(travel_N(limits.apply(inverse_N, step_s, limits.start(initial_tension_N))), 1e-3 * span)
        slack = 1e-3 * min(float(reference_N.min()), initial_tension_N)
        weight = options.static_weight if len(chains) == 1 else 0.0  # of others the inverse is not known
        return cls(
            step_s=step_s,
            goal=Goal(
                reference_N=reference_N,
                effort_weight=options.effort_weight,
                travel_weight=options.travel_weight * span**2 / travel,
                least_travel_N=0.05 * travel / len(reference_N),
                power=power,
                penalty_N=4 * span + options.effort_weight * float(reference_N.max()),
            ),
            plants=tuple(
                PlantModel(
                    chain=c,
                    state=x,
                    origin_m=x.near_position_m,
                    static=StaticGoal.of(c, inverse_N, step_s, initial_tension_N, weight),
                    bounds=motion_bounds(limits.motion, span, initial_tension_N / x.near_position_m),
                )
                for c, x in ((c, c.rest_state(initial_tension_N)) for c in chains)
            ),
            limits=limits,
            bounds=TensionBounds(
                low_N=options.minimum_tension_N + margin if options.minimum_tension_N > 0 else slack,
                high_N=options.maximum_tension_N - margin,
            ),
            start_N=limits.start(initial_tension_N),
            rest_N=initial_tension_N,
        )

    def clipped(self, force_N: Array) -> Array:
        """What the actuator makes of a force, shape (n,) [N], from the start of this horizon."""
        return self.limits.apply(force_N, self.step_s, self.start_N)

    def piece(
        self, rows: slice, states: tuple[ChainState, ...], static_N: tuple[float, ...], start_N: float
    ) -> "TrackingProblem":
        """The same problem on some of its rows, entered in these states of the plants and with this force [N].

        `static_N` are the plants' outputs there by the static law [N].
        """
        goal = self.goal.rows(rows)
        weight = goal.travel_weight * len(self.goal.reference_N) / len(goal.reference_N)  # beside a mean of fewer rows
        return replace(
            self,
            goal=replace(goal, travel_weight=weight),
            plants=tuple(
                replace(p, state=x, static=replace(p.static, start_N=output, wanted_N=p.static.wanted_N[rows]))
                for p, x, output in zip(self.plants, states, static_N, strict=True)
            ),
            start_N=start_N,
        )

    def coarsened(self, factor: int) -> "TrackingProblem":
        """The same problem with one row for each `factor` rows; the last reference is held to its end."""
        return replace(
            self,
            step_s=factor * self.step_s,
            goal=replace(
                self.goal.rows(_rows(len(self.goal.reference_N), factor)),
                least_travel_N=factor * self.goal.least_travel_N,
            ),
            plants=tuple(
                replace(p, static=replace(p.static, wanted_N=every(p.static.wanted_N, factor))) for p in self.plants
            ),
        )


def every(values: Array, factor: int) -> Array:
    """Every so many-th row, and beyond the last one its value."""
    return values[_rows(len(values), factor)]


def _rows(count: int, factor: int) -> np.typing.NDArray[np.int_]:
    return np.minimum(np.arange(0, count + factor - 1, factor), count - 1)


def travel_N(force_N: Array) -> float:
    """How far a force, shape (n,), goes up and down in all [N]."""
    return float(np.abs(np.diff(force_N)).sum())
