"""Self-tuning of a loop's joint: its inverse at three values of a factor, what is commanded between them, and the
recursion that finds the factor from the joint's angle.

Sliding in full, a motor angle m turns the joint by rho times what the inverse at the true factor would not have asked
for: q - q_ref = rho (m - m(f)). So the joint's angle is predicted without a model that runs forwards, and the slope of
the prediction is that of the inverse. All that this identifies is the lost motion (T/k) tanh(a/2): one number. A second
signal hardly helps: the force of the drive changes with mu and T almost as the lost motion does (their ratio by
1 - a/sinh a of a relative change of a, 6 % at a = 0.6).
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca

from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.recursion import covariance_names, update_law
from tendonff.ocp.adaptation.tuning import (
    CORRELATION_S,
    DOUBTED,
    DRIFT_PER_S,
    FULL_SPEED_PER_S,
    GATE,
    LONG_S,
    MAX_DELAY,
    PEAK,
    QUICK_S,
    SLEW_PER_S,
    SLOW_S,
    SPREADS,
    START_DEVIATION,
    Nuisance,
)
from tendonff.ocp.codegen.printer import Law

MODEL_ERROR = 0.15
"""Residual of a good model, in half lost motions."""

WATCH = 3.0
"""Unexplained residual from which on the model counts as wrong, in half lost motions."""

STILL, STUCK = 0.5, 2.0
"""Ways of the reference, in half lost motions, over which a measurement may stay the same: then it teaches nothing,
then it counts as stuck."""

THAWED = 0.5
"""Share of the watch's level below which the data are explained again."""

_STATE = ("f", "b", *covariance_names(2), "error", "lasting", "slow", "level", "worst")
_STATE += ("safe", "held", "held_travel", "stale", "last", "frozen", "used")


class JointTunable(StrEnum):
    """Tuned parameters of a joint; two of them carry the same factor."""

    MU = "mu"  # all friction coefficients
    PRETENSION = "pretension"  # tension after tensioning


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTuning:
    """Numbers of the recursion, per sample of the controller.

    Attributes
    ----------
    low, high : float
        Bounds of the factor; the inverse runs at both and at 1 [-].
    ratio : float
        Turn of the joint per radian of the motor, in full sliding [-].
    span : float
        Range of the reference [rad].
    deviation : float
        What noise and a good model leave [rad].
    variance : float
        That one sample at full speed counts for [rad^2].
    full_speed : float
        Change of the reference per sample from which on a sample counts in full [rad].
    watch_level : float
        Mean square of what is unexplained at which the model counts as wrong, in squares of `deviation` [-].
    still, stuck : float
        Ways of the reference over which a measurement may stay the same [rad].
    drift, slew, quick, slow, long_share : float
        Random walk and largest change of the factor; shares by which means follow [-].
    delay_samples : int
        Age of a measurement when it arrives, 0 to 63.
    """

    low: float
    high: float
    ratio: float
    span: float
    deviation: float
    variance: float
    full_speed: float
    watch_level: float
    still: float
    stuck: float
    drift: float
    slew: float
    quick: float
    slow: float
    long_share: float
    delay_samples: int

    @classmethod
    def of(
        cls,
        *,
        low: float,
        high: float,
        ratio: float,
        span_rad: float,
        lost_motion_rad: float,
        noise_rad: float,
        delay_samples: int,
        step_s: float,
    ) -> "JointTuning":
        """Numbers from what is known about the sensor, the reference and the loop.

        Half the lost motion is `lost_motion_rad`, the noise a standard deviation.
        """
        if not lost_motion_rad > 0:
            raise ParameterError(
                f"the loop must have lost motion to tune, got {lost_motion_rad:g} rad; without friction or pre-tension "
                "leave [adaptation] out"
            )
        if not 0 <= delay_samples < MAX_DELAY:
            raise ParameterError(f"delay_samples must be a whole number from 0 to {MAX_DELAY - 1}, got {delay_samples}")
        deviation = math.hypot(noise_rad, MODEL_ERROR * lost_motion_rad)
        return cls(
            low=low,
            high=high,
            ratio=ratio,
            span=span_rad,
            deviation=deviation,
            variance=deviation**2 * max(CORRELATION_S / step_s, 1.0),
            full_speed=FULL_SPEED_PER_S * span_rad * step_s,
            watch_level=((WATCH * lost_motion_rad + 4 * noise_rad) / deviation) ** 2,
            still=STILL * lost_motion_rad + 4 * noise_rad,
            stuck=STUCK * lost_motion_rad + 16 * noise_rad,
            drift=DRIFT_PER_S * step_s,
            slew=SLEW_PER_S * step_s,
            quick=min(step_s / QUICK_S, 1.0),
            slow=min(step_s / SLOW_S, 1.0),
            long_share=min(step_s / LONG_S, 1.0),
            delay_samples=delay_samples,
        )

    def start(self) -> dict[str, float]:
        """State of the recursion before anything is learnt, by name."""
        spread = SPREADS[Nuisance.OFFSET]
        known = {"f": 1.0, "P00": START_DEVIATION**2, "P11": spread**2, "slow": 1.0, "level": 1.0}
        known |= dict.fromkeys(("safe", "held", "used"), 1.0)
        return {name: known.get(name, 0.0) for name in _STATE}


def _between(low: ca.SX, high: ca.SX, values: list[ca.SX], f: ca.SX) -> ca.SX:
    """Parabola through values at `low`, 1 and `high`."""
    first = (f - 1) * (f - high) / ((low - 1) * (low - high))
    second = (f - low) * (f - high) / ((1 - low) * (1 - high))
    third = (f - low) * (f - 1) / ((high - low) * (high - 1))
    return first * values[0] + second * values[1] + third * values[2]


def _symbols(*names: str) -> list[ca.SX]:
    return [ca.SX.sym(name) for name in names]


def between_law() -> Law:
    """Value at a factor, from those at its bounds and at 1."""
    f, low, high, *values = _symbols("f", "low", "high", "v0", "v1", "v2")
    return Law(
        name="tuned_between",
        comment="Parabola through values at the bounds of the factor and at 1.",
        inputs=(f, low, high, *values),
        outputs={"value": _between(low, high, values, f)},
    )


def tuning_law() -> Law:
    """State of the recursion after one measurement, and the factor that the command uses.

    `angle` is the reference at the instant of the measurement, `moved` its change in that sample, `samples` the time of
    that sample over the usual one, `commanded` the motor's angle then, and v0, v1, v2 those at the factor's bounds and
    at 1; `taught` is 0 where nothing can be learnt from this sample.
    """
    state = dict(zip(_STATE, _symbols(*_STATE), strict=True))
    sample = _symbols("measured", "angle", "moved", "samples", "taught", "commanded", "v0", "v1", "v2")
    measured, angle, moved, samples, taught, commanded, *values = sample
    names = ("low", "high", "ratio", "span", "deviation", "variance", "full_speed", "watch_level", "still", "stuck")
    numbers = _symbols(*names, "drift", "slew", "quick", "slow_share", "long_share")
    low, high, ratio, span, deviation, variance, full, watch, still, stuck, drift, slew, quick, slow, long = numbers
    f, b, frozen = state["f"], state["b"], state["frozen"]

    found = _between(low, high, values, f)
    slope = -ratio * ca.jacobian(found, f)
    stale = ca.if_else(ca.eq(measured, state["last"]), state["stale"] + moved, 0)
    share = moved / (full * samples)
    weight = ca.if_else(share > GATE, ca.fmin(share, 1), 0) * ca.fmin(samples, 1 / quick)
    weight = taught * ca.if_else(stale > still, 0, weight)
    e = measured - angle - ratio * (commanded - found) - b * span
    update = update_law(1, (SPREADS[Nuisance.OFFSET],))
    known = {
        "e": e,
        "weight": weight,
        "s0": slope,
        "s1": span,
        "f0": f,
        "b0": b,
        "mean": state["error"],
        **{name: state[name] for name in covariance_names(2)},
        "quick": quick,
        "lasting": state["lasting"],
        "long_share": ca.fmin(long * samples, 1),
        "level": state["level"],
        "R": variance,
        "deviation": deviation,
        "drift": drift,
        "start": ca.SX(START_DEVIATION),
        "slew": slew * samples,
        "low": low,
        "high": high,
    }
    after = dict(zip(update.outputs, update.function()(*(known[s.name()] for s in update.inputs)), strict=True))

    mean_slow = state["slow"] + (after["surprise"] - state["slow"]) * ca.fmin(weight * slow, 1)
    level = ca.fmax(ca.fmax(mean_slow, after["surprise"] / PEAK), ca.fmax(after["remains"], 1))
    level = ca.if_else(taught > 0, level, state["level"])
    wrong = ca.if_else(frozen > 0, THAWED * watch, watch)
    freezes = ca.logic_or(level > wrong, stale > stuck)
    worst = ca.fmax(state["worst"], level)
    travel = state["held_travel"] + ca.if_else(weight > 0, moved, 0)
    whole = travel >= span
    safe = ca.if_else(ca.logic_and(whole, worst < THAWED * watch), state["held"], state["safe"])
    learnt = ca.if_else(freezes, safe, after["f0_new"])
    target = learnt - state["used"]
    step = slew * ca.fmax(samples, 1)
    outputs = {
        "f": learnt,
        "b": ca.if_else(freezes, b, after["b0_new"]),
        **{name: ca.if_else(freezes, state[name], after[f"{name}_new"]) for name in covariance_names(2)},
        "error": ca.if_else(taught > 0, after["mean_new"], state["error"]),
        "lasting": ca.if_else(taught > 0, after["lasting_new"], state["lasting"]),
        "slow": ca.if_else(taught > 0, mean_slow, state["slow"]),
        "level": level,
        "worst": ca.if_else(whole, level, worst),
        "safe": safe,
        "held": ca.if_else(whole, f, state["held"]),
        "held_travel": ca.if_else(whole, 0, travel),
        "stale": stale,
        "last": measured,
        "frozen": ca.if_else(freezes, 1, 0),
        "used": state["used"] + ca.fmax(ca.fmin(target, step), -step),
    }
    flags = {
        "bound": ca.if_else(ca.logic_or(learnt <= low, learnt >= high), 1, 0),
        "doubt": ca.if_else(level > DOUBTED, 1, 0),
    }
    return Law(
        name="joint_tuning",
        comment="The recursion after one measurement of the joint's angle.",
        inputs=(*sample, *state.values(), *numbers),
        outputs={f"{name}_new": value for name, value in outputs.items()} | flags,
    )
