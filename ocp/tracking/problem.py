"""The optimal-control problem, read from top to bottom.

::

    minimise    M_p[w_s mean (T_s - r_s)^2] + w mean f^2 + v (travel of f)           over the force f(t)
    subject to  the chain of every plant s, from its state: T_s is its output        dynamics
                minimum_N <= f <= maximum_N, abs(df/dt) <= rate_N_per_s              limits of the actuator
                low_N <= tension anywhere along the tendon <= high_N                 bounds of the tendon
                abs(dq_a/dt) <= speed, low_m <= q_a - q_a(0) <= high_m               limits of the actuator's motion
                abs(f + stall_N/no_load dq_a/dt) <= stall_N                          torque-speed line of its motor

The plants are the design model and the same with stiffer bristles, or what an uncertain one may be; M_p is the mean of
order p over them. The dynamics are simulated (single shooting), so every iterate is a profile that could be used; the
bounds of tension and motion carry an exact penalty. `cost` evaluates and linearises the problem, `sqp` solves it on one
grid of knots (`qp`), `search` finds the start and cuts long horizons, `track` asks and `answer` explains.

The stiffer bristles prevent chattering: a chattering force makes the output of soft bristles creep beyond what
static friction admits: a model rewards that, no measurement supports it. What is wanted of the stiffer plant is its
output under the exact inverse without limits, so where no limit binds nothing is better than the exact inverse.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.cached import cached_property
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.step.protocol import Array, StepperMemory
from tendonff.ocp.tendon.inverse import Inversion
from tendonff.ocp.tendon.simulate import Simulator, simulate, tensions_of
from tendonff.ocp.tracking.diagnosis import held_N
from tendonff.ocp.tracking.limits import ForceLimits, MotionLimits
from tendonff.ocp.tracking.motion import APPROACH_S
from tendonff.ocp.tracking.options import TrackOptions

_POWER = {Objective.WORST: 8.0, Objective.MEAN: 1.0}
"""Order of the mean over the plants; 8 is close to the largest."""

_STIFFER = 30.0  # times the bristle stiffness: about that of the levels with stiff bristles
_SAME = 0.01  # of the reference's range: a stiffer plant whose output is this near says nothing more
_SHAKEN = 0.25  # of the mean square that the largest force misses: cost of doubling the travel


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
    """A chain that the force drives, and what is asked of it."""

    chain: Chain
    state: ChainState  # at row 0
    origin_m: float  # near end at rest
    wanted_N: Array  # shape (n,); output that is right for this plant
    bounds: tuple[MotionBound, ...] = ()
    weight: float = 1.0  # of its mean squared error


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantRun:
    """A plant at row 0, made ready once for all the forces that are tried."""

    simulator: Simulator
    start: StepperMemory
    tension_N: Array  # shape (1, N + 1)
    position_m: float  # of the near end, relative to rest

    def respond(self, force_N: Array) -> tuple[Array, Array] | None:
        """Tensions, shape (n, N + 1), and positions of the near end, shape (n,); None where the simulation fails."""
        self.simulator.restore(self.start)
        rows = self.simulator.advance(ChainInputs.of_force(force_N[1:]))
        if len(rows.tension_N) < len(force_N) - 1:
            return None
        moved = rows.ends_m[:, 0] - self.start.x[-2] + self.position_m
        return np.vstack([self.tension_N, rows.tension_N]), np.append(self.position_m, moved)


@dataclass(frozen=True, kw_only=True)  # without slots: what is computed once is kept in the instance
class TrackingProblem:
    """Goal, dynamics, limits and bounds over a horizon."""

    step_s: float  # grid h [s]
    reference_N: Array  # shape (n,); desired output tension at 0, h, 2 h ... [N]
    plants: tuple[PlantModel, ...]  # driven by the same force; the nominal one first
    chains: int  # the first so many plants are what is designed for; one after them has stiffer bristles
    power: float  # order of the mean over the plants: 1 is the mean, large is the worst
    effort_weight: float  # of the mean squared force beside the mean squared tension error [-]
    travel_weight: float  # cost of a newton of travel of the force, up and down [N]
    least_travel_N: float  # travel in one step below this costs less [N]
    penalty_N: float  # cost of a newton outside the bounds [N]
    limits: ForceLimits
    # low_N, high_N: bounds of the tension anywhere along the tendon [N]
    low_N: float
    high_N: float
    start_N: float  # force of row 0, which is given [N]
    rest_N: float  # tension of the rest that travel counts from [N]

    @classmethod
    def of(
        cls,
        chains: tuple[Chain, ...],
        states: tuple[ChainState, ...],
        references_N: Sequence[Array],
        step_s: float,
        limits: ForceLimits,
        options: TrackOptions,
        *,
        initial_tension_N: float,
        start_N: float,
        inverse_N: Array,
        objective: Objective = Objective.WORST,
    ) -> "TrackingProblem":
        """The problem of chains in these states, the nominal one first; `inverse_N` is its exact inverse, shape (n,).

        The travel of that within the limits is what the task needs. `references_N` is the reference of each chain,
        shape (n,); those left out have that of the nominal one.
        """
        reference_N, *others_N = references_N
        span = max(float(np.ptp(reference_N)), 1e-3 * float(reference_N.max()))
        margin = 1e-4 * span  # the search aims a little inside, so that what it finds is inside
        travel = max(travel_N(limits.apply(inverse_N, step_s, start_N)), 1e-3 * span)
        slack = 1e-3 * min(float(reference_N.min()), initial_tension_N)
        plants = []
        every = (reference_N, *(others_N or [reference_N] * (len(chains) - 1)))
        for chain, state, wanted in zip(chains, states, every, strict=True):
            rest_m = chain.rest_state(initial_tension_N).near_position_m
            bounds = motion_bounds(limits.motion, span, initial_tension_N / rest_m)
            plants.append(PlantModel(chain=chain, state=state, origin_m=rest_m, wanted_N=wanted, bounds=bounds))
        if len(chains) == 1 and options.stiffer_weight > 0:
            plants += _stiffer(plants[0], inverse_N, step_s, options.stiffer_weight)
        # What the largest force cannot hold, only shaking gains: there travel has to pay off more. It frees the output
        # of friction at most, so that far out of reach the rest of the reference is still followed.
        held = held_N(chains[0], limits)
        missed = np.maximum(reference_N - held, 0.0)
        shaken = _SHAKEN * float(np.mean(missed * np.minimum(missed, limits.maximum_N - held)))
        doubled = options.travel_weight * span**2 + (shaken if options.travel_weight > 0 else 0.0)
        return cls(
            step_s=step_s,
            reference_N=reference_N,
            plants=tuple(plants),
            chains=len(chains),
            power=_POWER[objective] if len(chains) > 1 else 1.0,
            effort_weight=options.effort_weight,
            travel_weight=doubled / travel,
            least_travel_N=0.05 * travel / len(reference_N),
            penalty_N=4 * span + options.effort_weight * float(reference_N.max()),
            limits=limits,
            low_N=options.minimum_tension_N + margin if options.minimum_tension_N > 0 else slack,
            high_N=options.maximum_tension_N - margin,
            start_N=start_N,
            rest_N=initial_tension_N,
        )

    @classmethod
    def from_rest(
        cls,
        chains: tuple[Chain, ...],
        references_N: Sequence[Array],
        step_s: float,
        limits: ForceLimits,
        options: TrackOptions,
        *,
        start_N: float,
        inverse: Inversion,
        objective: Objective = Objective.WORST,
    ) -> "TrackingProblem":
        """The problem of chains at rest under the tension `start_N`; `inverse` is that of the nominal one."""
        return cls.of(
            chains,
            tuple(chain.rest_state(start_N) for chain in chains),
            references_N,
            step_s,
            limits,
            options,
            initial_tension_N=start_N,
            start_N=limits.start(start_N),
            inverse_N=inverse.force_N,
            objective=objective,
        )

    @cached_property
    def runs(self) -> tuple[PlantRun, ...]:
        """Every plant at row 0."""
        found, given = [], ChainInputs.of_force(np.array([self.start_N]))
        for plant in self.plants:
            simulator, x = Simulator(plant.chain, self.step_s, plant.state, given), plant.state.vector()
            run = PlantRun(
                simulator=simulator,
                start=simulator.checkpoint(),
                tension_N=tensions_of(plant.chain, x, plant.state.time_s),
                position_m=plant.state.near_position_m - plant.origin_m,
            )
            found.append(run)
        return tuple(found)

    def clipped(self, force_N: Array) -> Array:
        """Force, shape (n,) [N], as applied by the actuator from the start of this horizon."""
        return self.limits.apply(force_N, self.step_s, self.start_N)

    def piece(self, rows: slice, states: tuple[ChainState, ...], start_N: float) -> "TrackingProblem":
        """The same problem on some of its rows, entered in these states of the plants and with this force [N]."""
        reference = self.reference_N[rows]
        return replace(
            self,
            reference_N=reference,
            travel_weight=self.travel_weight * len(self.reference_N) / len(reference),  # beside a mean of fewer rows
            plants=tuple(
                replace(p, state=x, wanted_N=p.wanted_N[rows]) for p, x in zip(self.plants, states, strict=True)
            ),
            start_N=start_N,
        )


def _stiffer(plant: PlantModel, inverse_N: Array, step_s: float, weight: float) -> list[PlantModel]:
    """The plant with stiffer bristles; none where they make no difference."""
    chain, force = plant.chain.stiffened(_STIFFER), np.maximum(inverse_N, 0.0)
    own, stiff = (simulate(each, force, step_s, state=plant.state).output_tension_N for each in (plant.chain, chain))
    least = _SAME * float(np.ptp(plant.wanted_N))
    if not len(own) == len(stiff) == len(force) or float(np.sqrt(np.mean((own - stiff) ** 2))) < least:
        return []
    # The motion of the actuator is bounded as the design model has it.
    return [replace(plant, chain=chain, wanted_N=stiff, weight=weight, bounds=())]


def travel_N(force_N: Array) -> float:
    """Total variation of a force, shape (n,) [N]."""
    return float(np.abs(np.diff(force_N)).sum())
