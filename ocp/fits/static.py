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
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np

from tendonff.models.capstan.spread_bounds import PLACES, PLAYS, sliding_exponent
from tendonff.models.tendon.bounds import play
from tendonff.models.tendon.friction import LuGreBristle, equivalent_coefficient
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.codegen.prototype import CFunction
from tendonff.ocp.step.protocol import Array

LIFTED_FLOOR_N = 1e-9
"""Least T + p in the play law [N]: below it the tendon is slack and the law has no meaning."""

STIFF_N_PER_M = 1e12
"""Bristle without presliding."""


class StaticParameter(StrEnum):
    """Parameters of the static laws."""

    # PULL, RELEASE: mu theta in either direction [-]
    PULL = "pull_exponent"
    RELEASE = "release_exponent"
    ADHESION = "adhesion_N"  # p, added to the tension in the friction law [N]; also the pre-tension of a closed loop
    # INPUT_BIAS, OUTPUT_BIAS: what the cells read at zero tension [N]
    INPUT_BIAS = "input_offset_N"
    OUTPUT_BIAS = "output_offset_N"
    GUIDE = "guide_stiffness_N_per_m"  # stiffness of whatever pulls on the near end beside the tendon [N/m]
    BRISTLE = "bristle_stiffness_N_per_m"  # sigma0 of the whole path [N/m]; only in the law that uses the motion
    # s: one half of the friction has a bristle e^s times as stiff, the other one e^s times as soft [-], >= 0
    BRISTLE_SPREAD = "bristle_spread"
    # PULL_SPREAD, RELEASE_SPREAD: bounds of the plays reach over (1 -+ spread) mu theta, evenly [-], 0 to 1
    PULL_SPREAD = "pull_spread"
    RELEASE_SPREAD = "release_spread"


P = StaticParameter
ORDER = tuple(StaticParameter)

SPREADS = (P.BRISTLE_SPREAD, P.PULL_SPREAD, P.RELEASE_SPREAD)
CHUNK = 2048
"""Rows that one call of a law steps through."""

NEUTRAL: Mapping[StaticParameter, float] = {
    **dict.fromkeys(StaticParameter, 0.0),
    StaticParameter.BRISTLE: STIFF_N_PER_M,
}


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


@functools.cache
def _play_step(count: int) -> _Step:
    w, signals, places = ca.SX.sym("w", count), ca.SX.sym("signals", 2), ca.DM(PLACES if count == PLAYS else 0.0)
    parameters = ca.SX.sym("parameters", len(ORDER))
    at = dict(zip(ORDER, ca.vertsplit(parameters), strict=True))
    p, bias_in, bias_out = (at[k] for k in (P.ADHESION, P.INPUT_BIAS, P.OUTPUT_BIAS))
    lifted = ca.fmax(signals[0] - bias_in + p, LIFTED_FLOOR_N)
    low = lifted * ca.exp(-at[P.PULL] * (1 + at[P.PULL_SPREAD] * places))
    high = lifted * ca.exp(at[P.RELEASE] * (1 + at[P.RELEASE_SPREAD] * places))
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
    pull, release = (equivalent_coefficient(at[k], 1.0) for k in (P.PULL, P.RELEASE))
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
    beside = at[P.INPUT_BIAS] + at[P.GUIDE] * q
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
