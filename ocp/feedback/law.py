r"""Law of the feedback: PI action, and errors that are learned, against the reference as old as the measurement.

::

    reference --[ delay_s ]--> (+) --[ deadband ]--[ 1/(filter_s s + 1) ]--> e
    measured, delay_s old ----> (-)
    correction = Kp e + Ki int e + (alpha s + beta + gamma x) / g, within +-clamp

The correction is added to the command that the feedforward computes. s is the shape that friction gives to the error of
a feedforward: reference less its play, over the half width of the play, -1 to 1; or what comes with each sample: how
much more command the feedforward would give with more friction. What was learned while pulling is thus inverted,
without delay, where the reference turns.

What a feedforward leaves is known in shape: friction's s; a constant; x, the reference about its middle, -1 to 1, for
loads, stiffness and tension; and the rate of the reference, for an age of the measurement that differs from delay_s.
The measurement is compared with what these, and the own corrections as old as itself, explain,

    d = e + g u = alpha s + beta + gamma x + Delta dr/dt,

by recursive least squares along strokes, where s is constant. d is free of the own corrections, so that no delay bounds
how fast it is learned. Delta dr/dt is taken off the error, up to delay_s either way, but for what loads and stiffness
may give a joint (rate_error_s); that and the rest are corrected before they are measured. What remains is for Kp and
Ki, which margins are for.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError, require
from tendonff.models.tendon.bounds import at_least
from tendonff.ocp.codegen.printer import Law

MOST_SAMPLES = 255
"""Age of a measurement in samples that the delay line of the reference holds."""

LEARNED = tuple(f"learned_{k}" for k in range(4))
COVARIANCE = tuple(f"covariance_{k}" for k in range(10))
STATES = (
    *(
        "filtered",
        "integral",
        "correction",
        "lagged",
        "done_before",
        "play",
        "aged_play",
        "stroke",
        "before",
        "reference_before",
    ),
    *LEARNED,
    *COVARIANCE,
)
"""Memory of the law beside its delay lines: filtered error, integral, correction and how far the drive has
followed it, play of the reference and of the aged one, its stroke, the aged reference one sample before, and of the
least squares four estimates (friction, constant, level, age) and the lower triangle of their covariance."""
_VARIANCES = ("friction_variance", "constant_variance", "level_variance", "age_variance")
NUMBERS = (
    *("kp", "ki_h", "clamp", "filter_share", "deadband", "width", "by_play"),
    *("stroke_width", "lag_share", "gain", "delay", "sample", "scale", "noise", "middle", "per_unit", "forgotten"),
    *_VARIANCES,
    "rate_error",
)
"""Constants of the law, in the order of `FeedbackLaw.numbers`."""
_SEEN = ("reference", "aged", "lagged_aged", "measured", "fresh", "shape", "aged_shape")
"""Inputs of the law before its states."""
MOST_AGE = 1.0
"""Share of the stated delay by which a measurement may be older or younger."""

_AGE_DEVIATION = 0.5  # of Delta before anything is learned, over the delay
_NOISE = 0.5  # of what the shapes leave, over the scale: samples follow each other closely, and are not independent
_MEMORY_S = 2.0  # of sliding, which the least squares remember
_SAME_WAY = 0.99  # of the product of both shapes
_LIKELY = 2.0  # standard deviations that a learned error hardly exceeds
_WAITING = 0.1  # share of the integral's gain while the tendon sticks
_FAR = 1e30  # a correction that nothing reaches


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackLaw:
    """Numbers of the law.

    Parameters
    ----------
    sample_s : float
        Time between two calls [s], > 0.
    delay_s : float
        Age of a measurement when it arrives [s], >= 0 and at most `MOST_SAMPLES` samples.
    proportional : float
        Kp: correction per error [unit of the command per unit of the goal], >= 0.
    integral_per_s : float
        Ki: its rate per error, >= 0.
    clamp : float, optional
        Largest correction [unit of the command], > 0; default: none.
    filter_s : float, optional
        Time constant of a low-pass filter of the error [s], >= 0; 0 for none.
    deadband : float, optional
        Error that is ignored [unit of the goal], >= 0: half a step of the sensor's resolution.
    width : float, optional
        Half width of the play that shapes friction, and after which a turn is one [unit of the goal], > 0.
    streamed : bool, optional
        The shape of friction comes with each sample, instead of from the play.
    gain : float, optional
        What a unit of correction does to the goal while it slides [unit of the goal per unit of the command].
    lag_s : float, optional
        Time constant with which the drive follows [s], >= 0.
    stroke : float, optional
        Way of the reference after a turn, either way, in which the tendon still sticks [unit of the goal], >= 0. There
        the integral waits, with a tenth of its gain, and nothing is learned.
    error_scale : float, optional
        Size of errors that the feedforward leaves [unit of the goal]; 0: nothing is learned.
    deviations : tuple of 3 float, optional
        Standard deviations of alpha, beta and gamma before anything is learned, over `error_scale` [-], >= 0.
    rate_error_s : float, optional
        Error per rate of the reference up to which it is one of the joint, and no age [s], >= 0.
    middle, half_range : float, optional
        Of the reference [unit of the goal]: where x is 0, and over what way it is 1, > 0.
    """

    sample_s: float
    delay_s: float
    proportional: float
    integral_per_s: float
    clamp: float = math.inf
    filter_s: float = 0.0
    deadband: float = 0.0
    width: float = 1.0
    streamed: bool = False
    gain: float = 1.0
    lag_s: float = 0.0
    stroke: float = 0.0
    error_scale: float = 0.0
    deviations: tuple[float, float, float] = (1.0, 0.3, 1.0)
    rate_error_s: float = 0.0
    middle: float = 0.0
    half_range: float = 1.0

    def __post_init__(self) -> None:
        require("sample_s", self.sample_s, above=0, hint="the time between two calls of the controller")
        require("width", self.width, above=0, hint="a hundredth of the reference's range")
        require("half_range", self.half_range, above=0, hint="half of the reference's range")
        for name in (
            "delay_s",
            "proportional",
            "integral_per_s",
            "filter_s",
            "deadband",
            "lag_s",
            "stroke",
            "error_scale",
            "rate_error_s",
        ):
            require(name, getattr(self, name), least=0, hint="0 for none")
        for deviation in self.deviations:
            require("deviations", deviation, least=0, hint="0 for what is not learned")
        if not self.clamp > 0:
            raise ParameterError(f"clamp must be > 0, got {self.clamp}; leave it out for none")
        if self.delay_s > MOST_SAMPLES * self.sample_s:
            raise ParameterError(
                f"delay_s must be at most {MOST_SAMPLES} samples, {MOST_SAMPLES * self.sample_s:g} s, got "
                f"{self.delay_s:g}; sample less often, or measure closer"
            )

    @property
    def age(self) -> tuple[int, float]:
        """Age of a measurement in whole samples, and the share of a further one [-]."""
        samples = self.delay_s / self.sample_s
        whole = math.floor(samples + 1e-9)
        return whole, max(samples - whole, 0.0)

    @property
    def filter_share(self) -> float:
        """Share of the way to the error that the filter goes in a sample [-]."""
        return _share(self.sample_s, self.filter_s)

    @property
    def learns_age(self) -> bool:
        """Whether the age of the measurement is learned."""
        return self.error_scale > 0 and self.delay_s > 0

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of `NUMBERS`."""
        return (
            self.proportional,
            self.integral_per_s * self.sample_s,
            min(self.clamp, _FAR),
            self.filter_share,
            self.deadband,
            self.width,
            0.0 if self.streamed else 1.0,
            self.stroke / 2,
            _share(self.sample_s, self.lag_s),
            self.gain,
            self.delay_s,
            self.sample_s,
            self.error_scale or 1.0,
            _NOISE**2,
            self.middle,
            1 / self.half_range,
            (self.sample_s / _MEMORY_S) ** 2 * _NOISE**2,
            *self._variances,
            self.rate_error_s,
        )

    @property
    def _variances(self) -> tuple[float, ...]:
        """Of what is learned, before."""
        errors = self.deviations if self.error_scale else (0.0, 0.0, 0.0)
        return tuple(each**2 for each in (*errors, _AGE_DEVIATION if self.learns_age else 0.0))

    def start(self, reference: float) -> tuple[float, ...]:
        """Values of `STATES` at rest under a reference."""
        covariance = [value if i == j else 0.0 for i, value in enumerate(self._variances) for j in range(i + 1)]
        return (*([0.0] * 5), *([reference] * 5), *([0.0] * len(LEARNED)), *covariance)

    def likely_correction(self, shape: float = 1.0) -> float:
        """Correction of all learned errors together at two standard deviations each [unit of the command].

        `shape` is the largest that friction's has [-].
        """
        friction, *others = self.deviations
        return _LIKELY * self.error_scale * (shape * friction + sum(others)) / self.gain

    def scaled(self, gain: float) -> "FeedbackLaw":
        """The same with both gains times a factor [-]."""
        return replace(self, proportional=gain * self.proportional, integral_per_s=gain * self.integral_per_s)

    def plain(self) -> "FeedbackLaw":
        """The same gains as a plain PI: nothing is learned."""
        return replace(self, error_scale=0.0)


def _share(sample_s: float, time_s: float) -> float:
    return 1.0 if time_s == 0 else 1 - math.exp(-sample_s / time_s)


def _play(play: ca.SX, value: ca.SX, half: ca.SX) -> ca.SX:
    """Where a play of half width `half` is after it was moved to a value."""
    return at_least(-at_least(-play, -(value + half)), value - half)


def feedback_step() -> Law:
    """A sample of the law: `STATES` from themselves, reference, aged values, measurement and `NUMBERS`.

    `fresh` is 1, or 0 where the measurement is missing: then the error is held, and nothing is learned. Where the
    correction is at its clamp, the integral goes on only towards less of it (anti-windup).
    """
    reference, aged, lagged_aged, measured, fresh, streamed, aged_streamed = given = tuple(map(ca.SX.sym, _SEEN))
    states, numbers = tuple(map(ca.SX.sym, STATES)), tuple(map(ca.SX.sym, NUMBERS))
    s, n = dict(zip(STATES, states, strict=True)), dict(zip(NUMBERS, numbers, strict=True))

    # shape of friction, now and as old as the measurement
    play, aged_play = _play(s["play"], reference, n["width"]), _play(s["aged_play"], aged, n["width"])
    shape = n["by_play"] * (reference - play) / n["width"] + streamed
    aged_shape = n["by_play"] * (aged - aged_play) / n["width"] + aged_streamed

    # least squares along strokes, where friction stands still
    stroke = _play(s["stroke"], aged, n["stroke_width"])
    sliding = ca.fabs(aged - stroke) >= 0.99 * n["stroke_width"]
    moves = ca.fabs(aged - s["before"]) > 0
    full = _SAME_WAY * n["width"] ** 2  # less where the reference has turned since the measurement
    same_way = (reference - play) * (aged - aged_play) >= full
    learning = ca.if_else(ca.logic_and(ca.logic_and(sliding, moves), same_way), fresh, 0.0)
    done = n["gain"] * lagged_aged
    rate, done_rate = (aged - s["before"]) / n["sample"], (done - s["done_before"]) / n["sample"]
    level, aged_level = ((at - n["middle"]) * n["per_unit"] for at in (reference, aged))
    x = ca.vertcat(aged_shape, 1, aged_level, (rate + done_rate) * n["delay"] / n["scale"])
    learned, p = ca.vertcat(*(s[name] for name in LEARNED)), _symmetric([s[name] for name in COVARIANCE])
    prior = ca.diag(ca.vertcat(*(n[name] for name in _VARIANCES)))
    p = p + learning * n["forgotten"] * (prior - p)
    px = p @ x
    seen = (aged - measured + done) / n["scale"]
    gain = learning / (n["noise"] + at_least(ca.dot(x, px), 0.0))
    learned_new, p_new = learned + gain * (seen - ca.dot(x, learned)) * px, p - gain * px @ px.T
    late = n["delay"] * learned_new[3]
    real = _within(late, n["rate_error"])
    rate_now = (reference - s["reference_before"]) / n["sample"]
    known = (n["scale"] * ca.dot(learned_new[:3], ca.vertcat(shape, 1, level)) + real * rate_now) / n["gain"]
    older = _within(late - real, MOST_AGE * n["delay"]) * rate

    # error, its filter, and the integral
    error = aged - measured - older
    error = at_least(error - n["deadband"], 0.0) - at_least(-error - n["deadband"], 0.0)
    filtered = s["filtered"] + fresh * n["filter_share"] * (error - s["filtered"])
    heard = ca.if_else(sliding, fresh, _WAITING * fresh)
    integral = s["integral"] + heard * n["ki_h"] * filtered
    wanted = n["kp"] * filtered + integral + known
    correction = _within(wanted, n["clamp"])
    outward = (wanted - correction) * filtered > 0
    lower = [p_new[i, j] for i in range(len(LEARNED)) for j in range(i + 1)]
    found = (
        *(filtered, ca.if_else(outward, s["integral"], integral), correction),
        s["lagged"] + n["lag_share"] * (correction - s["lagged"]),
        *(done, play, aged_play, stroke, aged, reference, *ca.vertsplit(learned_new), *lower),
    )
    return Law(
        name="feedback_step",
        comment="One sample of the feedback.",
        inputs=(*given, *states, *numbers),
        outputs=dict(zip((f"{name}_new" for name in STATES), found, strict=True)),
    )


def _symmetric(lower: Sequence[ca.SX]) -> ca.SX:
    """Matrix of its lower triangle, row by row."""
    found = ca.SX(len(LEARNED), len(LEARNED))
    places = ((i, j) for i in range(len(LEARNED)) for j in range(i + 1))
    for (i, j), value in zip(places, lower, strict=True):
        found[i, j] = found[j, i] = value
    return found


def _within(value: ca.SX, most: ca.SX) -> ca.SX:
    return -at_least(-at_least(value, -most), -most)


def _view(values: Any) -> memoryview:
    return memoryview(values)


class _Step:
    """The law as a function of one array of its inputs, evaluated in place."""

    def __init__(self) -> None:
        law = feedback_step()
        whole = ca.vertcat(*law.inputs)
        self._function = ca.Function("feedback", [whole], [ca.vertcat(*law.outputs.values())])
        self._buffer, self.evaluate = self._function.buffer()
        self.given = np.zeros(len(law.inputs))
        self.found = np.zeros(len(law.outputs))
        self._buffer.set_arg(0, _view(self.given))
        self._buffer.set_res(0, _view(self.found))


class FeedbackController:
    """The law at work, from a reference at rest, in double precision.

    Parameters
    ----------
    law : FeedbackLaw
    reference : float, optional
        At rest before the first call [unit of the goal].
    """

    def __init__(self, law: FeedbackLaw, reference: float = 0.0) -> None:
        self.law = law
        whole, self._part = law.age
        self._references = deque([reference] * (whole + 2), maxlen=whole + 2)
        self._corrections = deque([0.0] * (whole + 2), maxlen=whole + 2)
        self._shapes = deque([0.0] * (whole + 2), maxlen=whole + 2)
        self._step = _Step()
        self._step.given[len(_SEEN) :] = (*law.start(reference), *law.numbers)
        self._states = self._step.given[len(_SEEN) : len(_SEEN) + len(STATES)]

    @property
    def correction(self) -> float:
        """The last correction [unit of the command]."""
        return float(self._states[STATES.index("correction")])

    @property
    def age_s(self) -> float:
        """Age of the measurement as it has been learned [s]."""
        share = float(self._states[STATES.index(LEARNED[3])])
        return self.law.delay_s * (1 + min(max(share, -MOST_AGE), MOST_AGE))

    def step(self, reference: float, measured: float, shape: float = 0.0) -> float:
        """Correction of the command after one more sample; a missing (NaN) measurement holds the error.

        Parameters
        ----------
        reference : float
            Of this instant; one that is missing (NaN) is taken as the last one.
        measured : float
            That arrives now.
        shape : float, optional
            Of friction, of this instant, where the law takes it [-].
        """
        self._references.appendleft(reference if math.isfinite(reference) else self._references[0])
        self._corrections.appendleft(float(self._states[STATES.index("lagged")]))
        self._shapes.appendleft(shape)
        aged, lagged, aged_shape = (
            past[-2] + self._part * (past[-1] - past[-2])
            for past in (self._references, self._corrections, self._shapes)
        )
        fresh = math.isfinite(measured)
        seen, step = measured if fresh else aged, self._step
        step.given[: len(_SEEN)] = (self._references[0], aged, lagged, seen, float(fresh), shape, aged_shape)
        step.evaluate()
        self._states[:] = step.found
        return self.correction
