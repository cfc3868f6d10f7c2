"""The chain under a measured input tension, with exact sensitivities over what identification looks for and the input.

The tension cell sits between motor and tendon: the measured tension is f_1 itself. The near end is therefore a mass too
light to matter that the measured tension pulls::

    T_in(t) --> [~0] ~~f_1~~ (m_1) ~~ ... ~~ (m_N) ~~f_{N+1}~~ [m_l]--spring--|        compared: f_{N+1}, q_a - q_l

The history before the first sample is not known. The run starts at rest under the first output tension and reaches the
first input over a short smooth lead-in, so that the output starts where it was measured.

Friction forgets: what a change of the input did is wiped out by the next full sweep. So its slopes are those of windows
of many seconds, each with knots from some seconds before it on, at a cost that grows with the length only.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.parameters import Friction, Transmission
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import Whole, whole_of
from tendonff.ocp.errors import SolveError
from tendonff.ocp.sensitivity import Parameter, force_sensitivity, parameter_sensitivity
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.simulate import simulate

LEAD_IN_S = 0.4
LEAST_TENSION_N = 1e-6
_DIFFERENCE = 1e-4  # of a parameter


class Reading(StrEnum):
    """Numbers of a measurement beside those of the tendon: offsets of the cells [N] and their gains [-]."""

    INPUT = "input_offset_N"
    OUTPUT = "output_offset_N"
    INPUT_GAIN = "input_gain"
    OUTPUT_GAIN = "output_gain"


EXACT: Mapping[str, float] = {
    Reading.INPUT: 0.0,
    Reading.OUTPUT: 0.0,
    Reading.INPUT_GAIN: 1.0,
    Reading.OUTPUT_GAIN: 1.0,
}
"""Readings of cells without an error."""


Numbers = Mapping[str, float]
"""Numbers by name: fields of `Whole` and readings. As a direction: how much each of them changes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Piece of measured input."""

    input_N: Array  # shape (n,); as the cell read it, low-passed
    step_s: float
    first_output_N: float  # output at the first sample, as the cell read it
    motion: JointMotion | None = None  # joint angles, from the first sample on; they stand still before it
    turned_N: float | None = None  # input at its last turn before the first sample; None: it came from rest


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainResponse:
    """Response of the chain to a drive, at the samples of the drive."""

    output_N: Array  # shape (n,); output as the cell would read it
    elongation_m: Array  # shape (n,); q_a - q_l
    near_m: Array  # shape (n,); q_a
    # output_slopes, elongation_slopes, near_slopes: shape (n, k); over the parameters asked for
    output_slopes: Array
    elongation_slopes: Array
    near_slopes: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RunUp:
    """A drive as it is simulated: from rest over a short lead-in, at a step near the longest one."""

    force_N: Array  # shape (lead + rows,)
    step_s: float
    lead: int  # rows of the lead-in
    # thin, refine: samples per step, and steps per sample
    thin: int
    refine: int
    rest_N: float  # tension at rest
    motion: JointMotion | None  # from the start of the lead-in

    def sampled(self, x: Array, rows: int) -> Array:
        """A simulated channel at the samples of the drive, of which there are `rows`."""
        x = x[self.lead :]
        if self.refine > 1:
            return np.asarray(x[:: self.refine])
        if self.thin == 1:
            return x
        return np.asarray(CubicSpline(np.arange(len(x)) * self.thin, x, axis=0)(np.arange(rows)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainModel:
    """A transmission as the fit sees it."""

    transmission: Transmission  # gives what is not looked for: path, masses, load
    level: Level
    count: int  # number N of masses
    longest_step_s: float = 1e-3  # largest time step; the samples are interpolated or thinned to stay near it
    load_reference_N: float = 1.0  # T_0 of a load exponent that the scenario does not have

    def numbers(self) -> dict[str, float]:
        """The scenario's own numbers, the readings zero."""
        whole, exponent = whole_of(self.transmission, self.level), self.transmission.friction.load_dependence[0]
        own = {name.value: whole.value(name) for name in Parameter if name is not Parameter.LOAD_EXPONENT}
        return own | {Parameter.LOAD_EXPONENT.value: exponent} | dict(EXACT)

    def whole(self, numbers: Numbers) -> Whole:
        """The undivided tendon with given numbers; its law knows the load where their exponent is not zero."""
        t, exponent = self.transmission, numbers[Parameter.LOAD_EXPONENT]
        names = {name.value for name in Parameter if exponent or name is not Parameter.LOAD_EXPONENT}
        loaded = replace(t, friction=self.loaded(exponent))
        return whole_of(loaded, self.level).changed({k: v for k, v in numbers.items() if k in names})

    def loaded(self, exponent: float) -> Friction:
        """The friction with a load exponent, at the scenario's reference tension if that has one."""
        friction = self.transmission.friction
        if exponent == 0:
            return friction if not friction.load_exponent else replace(friction, load_exponent=None)
        reference = friction.reference_tension_N or self.load_reference_N
        return replace(
            friction, load_exponent=exponent, reference_tension_N=reference, pull_spread=None, release_spread=None
        )

    def chain(self, whole: Whole, motion: JointMotion | None = None) -> Chain:
        """The chain with a massless near end."""
        chain = Chain.of(replace(self.transmission, motion=motion), self.level, self.count)
        return replace(chain.led_by_tension(), elements=whole.divided(self.count, motion))

    def respond(self, numbers: Numbers, drive: Drive, over: Sequence[Numbers] = ()) -> ChainResponse:
        """Simulate a drive with all numbers, with derivatives along directions; SolveError if that fails."""
        whole, run_up = self.whole(numbers), self.with_lead_in(numbers, drive)
        chain = self.chain(whole, run_up.motion)
        if over and chain.moving:
            return self._differences(numbers, drive, over)
        if over:
            output, near, far, slopes = self._differentiate(numbers, drive, chain, over)
        else:
            run = simulate(chain, run_up.force_N, run_up.step_s, initial_tension_N=run_up.rest_N).require()
            output, near, far = run.output_tension_N, run.near_position_m, run.far_position_m
            slopes = np.zeros((len(run_up.force_N), 3, 0))
        rows = len(drive.input_N)
        return ChainResponse(
            output_N=numbers[Reading.OUTPUT_GAIN] * run_up.sampled(output, rows) + numbers[Reading.OUTPUT],
            elongation_m=run_up.sampled(near - far, rows),
            near_m=run_up.sampled(near, rows),
            output_slopes=run_up.sampled(slopes[:, 0], rows),
            elongation_slopes=run_up.sampled(slopes[:, 1], rows),
            near_slopes=run_up.sampled(slopes[:, 2], rows),
        )

    def _differences(self, numbers: Numbers, drive: Drive, over: Sequence[Numbers]) -> ChainResponse:
        """Derivatives by differences: compiled runs of a chain whose masses differ cost less than its exact slopes."""
        middle = self.respond(numbers, drive)
        channels = ("output_N", "elongation_m", "near_m")
        slopes = np.zeros((len(channels), len(drive.input_N), len(over)))
        for k, direction in enumerate(over):
            # what is zero may not fall below it
            both = all(numbers[name] for name in direction)
            step = _DIFFERENCE * min(abs(numbers[name]) / abs(by) if both else 1.0 for name, by in direction.items())
            above = self.respond(_moved(numbers, direction, step), drive)
            below = self.respond(_moved(numbers, direction, -step), drive) if both else middle
            for channel, found in zip(channels, slopes, strict=True):
                found[:, k] = (getattr(above, channel) - getattr(below, channel)) / ((2 if both else 1) * step)
        return replace(middle, output_slopes=slopes[0], elongation_slopes=slopes[1], near_slopes=slopes[2])

    def with_lead_in(self, numbers: Numbers, drive: Drive) -> RunUp:
        """Kind of input that a drive is simulated as."""
        thin = max(1, int(self.longest_step_s / drive.step_s + 1e-6))
        refine = max(1, int(np.ceil(drive.step_s / self.longest_step_s - 1e-6)))
        samples = (drive.input_N - numbers[Reading.INPUT]) / numbers[Reading.INPUT_GAIN]
        rows = np.arange(len(samples))
        if refine > 1:
            samples = CubicSpline(rows, samples)(np.arange((len(rows) - 1) * refine + 1) / refine)
        elif thin > 1:
            last = int(np.ceil((len(rows) - 1) / thin)) * thin
            samples = np.concatenate([samples, np.full(last - len(rows) + 1, samples[-1])])[::thin]
        step = drive.step_s * thin / refine
        rest = (drive.first_output_N - numbers[Reading.OUTPUT]) / numbers[Reading.OUTPUT_GAIN]
        rest = max(rest, LEAST_TENSION_N)
        each = max(8, int(LEAD_IN_S / step))
        ramp = np.clip(np.arange(each) / (each / 2), 0, 1)
        smooth = ramp * ramp * (3 - 2 * ramp)
        levels = [rest, *(() if drive.turned_N is None else (drive.turned_N,)), samples[0]]
        lead = each * (len(levels) - 1)
        force = np.concatenate([*(low + (high - low) * smooth for low, high in pairwise(levels)), samples])
        return RunUp(
            force_N=np.maximum(force, 0.0),
            step_s=step,
            lead=lead,
            thin=thin,
            refine=refine,
            rest_N=rest,
            motion=drive.motion and replace(drive.motion, time_s=drive.motion.time_s + lead * step),
        )

    def _differentiate(
        self, numbers: Numbers, drive: Drive, chain: Chain, over: Sequence[Numbers]
    ) -> tuple[Array, Array, Array, Array]:
        """Output, positions of both ends, and slopes of output, elongation and near position, shape (rows, 3, k)."""
        asked = {name for direction in over for name in direction}
        parts = [{name: direction[name] for name in Parameter if name in direction} for direction in over]
        moved = [k for k, part in enumerate(parts) if part]
        whole, run_up = self.whole(numbers), self.with_lead_in(numbers, drive)
        force, step, rest = run_up.force_N, run_up.step_s, run_up.rest_N
        run = parameter_sensitivity(whole, chain, force, step, [parts[k] for k in moved], initial_tension_N=rest)
        if run.ends_slopes is None:
            raise SolveError("the sensitivities of the ends' positions are missing")
        near, far = run.ends_slopes[:, 0], run.ends_slopes[:, 1]
        gain = numbers[Reading.OUTPUT_GAIN]
        slopes = np.zeros((len(force), 3, len(over)))
        slopes[:, :, moved] = np.stack([gain * run.tension_slopes[:, 0], near - far, near], axis=1)
        columns = dict[str, Array]()
        if Reading.OUTPUT in asked:
            columns[Reading.OUTPUT] = np.zeros((len(force), 3))
            columns[Reading.OUTPUT][:, 0] = 1.0
        if Reading.INPUT in asked:
            knots = np.array([0, len(force) - 1])
            shift = force_sensitivity(chain, force, step, knots, state=chain.rest_state(rest))
            columns[Reading.INPUT] = np.zeros((len(force), 3))
            by_all = gain * shift.tension_slopes[:, 0].sum(axis=1)
            columns[Reading.INPUT][:, 0] = -by_all / numbers[Reading.INPUT_GAIN]
        if Reading.OUTPUT_GAIN in asked:
            columns[Reading.OUTPUT_GAIN] = np.zeros((len(force), 3))
            columns[Reading.OUTPUT_GAIN][:, 0] = run.tension_N[:, -1]
        if Reading.INPUT_GAIN in asked:
            change = _DIFFERENCE * numbers[Reading.INPUT_GAIN]
            both_ways = [_moved(numbers, {Reading.INPUT_GAIN: sign}, change) for sign in (1.0, -1.0)]
            forces = [self.with_lead_in(other, drive).force_N for other in both_ways]
            ends = [simulate(chain, f, step, initial_tension_N=rest).require() for f in forces]
            more, less = (
                np.stack([gain * e.output_tension_N, e.near_position_m - e.far_position_m, e.near_position_m], axis=1)
                for e in ends
            )
            columns[Reading.INPUT_GAIN] = (more - less) / (2 * change)
        for k, direction in enumerate(over):
            for name in columns.keys() & direction.keys():
                slopes[:, :, k] += direction[name] * columns[name]
        return run.tension_N[:, -1], run.ends_m[:, 0], run.ends_m[:, 1], slopes


def _moved(numbers: Numbers, direction: Numbers, by: float) -> dict[str, float]:
    return {**numbers, **{name: numbers[name] + by * share for name, share in direction.items()}}


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWindow:
    """Slopes over the input at knots, linear between them."""

    time_s: Array  # shape (n,); from the first sample of the drive
    first_s: float  # where the window itself begins; what is before belongs to the window before
    knots_s: Array  # shape (k,)
    output_slopes: Array  # shape (n, k) [N/N]
    # near_slopes, elongation_slopes: shape (n, k) [m/N]
    near_slopes: Array
    elongation_slopes: Array


def input_windows(
    model: ChainModel,
    numbers: Numbers,
    drive: Drive,
    *,
    knot_s: float,
    window_s: float,
    before_s: float,
) -> Iterator[InputWindow]:
    """Windows of a drive of about `window_s`, with knots from about `before_s` earlier on; SolveError if the run
    fails.
    """
    run_up = model.with_lead_in(numbers, drive)
    chain = model.chain(model.whole(numbers), run_up.motion)
    run = simulate(chain, run_up.force_N, run_up.step_s, initial_tension_N=run_up.rest_N, record=True).require()
    if run.states is None:
        raise SolveError("the run did not keep its states")
    last, step = len(run_up.force_N) - 1, run_up.step_s
    edges = np.linspace(0, last, max(1, round((last - run_up.lead) * step / window_s)) + 1).astype(int)
    stride = max(1, round(knot_s / step))
    for first, stop in pairwise(edges.tolist()):
        start = max(first - round(before_s / step), 0)
        knots = np.unique(np.append(np.arange(0, stop - start, stride), stop - start))
        state = ChainState.from_vector(run.states[start], chain.layout, start * step)
        found = force_sensitivity(chain, run_up.force_N[start : stop + 1], step, knots, state=state, ends=True)
        if found.ends_slopes is None:
            raise SolveError("the sensitivities of the ends' positions are missing")
        near, far = found.ends_slopes[:, 0], found.ends_slopes[:, 1]
        yield InputWindow(
            time_s=(np.arange(start, stop + 1) - run_up.lead) * step,
            first_s=(first - run_up.lead) * step,
            knots_s=(start + knots - run_up.lead) * step,
            output_slopes=found.tension_slopes[:, 0],
            near_slopes=near,
            elongation_slopes=near - far,
        )
