"""The observer in an export: the forward chain led by the measured input tension, what encloses it, golden vectors.

A scenario whose friction sets in gradually (spread plays, as `identify` fits them) has the capstan law forward instead.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.compensators.tuning import BOUND_MASSES, BOUND_SPREAD
from tendonff.compensator.export.golden import GROWTH, NUDGE, easy_rows, is_easy, nudged
from tendonff.compensator.export.text.table_index import rounded
from tendonff.models.cached import cached_property
from tendonff.models.capstan import CapstanLaw, held_within
from tendonff.models.capstan.spread_bounds import play_exponents
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.tuning import Tunable
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulator, simulate

FOLLOW_S = 0.005
"""Time in which the far end of the model follows what the position of the near end says."""

_INPUT_MAX = 2.0
"""Largest input tension that is accepted, over that of the largest accepted output in full slip."""

_NOTHING = 1e-2
"""Share of the stretch that position and tension of a real rig leave unexplained at least."""

_LEAST_CHANGE = 0.05
"""Change of the tension since the start that stiffness off may at least explain, over the tension there."""

_CORNERS = ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
_TUNED = (Tunable.MU_PULL, Tunable.MU_RELEASE, Tunable.TENDON_STIFFNESS, Tunable.LOAD_STIFFNESS)
_FAR_ROWS = 200  # of the golden vectors with a position
_FAR_FROM = 10  # rows before a difference, or a step that is hard, that are left out too
_DELAY_ROWS = 40  # after which that position departs from the chain's own


@dataclass(frozen=True, slots=True, kw_only=True)
class Enclosure:
    """Two plays that enclose the output for any input, with what they leave out as a margin.

    Attributes
    ----------
    low_pull, low_release, high_pull, high_release : float
        mu theta of the play that is never above the output, and of that never below it [-].
    adhesion_N : float
        Load-independent tension p [N].
    margin : float
        In ln(T + p), >= 0.
    by_estimate : bool
        The margin is around the estimate instead, since joints move the path and no play over its whole angle holds.
    """

    low_pull: float
    low_release: float
    high_pull: float
    high_release: float
    adhesion_N: float
    margin: float
    by_estimate: bool

    def history_N(self, input_N: FloatArray, start_N: float, estimate_N: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bound for an input history from rest, with the estimate inside, each of shape (n,) [N]."""
        p, u = self.adhesion_N, input_N + self.adhesion_N
        low = held_within(start_N + p, u * math.exp(-self.low_pull), u * math.exp(self.low_release))
        high = held_within(start_N + p, u * math.exp(-self.high_pull), u * math.exp(self.high_release))
        if self.by_estimate:
            low = high = estimate_N + p
        low, high = low * math.exp(-self.margin) - p, high * math.exp(self.margin) - p
        return np.maximum(np.minimum(low, estimate_N), 0.0), np.maximum(high, estimate_N)


@dataclass(frozen=True, kw_only=True)
class ObserverDesign:
    """Parts of an observer of a problem's output tension.

    Attributes
    ----------
    problem : Problem
    spread : float
        Relative half-width of what friction of each direction, and stiffness, may be.
    """

    problem: Problem
    spread: float = BOUND_SPREAD

    @cached_property
    def law(self) -> CapstanLaw:
        """The capstan law of the whole path."""
        return CapstanLaw.of(self.problem.transmission)

    @cached_property
    def load_factors(self) -> tuple[float, float]:
        """Least and largest coefficient over that at the reference tension, for tensions of the problem [-]."""
        law, (least, most) = self.law, accepted_range(self.problem)
        if law.load_exponent == 0:
            return 1.0, 1.0
        tensions = law.lowered_N(law.lifted_N(most) * math.exp(law.pull_exponent)), least
        low, high = (
            float((tension + law.adhesion_N) / law.reference_tension_N) ** -law.load_exponent for tension in tensions
        )
        return low, high

    @cached_property
    def chain(self) -> Chain:
        """The chain behind the tension cell."""
        return self.problem.chain.led_by_tension()

    @property
    def follows_far_end(self) -> bool:
        """Whether a measured position tells that something else moves the far end."""
        return self.law.plays is None and self.chain.far_joint is None

    @cached_property
    def largest(self) -> tuple[float, float]:
        """Largest mu theta pulling and releasing, of any play and anywhere in the joints' range [-]."""
        transmission, motion = self.problem.transmission, self.problem.chain.motion
        laws = [self.law]
        if motion is not None:
            laws += [
                CapstanLaw.of(transmission, dict(zip(motion.names, row.tolist(), strict=True)))
                for row in motion.angle_rad[:: max(1, len(motion.angle_rad) // 100)]
            ]
        factor = self.load_factors[1]
        return factor * max(_most_pull(law) for law in laws), factor * max(_most_release(law) for law in laws)

    @cached_property
    def input_max_N(self) -> float:
        """Largest input tension that is accepted [N]."""
        p, highest = self.law.adhesion_N, accepted_range(self.problem)[1]
        slipping = (highest + p) * math.exp((1 + self.spread) * self.largest[0])
        return min(_INPUT_MAX * slipping, 1e6)

    @cached_property
    def course_N(self) -> FloatArray:
        """Input tension under which the output follows the problem's reference [N]."""
        return self.input_for(self.chain, self.problem.reference.tension_N)

    def input_for(self, chain: Chain, output_N: FloatArray) -> FloatArray:
        """Input tension for an output from rest, within the actuator's limits [N]."""
        start, step = float(output_N[0]), self.problem.reference.step_s
        force = invert(chain, output_N, step, initial_tension_N=start).force_N
        if self.problem.transmission.actuator.drive is Drive.FORCE:
            force = self.problem.limits.apply(force, step, start)
        return np.clip(force, 0.0, self.input_max_N)

    def estimate_N(self, chain: Chain, input_N: FloatArray) -> FloatArray:
        """Output tension by the observer without a position, from rest under the first input [N]."""
        if self.law.plays is not None:
            return self.law.output_history_N(input_N)
        run = simulate(chain, input_N, self.problem.reference.step_s, initial_tension_N=float(input_N[0]))
        return run.require().output_tension_N

    @cached_property
    def enclosure(self) -> Enclosure:
        """Enclosure of the output: mu theta of each direction within the spread, and the margin along the reference.

        The margin is the largest over plants of 40 masses: friction of the two directions at every corner of what it
        may be, with tendon and load as the scenario, softer and stiffer.
        """
        moving = self.problem.chain.motion is not None
        least_pull, least_release = (0.0, 0.0) if moving else (_least_pull(self.law), _least_release(self.law))
        factor = self.load_factors[0]
        least_pull, least_release = factor * least_pull, factor * least_release
        wide, narrow = 1 + self.spread, 1 - self.spread
        bare = Enclosure(
            low_pull=wide * self.largest[0],
            low_release=wide * self.largest[1] if moving else narrow * least_release,
            high_pull=wide * self.largest[0] if moving else narrow * least_pull,
            high_release=wide * self.largest[1],
            adhesion_N=self.law.adhesion_N,
            margin=0.0,
            by_estimate=moving,
        )
        course, p, tiny = self.course_N, self.law.adhesion_N, np.finfo(np.float64).tiny
        low, high = bare.history_N(course, float(course[0]), self.estimate_N(self.chain, course))
        margin = 0.0
        for plant in self._plants():
            run = simulate(plant, course, self.problem.reference.step_s, initial_tension_N=float(course[0])).require()
            output = np.maximum(run.output_tension_N + p, tiny)
            above, below = np.log(output / np.maximum(high + p, tiny)), np.log(np.maximum(low + p, tiny) / output)
            margin = max(margin, float(above.max()), float(below.max()))
        return replace(bare, margin=margin)

    def _plants(self) -> list[Chain]:
        plant = TunedChain.of(self.problem.transmission, self.problem.level, _TUNED, BOUND_MASSES)
        softer, stiffer, corners = 1 - self.spread, 1 + self.spread, _CORNERS[1:]
        every = [(1.0, _CORNERS), (softer, corners[::3]), (stiffer, corners[::3])]
        return [
            plant.with_factors(
                dict(zip(_TUNED, (*(1 + place * self.spread for place in places), elastic, elastic), strict=True))
            ).led_by_tension()
            for elastic, some in every
            for places in some
        ]


def _most_pull(law: CapstanLaw) -> float:
    return float(-play_exponents(-law.pull_exponent, law.pull_spread).min())


def _least_pull(law: CapstanLaw) -> float:
    return float(-play_exponents(-law.pull_exponent, law.pull_spread).max())


def _most_release(law: CapstanLaw) -> float:
    return float(play_exponents(law.release_exponent, law.release_spread).max())


def _least_release(law: CapstanLaw) -> float:
    return float(play_exponents(law.release_exponent, law.release_spread).min())


def observer_code(design: ObserverDesign) -> dict[str, object]:
    """Values for the templates of the observer."""
    problem, chain, held = design.problem, design.chain, design.enclosure
    slope = chain.rest_state(1.0).near_position_m if design.follows_far_end else 0.0
    largest = accepted_range(problem)[1] + held.adhesion_N
    plays = design.law.plays
    return {
        "observer": {
            "far": design.follows_far_end,
            "by_estimate": held.by_estimate,
            "margin": held.margin,
            "masses": BOUND_MASSES,
            "spread": design.spread,
            "input_max": design.input_max_N,
            "narrow": math.exp(-held.margin),
            "wide": math.exp(held.margin),
            "low_pull": math.exp(-held.low_pull),
            "low_release": math.exp(held.low_release),
            "high_pull": math.exp(-held.high_pull),
            "high_release": math.exp(held.high_release),
            "gain": min(problem.reference.step_s / FOLLOW_S, 0.8),
            "least_change": _LEAST_CHANGE,
            "slack": _explained(design, chain) if design.follows_far_end else 0.0,
            "most_m": max(10 * slope * largest, 1e-6),
            "lows": () if plays is None else plays.low,
            "highs": () if plays is None else plays.high,
        },
    }


def _explained(design: ObserverDesign, chain: Chain) -> float:
    """Of a position, what stiffness that is off explains [m/N]."""
    return chain.rest_state(1.0).near_position_m * (design.spread + _NOTHING)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverGolden:
    """Golden vectors of the observer, one row per sample."""

    # input_N, output_N, low_N, high_N: shape (rows,); along the course of the other modules, without a position
    input_N: FloatArray
    output_N: FloatArray
    low_N: FloatArray
    high_N: FloatArray
    # position_m, far_output_N: shape (rows,); the beginning of it once more while something moves the far end; empty
    # where a position is not used, or the course is too short
    position_m: FloatArray
    far_output_N: FloatArray
    most_N: float  # largest input that is accepted [N]
    led_to_N: float  # an input away from the first [N]
    # any_low, any_high: bounds of any history as multiples of input and adhesion
    any_low: float
    any_high: float
    knows_friction: bool  # a start in motion finds the friction, from `friction_at` on
    friction_at: int

    def given(self, *, without_position: bool = False) -> FloatArray:
        """Inputs of the steps, shape (rows, 2): input [N], and position [m], NaN where it is not measured."""
        position = np.full(len(self.input_N), np.nan) if without_position else self.position_m
        return np.stack([self.input_N[: len(position)], position], axis=1)

    def as_far_as(self, found_N: FloatArray, apart_N: float) -> "ObserverGolden":
        """The rows before single precision leaves the model, by the answers of the exported code.

        Static friction above dynamic makes steps that its solver may not finish: it then holds and says so.
        """
        beyond = np.flatnonzero(~(np.abs(found_N - self.output_N) <= apart_N))
        rows = slice(max(int(beyond[0]) - _FAR_FROM, 2) if beyond.size else None)
        found = {name: getattr(self, name)[rows] for name in ("input_N", "output_N", "low_N", "high_N")}
        if len(found["input_N"]) < _FAR_ROWS:
            found |= dict.fromkeys(("position_m", "far_output_N"), np.empty(0))
        return replace(self, **found)


def observer_golden(design: ObserverDesign, chain: Chain, course_N: FloatArray, precision: Precision) -> ObserverGolden:
    """Golden vectors along the course of the other modules, whose chain has the joints' motion in it."""
    moved = chain.led_by_tension()
    given = rounded(design.input_for(moved, course_N), precision)
    given[0] = course_N[0]
    output = design.estimate_N(moved, given)
    if design.law.plays is None:
        rows = _repeatable(design, moved, given, output)
        given, output = given[:rows], output[:rows]
    low, high = design.enclosure.history_N(given, float(given[0]), output)
    position, layout = np.empty(0), moved.layout
    far = position
    if design.follows_far_end and len(given) >= _FAR_ROWS:  # in fewer the far end hardly departs
        position, far = _with_far_end(design, moved, given[:_FAR_ROWS], precision)
    return ObserverGolden(
        input_N=given,
        output_N=output,
        low_N=low,
        high_N=high,
        position_m=position,
        far_output_N=far,
        most_N=design.input_max_N,
        led_to_N=0.5 * float(given[0]) if given[0] > 0 else 0.1 * design.input_max_N,
        any_low=math.exp(-design.enclosure.low_pull),
        any_high=math.exp(design.enclosure.high_release),
        knows_friction=design.law.plays is None and layout.friction_states == ("f_s",),
        friction_at=chain.layout.part(layout.friction_states[0]).start if layout.friction_states else 0,
    )


def _repeatable(design: ObserverDesign, chain: Chain, input_N: FloatArray, output_N: FloatArray) -> int:
    """Rows over which small differences stay small, and whose steps are easy, with some rows less at their end."""
    step, start = design.problem.reference.step_s, float(input_N[0])
    scale = max(float(np.abs(input_N).max()), start)
    run = simulate(chain, nudged(input_N, scale), step, initial_tension_N=start)
    other = run.output_tension_N
    apart = np.abs(other - output_N[: len(other)]) > GROWTH * NUDGE * scale
    same = int(np.argmax(apart)) if apart.any() else len(other)
    rows = min(same, easy_rows(chain, input_N, step, start))
    return rows if rows == len(input_N) else max(rows - _FAR_FROM, 2)


def _with_far_end(
    design: ObserverDesign, chain: Chain, input_N: FloatArray, precision: Precision
) -> tuple[FloatArray, FloatArray]:
    """A position that departs from the chain's own, and what the observer makes of it, before a step that is hard.

    Empty where the far end has hardly departed by then.
    """
    step, start = design.problem.reference.step_s, float(input_N[0])
    rest = chain.rest_state(start)
    ramp = np.clip((np.arange(len(input_N)) - _DELAY_ROWS) / _DELAY_ROWS, 0.0, 1.0)
    run = simulate(chain, input_N, step, initial_tension_N=start).require()
    off = 3 * _explained(design, chain) * float(input_N.max() + design.law.adhesion_N) * ramp
    position = rounded(run.near_position_m - rest.near_position_m + off, precision)
    simulator = Simulator(chain, step, rest, ChainInputs.of_force(input_N[:1]))
    gain, far, output = min(step / FOLLOW_S, 0.8), 0.0, [start]
    for force, at in zip(input_N[1:], position[1:], strict=True):
        rows = simulator.advance(ChainInputs.of(1, near_force_N=np.array([force]), far_rest_m=np.array([far])))
        if not is_easy(rows):
            kept = max(len(output) - _FAR_FROM, 0)
            kept = kept if kept >= 3 * _DELAY_ROWS else 0
            return position[:kept], np.array(output[:kept])
        output.append(float(rows.tension_N[0, -1]))
        far += gain * (float(at) - (float(rows.ends_m[0, 0]) - rest.near_position_m))
    return position, np.array(output)
