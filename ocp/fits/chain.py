"""The chain under a measured input tension, with exact sensitivities over what identification looks for and the input.

The force cell sits between motor and tendon: the measured tension is f_1 itself. The near end is therefore a mass too
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

from tendonff.models.assembly import End
from tendonff.models.chain import Chain
from tendonff.models.elements import Whole, whole_of
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.path import JointMotion
from tendonff.ocp.errors import SolveError
from tendonff.ocp.sensitivity import Parameter, force_sensitivity, parameter_sensitivity
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array

NEAR_MASS_KG = 1e-6
LEAD_IN_S = 0.4
LEAST_TENSION_N = 1e-6
_DIFFERENCE = 1e-4  # of a parameter


class DynamicParameter(StrEnum):
    """What the dynamic fit may look for; values are names of estimates."""

    # MU_PULL, MU_RELEASE: mu_dynamic in either direction [-]; the static coefficients keep their ratio
    MU_PULL = "mu_dynamic"
    MU_RELEASE = "mu_dynamic_release"
    STATIC_EXCESS = "static_excess"  # mu_static/mu_dynamic - 1 in both directions [-], >= 0
    # STRIBECK_VELOCITY, VISCOUS, BRISTLE, ADHESION: omega [m/s], b [N s/m], sigma0 [N/m], p [N]
    STRIBECK_VELOCITY = "stribeck_velocity_m_per_s"
    VISCOUS = "viscous_N_s_per_m"
    BRISTLE = "bristle_stiffness_N_per_m"
    ADHESION = "adhesion_N"
    # STIFFNESS, RELAXING, RELAXATION_TIME, DAMPING: k1, k2 [N/m], tau [s], c [N s/m]
    STIFFNESS = "stiffness_N_per_m"
    RELAXING = "relaxing_stiffness_N_per_m"
    RELAXATION_TIME = "relaxation_time_s"
    DAMPING = "damping_N_s_per_m"
    # INPUT_BIAS, OUTPUT_BIAS: what the cells read at zero tension [N]
    INPUT_BIAS = "input_bias_N"
    OUTPUT_BIAS = "output_bias_N"


D = DynamicParameter
_DIRECT = {
    D.STRIBECK_VELOCITY: Parameter.STRIBECK_VELOCITY,
    D.VISCOUS: Parameter.VISCOUS,
    D.BRISTLE: Parameter.BRISTLE_STIFFNESS,
    D.ADHESION: Parameter.ADHESION,
    D.STIFFNESS: Parameter.STIFFNESS,
    D.RELAXING: Parameter.RELAXING_STIFFNESS,
    D.RELAXATION_TIME: Parameter.RELAXATION_TIME,
    D.DAMPING: Parameter.DAMPING,
}
_MUS = (Parameter.MU_DYNAMIC_PULL, Parameter.MU_STATIC_PULL, Parameter.MU_DYNAMIC_RELEASE, Parameter.MU_STATIC_RELEASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """One piece of measured input."""

    input_N: Array  # shape (n,); as the cell read it, low-passed
    step_s: float
    first_output_N: float  # output at the first sample, as the cell read it
    motion: JointMotion | None = None  # joint angles, from the first sample on; they stand still before it


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainResponse:
    """What the chain makes of a drive, at the samples of the drive."""

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
    symmetric: bool = False  # mu_dynamic counts for both directions

    def values(self) -> dict[DynamicParameter, float]:
        """The scenario's own values of all parameters."""
        w = whole_of(self.transmission, self.level)
        mu = w.value(Parameter.MU_DYNAMIC_PULL)
        return {
            D.MU_PULL: mu,
            D.MU_RELEASE: w.value(Parameter.MU_DYNAMIC_RELEASE),
            D.STATIC_EXCESS: w.value(Parameter.MU_STATIC_PULL) / mu - 1 if mu > 0 else 0.0,
            D.INPUT_BIAS: 0.0,
            D.OUTPUT_BIAS: 0.0,
            **{k: w.value(name) for k, name in _DIRECT.items()},
        }

    def whole(self, values: Mapping[DynamicParameter, float]) -> Whole:
        """The undivided tendon with given values, all of them."""
        mu_pull = values[D.MU_PULL]
        mu_release = mu_pull if self.symmetric else values[D.MU_RELEASE]
        excess = 1 + values[D.STATIC_EXCESS]
        mus = zip(_MUS, (mu_pull, excess * mu_pull, mu_release, excess * mu_release), strict=True)
        direct = {name.value: values[k] for k, name in _DIRECT.items()}
        return whole_of(self.transmission, self.level).changed({name.value: mu for name, mu in mus} | direct)

    def chain(self, whole: Whole, motion: JointMotion | None = None) -> Chain:
        """The chain with a massless near end."""
        chain = Chain.of(replace(self.transmission, motion=motion), self.level, self.count)
        near = End(mass_kg=NEAR_MASS_KG, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0)
        return replace(chain, elements=whole.divided(self.count, motion), near=near)

    def respond(
        self, values: Mapping[DynamicParameter, float], drive: Drive, over: Sequence[DynamicParameter] = ()
    ) -> ChainResponse:
        """Simulate a drive with all values, with derivatives over the parameters asked for; SolveError if that
        fails.
        """
        whole, run_up = self.whole(values), self.with_lead_in(values, drive)
        chain = self.chain(whole, run_up.motion)
        if over and chain.moving:
            return self._differences(values, drive, over)
        if over:
            output, near, far, slopes = self._differentiate(values, whole, chain, run_up, over)
        else:
            run = simulate(chain, run_up.force_N, run_up.step_s, initial_tension_N=run_up.rest_N).require()
            output, near, far = run.output_tension_N, run.near_position_m, run.far_position_m
            slopes = np.zeros((len(run_up.force_N), 3, 0))
        rows = len(drive.input_N)
        return ChainResponse(
            output_N=run_up.sampled(output, rows) + values[D.OUTPUT_BIAS],
            elongation_m=run_up.sampled(near - far, rows),
            near_m=run_up.sampled(near, rows),
            output_slopes=run_up.sampled(slopes[:, 0], rows),
            elongation_slopes=run_up.sampled(slopes[:, 1], rows),
            near_slopes=run_up.sampled(slopes[:, 2], rows),
        )

    def _differences(
        self, values: Mapping[DynamicParameter, float], drive: Drive, over: Sequence[DynamicParameter]
    ) -> ChainResponse:
        """Derivatives by differences: compiled runs of a chain whose masses differ cost less than its exact slopes."""
        middle = self.respond(values, drive)
        channels = ("output_N", "elongation_m", "near_m")
        slopes = np.zeros((len(channels), len(drive.input_N), len(over)))
        for k, name in enumerate(over):
            step = _DIFFERENCE * (abs(values[name]) or 1.0)
            above = self.respond({**values, name: values[name] + step}, drive)
            # what is zero may not fall below it
            below = self.respond({**values, name: values[name] - step}, drive) if values[name] else middle
            width = (2 if values[name] else 1) * step
            for channel, found in zip(channels, slopes, strict=True):
                found[:, k] = (getattr(above, channel) - getattr(below, channel)) / width
        return replace(middle, output_slopes=slopes[0], elongation_slopes=slopes[1], near_slopes=slopes[2])

    def with_lead_in(self, values: Mapping[DynamicParameter, float], drive: Drive) -> RunUp:
        """What a drive is simulated as."""
        thin = max(1, int(self.longest_step_s / drive.step_s + 1e-6))
        refine = max(1, int(np.ceil(drive.step_s / self.longest_step_s - 1e-6)))
        samples = drive.input_N - values[D.INPUT_BIAS]
        rows = np.arange(len(samples))
        if refine > 1:
            samples = CubicSpline(rows, samples)(np.arange((len(rows) - 1) * refine + 1) / refine)
        elif thin > 1:
            last = int(np.ceil((len(rows) - 1) / thin)) * thin
            samples = np.concatenate([samples, np.full(last - len(rows) + 1, samples[-1])])[::thin]
        step = drive.step_s * thin / refine
        rest = max(drive.first_output_N - values[D.OUTPUT_BIAS], LEAST_TENSION_N)
        lead = max(8, int(LEAD_IN_S / step))
        ramp = np.clip(np.arange(lead) / (lead / 2), 0, 1)
        smooth = ramp * ramp * (3 - 2 * ramp)
        force = np.concatenate([rest + (samples[0] - rest) * smooth, samples])
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
        self,
        values: Mapping[DynamicParameter, float],
        whole: Whole,
        chain: Chain,
        run_up: RunUp,
        over: Sequence[DynamicParameter],
    ) -> tuple[Array, Array, Array, Array]:
        """Output, positions of both ends, and slopes of output, elongation and near position, shape (rows, 3, k)."""
        wanted = [p for k, p in _DIRECT.items() if k in over]
        if {D.MU_PULL, D.MU_RELEASE, D.STATIC_EXCESS} & set(over):
            wanted += _MUS
        force, step, rest = run_up.force_N, run_up.step_s, run_up.rest_N
        slopes = np.zeros((len(force), 3, len(over)))
        run = parameter_sensitivity(whole, chain, force, step, tuple(wanted), initial_tension_N=rest)
        if run.ends_slopes is None:
            raise SolveError("the sensitivities of the ends' positions are missing")
        near, far = run.ends_slopes[:, 0], run.ends_slopes[:, 1]
        both = np.stack([run.tension_slopes[:, 0], near - far, near], axis=1)
        column = {p: both[:, :, i] for i, p in enumerate(wanted)}
        excess = 1 + values[D.STATIC_EXCESS]
        for k, name in enumerate(over):
            if name in _DIRECT:
                slopes[:, :, k] = column[_DIRECT[name]]
            elif name is D.OUTPUT_BIAS:
                slopes[:, 0, k] = 1.0
            elif name is D.INPUT_BIAS:
                knots = np.array([0, len(force) - 1])
                shift = force_sensitivity(chain, force, step, knots, state=chain.rest_state(rest))
                slopes[:, 0, k] = -shift.tension_slopes[:, 0].sum(axis=1)
            else:
                pull = column[Parameter.MU_DYNAMIC_PULL] + excess * column[Parameter.MU_STATIC_PULL]
                release = column[Parameter.MU_DYNAMIC_RELEASE] + excess * column[Parameter.MU_STATIC_RELEASE]
                if name is D.MU_PULL:
                    slopes[:, :, k] = pull + release if self.symmetric else pull
                elif name is D.MU_RELEASE:
                    slopes[:, :, k] = 0.0 if self.symmetric else release
                else:
                    slopes[:, :, k] = (
                        whole.value(Parameter.MU_DYNAMIC_PULL) * column[Parameter.MU_STATIC_PULL]
                        + whole.value(Parameter.MU_DYNAMIC_RELEASE) * column[Parameter.MU_STATIC_RELEASE]
                    )
        return run.tension_N[:, -1], run.ends_m[:, 0], run.ends_m[:, 1], slopes


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
    values: Mapping[DynamicParameter, float],
    drive: Drive,
    *,
    knot_s: float,
    window_s: float,
    before_s: float,
) -> Iterator[InputWindow]:
    """Windows of a drive of about `window_s`, with knots from about `before_s` earlier on; SolveError if the run
    fails.
    """
    run_up = model.with_lead_in(values, drive)
    chain = model.chain(model.whole(values), run_up.motion)
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
