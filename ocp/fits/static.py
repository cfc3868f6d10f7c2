"""Static laws driven by measured histories, with exact sensitivities for least squares.

Two questions about the same friction on the path::

    output from input    T_out is the play of T_in: one driven end, the load moves only with the tendon. Spread
                         bounds: the mean of several plays (generalised Prandtl-Ishlinskii operator).
    input from output    T_in is T_out plus the friction of a bristle that the measured motion of the near end strains:
                         the output tension may be imposed by anything. One element carries the whole wrap angle, so
                         that in gross sliding T_in + p = (T_out + p) e^{+-mu theta} holds exactly, eqs. (4), (8), (9).

Both are recursions over the samples. State and output of one sample are CasADi expressions built from the laws of
`models`; their derivatives over the parameters are carried along by the chain rule (forward mode).
"""

import functools
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import ReprEnum

import casadi as ca
import numpy as np

from tendonff.models.capstan.spread_bounds import PLACES, PLAYS, sliding_exponent
from tendonff.models.tendon.bounds import play
from tendonff.models.tendon.friction import LuGreBristle, equivalent_coefficient
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.codegen.prototype import CFunction
from tendonff.ocp.fits.entries import Entry
from tendonff.ocp.step.protocol import Array

LIFTED_FLOOR_N = 1e-9
"""Least T + p in the play law [N]: below it the tendon is slack and the law has no meaning."""

STIFF_N_PER_M = 1e12
"""Bristle without presliding."""

MOST_EXPONENT, LEAST_SPREAD = 8.0, 1e-3
"""Largest mu theta that is searched (a tension ratio of 3000); least spread (below it the slopes over it vanish)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Sizes of a fit's data, from which its bounds follow.

    Parameters
    ----------
    span_N, far_span_N : float
        Range of the explained channel, and of the output's tension where that is larger.
    least_N : float
        Least adhesion by which all output tensions are lifted above zero.
    travel_m : float
        Largest travel of the near end; 1 where it was not measured.
    """

    span_N: float
    far_span_N: float
    least_N: float
    travel_m: float


Pair = tuple[ca.SX, ca.SX]
Bounds = tuple[float, float, float, float]
"""Start, least and largest value, usual step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticTerm:
    """Everything that is particular to one value of the static laws.

    Parameters
    ----------
    bounds : callable
        Start, bounds and step of its search, by the sizes of the data and the value of a simpler law.
    logarithmic : bool
        It is searched by its logarithm.
    neutral : float
        Its value in a law without it.
    effect : str
        What a law gains with it, for names of laws; empty where it goes with another.
    goes_with : str
        Name of the value that it is free with; empty for none.
    beyond : tuple of str
        Names of values that a law must have to be tried with it.
    explains : str
        The one channel, "output" or "input", whose laws are tried with it; empty for both.
    signed : bool
        It may have either sign, hence its error is not judged by its size.
    key : str
        Its place in the scenario, "friction.key" or "measurement.key"; empty where it has none, or more than one.
    beside_keys : tuple of (str, float)
        Further such places that must be given with it, and what they state.
    near_N : callable, optional
        What the near end's cell reads beside the tendon, by the value and the motion of that end [m].
    exponents : callable, optional
        Mu theta pulling and releasing, by the value, the tension at the known end plus p, and those without it.
    """

    bounds: Callable[[Sizes, float | None], Bounds]
    logarithmic: bool = False
    neutral: float = 0.0
    effect: str = ""
    goes_with: str = ""
    beyond: tuple[str, ...] = ()
    explains: str = ""
    signed: bool = False
    key: str = ""
    beside_keys: tuple[tuple[str, float], ...] = ()
    near_N: Callable[[ca.SX, ca.SX], ca.SX] | None = None
    exponents: Callable[[ca.SX, ca.SX, Pair], Pair] | None = None


def _of_exponent(_: Sizes, known: float | None) -> Bounds:
    return 0.5 if known is None else known, 0.0, MOST_EXPONENT, 0.2


def _of_bias(sizes: Sizes, known: float | None) -> Bounds:
    return known or 0.0, -sizes.span_N, sizes.span_N, 0.05 * sizes.span_N


def _of_adhesion(sizes: Sizes, known: float | None) -> Bounds:
    start = max(known or 0.0, sizes.least_N + 0.05 * sizes.far_span_N)
    return start, sizes.least_N, 20 * sizes.far_span_N, 0.1 * sizes.far_span_N


def _of_guide(sizes: Sizes, known: float | None) -> Bounds:
    unit = sizes.span_N / sizes.travel_m
    return known or 0.0, -10 * unit, 10 * unit, 0.1 * unit


def _of_bristle(sizes: Sizes, known: float | None) -> Bounds:
    unit = sizes.span_N / sizes.travel_m
    return 20 * unit if known is None or known >= STIFF_N_PER_M else known, unit, 1e5 * unit, 1.0


def _of_spread(_: Sizes, __: float | None) -> Bounds:
    return LEAST_SPREAD + 0.3, LEAST_SPREAD, 1.0, 0.2


class StaticParameter(Entry[StaticTerm], ReprEnum):
    """The values of the static laws: a law with one more effect is one more entry here, and nothing else.

    The laws that are tried, their names, bounds, expressions and places in the fitted scenario follow from it.
    """

    # PULL, RELEASE: mu theta in either direction [-]
    PULL = "pull_exponent", StaticTerm(bounds=_of_exponent)
    RELEASE = "release_exponent", StaticTerm(bounds=_of_exponent)
    # p, added to the tension in the friction law [N]; also the pre-tension of a closed loop
    ADHESION = "adhesion_N", StaticTerm(bounds=_of_adhesion, effect="load-independent friction")
    # INPUT_BIAS, OUTPUT_BIAS: what the cells read at zero tension [N]
    INPUT_BIAS = (
        "input_offset_N",
        StaticTerm(bounds=_of_bias, signed=True, goes_with="adhesion_N", near_N=lambda value, _: value),
    )
    OUTPUT_BIAS = "output_offset_N", StaticTerm(bounds=lambda sizes, _: _of_bias(sizes, None), signed=True)
    # sigma0 of the whole path [N/m]; only in the law that uses the motion
    BRISTLE = (
        "bristle_stiffness_N_per_m",
        StaticTerm(bounds=_of_bristle, logarithmic=True, neutral=STIFF_N_PER_M, effect="presliding", explains="input"),
    )
    # stiffness of whatever pulls on the near end beside the tendon [N/m]
    GUIDE = (
        "guide_stiffness_N_per_m",
        StaticTerm(
            bounds=_of_guide,
            effect="guide spring",
            beyond=("bristle_stiffness_N_per_m", "adhesion_N"),
            explains="input",
            signed=True,
            key="measurement.guide_stiffness_N_per_m",
            near_N=lambda value, motion: value * motion,
        ),
    )
    # s: one half of the friction has a bristle e^s times as stiff, the other one e^s times as soft [-], >= 0
    BRISTLE_SPREAD = (
        "bristle_spread",
        StaticTerm(
            bounds=lambda _, __: (1.0, 0.0, 6.0, 0.5),
            effect="two bristles",
            beyond=("bristle_stiffness_N_per_m", "adhesion_N"),
            explains="input",
            key="measurement.bristle_spread",
        ),
    )
    # PULL_SPREAD, RELEASE_SPREAD: bounds of the plays reach over (1 -+ spread) mu theta, evenly [-], 0 to 1
    PULL_SPREAD = (
        "pull_spread",
        StaticTerm(
            bounds=_of_spread,
            effect="spread bounds",
            beyond=("release_exponent",),
            explains="output",
            key="friction.pull_spread",
        ),
    )
    RELEASE_SPREAD = (
        "release_spread",
        StaticTerm(bounds=_of_spread, goes_with="pull_spread", key="friction.release_spread"),
    )


P = StaticParameter
ORDER = tuple(StaticParameter)

SPREADS = (P.BRISTLE_SPREAD, P.PULL_SPREAD, P.RELEASE_SPREAD)
CHUNK = 2048
"""Rows that one call of a law steps through."""

NEUTRAL: Mapping[StaticParameter, float] = {parameter: parameter.spec.neutral for parameter in ORDER}


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """Prediction of one channel and its derivatives."""

    prediction_N: Array  # shape (n,)
    slopes: Array  # shape (n, len(StaticParameter)); over the parameters in the order of `StaticParameter`


def output_from_input(values: Mapping[StaticParameter, float], input_N: Array, first_output_N: float) -> Response:
    """T_out by the play law from the history of T_in, shape (n,).

    The memory starts at the output that was measured at the first sample, within its bounds.
    """
    signals = np.stack([input_N, np.full_like(input_N, first_output_N)])
    spread = any(values.get(k, NEUTRAL[k]) for k in SPREADS[1:])
    return _run(_play_step(PLAYS if spread else 1), values, signals)


def input_from_output(
    values: Mapping[StaticParameter, float], output_N: Array, input_m: Array, first_input_N: float
) -> Response:
    """T_in from T_out and the motion of the near end, shapes (n,); positive is towards the actuator.

    The guide's force is zero at 0; the bristle starts at the input that was measured at the first sample.
    """
    before = np.concatenate([input_m[:1], input_m[:-1]])
    signals = np.stack([output_N, input_m, before, np.full_like(output_N, first_input_N)])
    return _run(_bristle_step(), values, signals)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Step:
    """Functions of one law: start (parameters, signals) and step (state and slopes, signals, parameters)."""

    start: ca.Function
    step: ca.Function


def _with_slopes(state: ca.SX, signals: ca.SX, parameters: ca.SX, start: ca.SX, after: ca.SX, output: ca.SX) -> _Step:
    """Carry the derivatives of the states along with them; `output` is that of the step from `state` to `after`."""
    states, count = state.numel(), parameters.numel()
    slopes = ca.SX.sym("slopes", states, count)
    after_slopes = ca.jacobian(after, state) @ slopes + ca.jacobian(after, parameters)
    output_slopes = ca.jacobian(output, state) @ slopes + ca.jacobian(output, parameters)
    whole = ca.vertcat(state, ca.vec(slopes))
    return _Step(
        start=ca.Function(
            "tff_law_start",
            [signals, parameters],
            [ca.densify(ca.vertcat(start, ca.vec(ca.jacobian(start, parameters))))],
        ),
        step=ca.Function(
            "tff_law_step",  # "step" is one of the C library's own
            [whole, signals, parameters],
            [ca.densify(ca.vertcat(after, ca.vec(after_slopes))), ca.densify(ca.vertcat(output, output_slopes.T))],
            {"cse": True},
        ),
    )


def in_gross_sliding(values: Mapping[StaticParameter, float]) -> tuple[float, float]:
    """Mu theta at which all plays slip, pulling and releasing; the law's own exponents where there is one play."""
    return (
        -sliding_exponent(-values[P.PULL], values[P.PULL_SPREAD]),
        sliding_exponent(values[P.RELEASE], values[P.RELEASE_SPREAD]),
    )


def _beside_N(at: Mapping[StaticParameter, ca.SX], motion: ca.SX) -> ca.SX:
    """Reading of the near end's cell beside the tendon's tension."""
    forces = (each.spec.near_N(at[each], motion) for each in ORDER if each.spec.near_N is not None)
    return functools.reduce(operator.add, forces)


def _exponents(at: Mapping[StaticParameter, ca.SX], lifted_N: ca.SX) -> Pair:
    """Mu theta pulling and releasing at a tension of the known end."""
    pair = at[P.PULL], at[P.RELEASE]
    for each in ORDER:
        if each.spec.exponents is not None:
            pair = each.spec.exponents(at[each], lifted_N, pair)
    return pair


@functools.cache
def _play_step(count: int) -> _Step:
    w, signals, places = ca.SX.sym("w", count), ca.SX.sym("signals", 2), ca.DM(PLACES if count == PLAYS else 0.0)
    parameters = ca.SX.sym("parameters", len(ORDER))
    at = dict(zip(ORDER, ca.vertsplit(parameters), strict=True))
    p, bias_out = at[P.ADHESION], at[P.OUTPUT_BIAS]
    lifted = ca.fmax(signals[0] - _beside_N(at, ca.SX(0)) + p, LIFTED_FLOOR_N)
    pull, release = _exponents(at, lifted)
    low = lifted * ca.exp(-pull * (1 + at[P.PULL_SPREAD] * places))
    high = lifted * ca.exp(release * (1 + at[P.RELEASE_SPREAD] * places))
    after = play(w, low, high)
    # The memory is T_out + p; the samples of the output enter only through the first of them.
    start = ca.repmat(signals[1] - bias_out + p, count, 1)
    return _with_slopes(w, signals, parameters, start, after, ca.sum1(after) / count - p + bias_out)


@functools.cache
def _bristle_step() -> _Step:
    f_s, signals = ca.SX.sym("f_s", 2), ca.SX.sym("signals", 4)
    parameters = ca.SX.sym("parameters", len(ORDER))
    at = dict(zip(ORDER, ca.vertsplit(parameters), strict=True))
    out, q, q_before, first = ca.vertsplit(signals)
    far = out - at[P.OUTPUT_BIAS]
    # Two strands side by side, each with half of the tension. Without speed dependence the law knows no time: with a
    # unit step the velocity is the travel of the sample.
    half_sum = ca.fmax(far + at[P.ADHESION], LIFTED_FLOOR_N)
    pull, release = (equivalent_coefficient(exponent, 1.0) for exponent in _exponents(at, half_sum))
    strands: list[ca.SX] = []
    for force, sign in zip(ca.vertsplit(f_s), (1, -1), strict=True):
        bristle = LuGreBristle(
            bristle_stiffness_N_per_m=at[P.BRISTLE] / 2 * ca.exp(sign * at[P.BRISTLE_SPREAD]),
            mu_dynamic_pull=pull,
            mu_static_pull=pull,
            mu_dynamic_release=release,
            mu_static_release=release,
            stribeck_velocity_m_per_s=1.0,
            viscous_N_s_per_m=0.0,
        )
        strands += bristle.implicit_from_far_side(q - q_before, (force,), ca.SX(1), half_sum)
    after = ca.vertcat(*strands)
    beside = _beside_N(at, q)
    start = ca.repmat((first - beside - far) / 2, 2, 1)
    return _with_slopes(f_s, signals, parameters, start, after, far + ca.sum1(after) + beside)


_LOOP = """
int tff_law_rows(long rows, const double *signals, const double *parameters, double *found)
{{
    double state[{states}], before[{states}], w[{reals} + 1];
    const double *arg[{arguments}];
    double *res[{results}];
    casadi_int iw[{whole_numbers} + 1];
    long k;
    int i;
    arg[0] = signals;
    arg[1] = parameters;
    res[0] = state;
    if (tff_law_start(arg, res, iw, w, 0) != 0)
        return 1;
    for (k = 0; k < rows; ++k) {{
        for (i = 0; i < {states}; ++i)
            before[i] = state[i];
        arg[0] = before;
        arg[1] = signals + k * {signals};
        arg[2] = parameters;
        res[0] = state;
        res[1] = found + k * {found};
        if (tff_law_step(arg, res, iw, w, 0) != 0)
            return 1;
    }}
    return 0;
}}
"""


@functools.lru_cache(maxsize=8)
def _accumulated(law: _Step) -> ca.Function:
    return law.step.mapaccum("rows", CHUNK)


@functools.lru_cache(maxsize=8)
def _compiled(law: _Step) -> CFunction:
    step, code, both = law.step, ca.CodeGenerator("law"), (law.start, law.step)
    for function in both:
        code.add(function)
    source = code.dump() + _LOOP.format(
        states=step.numel_in(0),
        signals=step.numel_in(1),
        found=step.numel_out(1),
        arguments=max(function.sz_arg() for function in both),
        results=max(function.sz_res() for function in both),
        whole_numbers=max(function.sz_iw() for function in both),
        reals=max(function.sz_w() for function in both),
    )
    return CFunction(load_library(source), source, "tff_law_rows")


def _run(law: _Step, values: Mapping[StaticParameter, float], signals: Array) -> Response:
    """Step through all rows."""
    numbers = np.array([values.get(k, NEUTRAL[k]) for k in ORDER])
    if resolve_engine(Engine.AUTO) is Engine.CASADI:
        rows = _accumulated_rows(law, numbers, signals)
    else:
        rows = np.empty((signals.shape[1], 1 + len(numbers)))
        columns = np.ascontiguousarray(signals.T, dtype=float)
        _compiled(law)(rows=len(rows), signals=columns, parameters=numbers, found=rows)
    return Response(prediction_N=rows[:, 0].copy(), slopes=rows[:, 1:].copy())


def _accumulated_rows(law: _Step, numbers: Array, signals: Array) -> Array:
    """The same without a compiler, a chunk at a time: a function of one length is made once."""
    run, state, count = _accumulated(law), law.start(signals[:, 0], numbers), signals.shape[1]
    # The last row is repeated to fill the last chunk, and its answers are dropped.
    whole = np.concatenate([signals, np.repeat(signals[:, -1:], -count % CHUNK, axis=1)], axis=1)
    given, parts = ca.repmat(ca.DM(numbers), 1, CHUNK), []
    for first in range(0, whole.shape[1], CHUNK):
        states, found = run(state, whole[:, first : first + CHUNK], given)
        state = states[:, -1]
        parts.append(np.asarray(found).T)
    rows: Array = np.concatenate(parts)[:count]
    return rows
