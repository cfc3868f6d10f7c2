r"""Law of the feedback: proportional and integral action, and errors that are learned, against the reference of the
same age.

::

    reference --[ delay_s ]--> (+) --[ deadband ]--[ 1/(filter_s s + 1) ]--> e
    measured, delay_s old ----> (-)
    correction = Kp e + Ki int e + (alpha s + beta + gamma x) / g, within +-clamp

The correction is added to the command that the feedforward computes. What a feedforward leaves is known in shape: s is
that of friction, the reference less its play over the half width of the play, -1 to 1, which turns with the reference;
a constant; x, the reference about its middle, -1 to 1, for loads and stiffness; and the rate of the reference, for an
age of the measurement that differs from delay_s. The measurement is compared with what these, and the own corrections
as old as itself, explain,

    d = e + g u = alpha s + beta + gamma x + Delta dr/dt,

by recursive least squares while the tendon slides. d is free of the own corrections, so that no delay bounds how fast
it is learned. Delta dr/dt is taken off the error, up to delay_s either way; the rest is corrected before it is
measured. What remains is for Kp and Ki, which margins are for.

Friction of a tendon multiplies its tension. There the law works on logarithms, ln(T + p) of reference and measurement,
in which sliding has the same gain either way, and its correction is an exponent of the input tension that it takes for
the reference's.
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
    *("filtered", "integral", "correction", "acted", "lagged", "play", "aged_play", "stroke", "before"),
    *LEARNED,
    *COVARIANCE,
)
"""Memory of the law beside its delay lines: filtered error, integral, correction, its share of the goal and how far the
drive has followed that, play of the reference and of the aged one, its stroke, the aged reference one sample before,
and of the least squares four estimates (friction, constant, level, age) and the lower triangle of their covariance."""
_PRIORS = ("friction_variance", "constant_variance", "level_variance", "age_variance")
NUMBERS = (
    *("kp", "ki_h", "clamp", "filter_share", "deadband", "width", "stroke_width", "lag_share", "gain", "delay"),
    *("sample", "scale", "noise", "forgotten", "middle", "per_unit", "lift", "least", "slip", "turn"),
    *_PRIORS,
)
"""Constants of the law, in the order of `FeedbackLaw.numbers`."""
_SEEN = 5  # inputs of the law before its states
MOST_AGE = 1.0
"""Share of the stated delay by which a measurement may be older or younger."""

_AGE_DEVIATION = 0.5  # of the age, over the delay
_MEMORY_S = 2.0  # of sliding, which the least squares remember
_WAITING = 0.1  # share of the integral's gain while the tendon sticks
_FAR = 1e30  # a correction that nothing reaches
_MOST_EXPONENT = 3.0  # of a correction on logarithms


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """Errors of a feedforward that the law learns, as far as they are known before.

    Parameters
    ----------
    scale : float
        Size of the errors [unit of the goal; on logarithms -], > 0.
    friction, constant, level : float
        Standard deviations of alpha, beta and gamma over the scale [-], >= 0; 0: not learned.
    noise : float
        Standard deviation of what these leave of an error, over the scale [-], > 0.
    middle, half_range : float
        Reference where x is 0, and its distance to where x is 1 [unit of the goal; on logarithms those of ln(T + p)].
    age : bool, optional
        The age of the measurement is learned.
    """

    scale: float
    friction: float
    constant: float
    level: float
    noise: float
    middle: float
    half_range: float
    age: bool = True

    def __post_init__(self) -> None:
        for name in ("scale", "noise", "half_range"):
            require(name, getattr(self, name), above=0, hint="that of the errors of the feedforward")
        for name in ("friction", "constant", "level"):
            require(name, getattr(self, name), least=0, hint="0 for an error that is not learned")


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """Input tension that sliding at an output tension T takes, (T + lift_N) ratio e^{turn s}, s = ±1 with the motion.

    Parameters
    ----------
    lift_N : float
        p: load-independent friction as a tension [N], >= 0.
    least_N : float
        Least T + p that logarithms are taken of [N], > 0.
    ratio : float
        Of the middle of both branches [unit of the command per N], > 0.
    turn : float, optional
        Half the difference of their exponents [-], >= 0.
    """

    lift_N: float
    least_N: float
    ratio: float
    turn: float = 0.0

    def __post_init__(self) -> None:
        require("lift_N", self.lift_N, least=0, hint="0 without load-independent friction")
        for name in ("least_N", "ratio"):
            require(name, getattr(self, name), above=0, hint="that of the tendon")


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackLaw:
    """Numbers of the law.

    Parameters
    ----------
    sample_s : float
        Time between two calls [s], > 0.
    delay_s : float
        Age of a measurement when it arrives [s], >= 0 and with `drive_delay_s` at most `MOST_SAMPLES` samples.
    proportional : float
        Kp: correction per error [unit of the command per unit of the goal; on logarithms -], >= 0.
    integral_per_s : float
        Ki: its rate per error, >= 0.
    clamp : float, optional
        Largest correction [unit of the command], > 0; default: none.
    filter_s : float, optional
        Time constant of a low-pass filter of the error [s], >= 0; 0 for none.
    deadband : float, optional
        Error that is ignored [unit of the goal], >= 0: half a step of the sensor's resolution.
    width : float, optional
        Half width of the play that shapes friction [unit of the goal; on logarithms -], > 0.
    gain : float, optional
        What a unit of correction does to the goal while it slides, > 0.
    lag_s : float, optional
        Time constant with which the drive follows [s], >= 0.
    drive_delay_s : float, optional
        Age of a command when it acts [s], >= 0.
    stroke : float, optional
        Way of the reference after a turn, either way, in which the tendon still sticks [unit of the goal; on logarithms
        -], >= 0. There the integral waits, with a tenth of its gain, and nothing is learned.
    learned : Learned, optional
        Default: nothing is learned.
    slip : Slip, optional
        The law works on logarithms of tensions; default: it does not.
    """

    sample_s: float
    delay_s: float
    proportional: float
    integral_per_s: float
    clamp: float = math.inf
    filter_s: float = 0.0
    deadband: float = 0.0
    width: float = 1.0
    gain: float = 1.0
    lag_s: float = 0.0
    drive_delay_s: float = 0.0
    stroke: float = 0.0
    learned: Learned | None = None
    slip: Slip | None = None

    def __post_init__(self) -> None:
        require("sample_s", self.sample_s, above=0, hint="the time between two calls of the controller")
        require("width", self.width, above=0, hint="a hundredth of the reference's range")
        require("gain", self.gain, above=0, hint="1 for a joint that follows its motor")
        times = ("delay_s", "filter_s", "lag_s", "drive_delay_s")
        for name in (*times, "proportional", "integral_per_s", "deadband", "stroke"):
            require(name, getattr(self, name), least=0, hint="0 for none")
        if not self.clamp > 0:
            raise ParameterError(f"clamp must be > 0, got {self.clamp}; leave it out for none")
        longest_s = MOST_SAMPLES * self.sample_s
        if self.delay_s + self.drive_delay_s > longest_s:
            raise ParameterError(
                f"delay_s must be at most {MOST_SAMPLES} samples, {longest_s - self.drive_delay_s:g} s, got "
                f"{self.delay_s:g}; sample less often, or measure closer"
            )

    @property
    def age(self) -> tuple[int, float]:
        """Age of a measurement in whole samples, and the share of a further one [-]."""
        return self._samples(self.delay_s)

    @property
    def acted_age(self) -> tuple[int, float]:
        """The same of a correction that a measurement has seen."""
        return self._samples(self.delay_s + self.drive_delay_s)

    def _samples(self, time_s: float) -> tuple[int, float]:
        samples = time_s / self.sample_s
        whole = math.floor(samples + 1e-9)
        return whole, max(samples - whole, 0.0)

    @property
    def filter_share(self) -> float:
        """Share of the way to the error that the filter goes in a sample [-]."""
        return _share(self.sample_s, self.filter_s)

    @property
    def learns_age(self) -> bool:
        """Whether the age of the measurement is learned."""
        return self.learned is not None and self.learned.age and self.delay_s > 0

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of `NUMBERS`."""
        learned, slip = self.learned or _NOTHING, self.slip or _NO_SLIP
        priors = self._priors()
        noise = learned.noise**2
        return (
            self.proportional,
            self.integral_per_s * self.sample_s,
            min(self.clamp, _FAR),
            self.filter_share,
            self.deadband,
            self.width,
            self.stroke / 2,
            _share(self.sample_s, self.lag_s),
            self.gain,
            self.delay_s,
            self.sample_s,
            learned.scale,
            noise,
            (self.sample_s / _MEMORY_S) ** 2 * noise / max(*priors, 1e-9),
            learned.middle,
            1 / learned.half_range,
            slip.lift_N,
            slip.least_N,
            slip.ratio,
            slip.turn,
            *priors,
        )

    def _priors(self) -> tuple[float, ...]:
        """Variances before anything is learned."""
        learned = self.learned
        if learned is None:
            return (0.0,) * len(LEARNED)
        age = _AGE_DEVIATION if self.learns_age else 0.0
        return tuple(deviation**2 for deviation in (learned.friction, learned.constant, learned.level, age))

    def start(self, reference: float) -> tuple[float, ...]:
        """Values of `STATES` at rest under a reference."""
        covariance = [a if i == j else 0.0 for i, a in enumerate(self._priors()) for j in range(i + 1)]
        return (*([0.0] * 5), *([self.place(reference)] * 4), *([0.0] * len(LEARNED)), *covariance)

    def place(self, goal: float) -> float:
        """Where the law works: the goal, or the logarithm of a tension."""
        return goal if self.slip is None else math.log(max(goal + self.slip.lift_N, self.slip.least_N))

    def scaled(self, gain: float) -> "FeedbackLaw":
        """The same with Kp and Ki times a factor [-]."""
        return replace(self, proportional=gain * self.proportional, integral_per_s=gain * self.integral_per_s)

    def plain(self) -> "FeedbackLaw":
        """The same gains as a plain PI: nothing is learned, and nothing known of friction."""
        return replace(self, learned=None, slip=None if self.slip is None else replace(self.slip, turn=0.0))


_NOTHING = Learned(scale=1.0, friction=0.0, constant=0.0, level=0.0, noise=1.0, middle=0.0, half_range=1.0)
_NO_SLIP = Slip(lift_N=0.0, least_N=1.0, ratio=1.0)


def _share(sample_s: float, time_s: float) -> float:
    return 1.0 if time_s == 0 else 1 - math.exp(-sample_s / time_s)


def _play(play: ca.SX, value: ca.SX, half: ca.SX) -> ca.SX:
    """Where a play of half width `half` is after it was moved to a value."""
    return at_least(-at_least(-play, -(value + half)), value - half)


def feedback_step(*, logarithms: bool = False) -> Law:
    """A sample of the law: `STATES` from themselves, reference, aged values, measurement and `NUMBERS`.

    `fresh` is 1, or 0 where the measurement is missing: then the error is held, and nothing is learned. Where the
    correction is at its clamp, the integral goes on only towards less of it (anti-windup). With logarithms the law is
    that of a `Slip`.
    """
    inputs = ("reference", "aged", "lagged_aged", "measured", "fresh")
    given = tuple(map(ca.SX.sym, inputs))
    states, numbers = tuple(map(ca.SX.sym, STATES)), tuple(map(ca.SX.sym, NUMBERS))
    s, n = dict(zip(STATES, states, strict=True)), dict(zip(NUMBERS, numbers, strict=True))
    wanted_goal, aged_goal, lagged_aged, measured_goal, fresh = given

    off_goal = aged_goal - measured_goal
    off_goal = at_least(off_goal - n["deadband"], 0.0) - at_least(-off_goal - n["deadband"], 0.0)
    goals = (wanted_goal, aged_goal, measured_goal, aged_goal - off_goal)
    if logarithms:
        goals = tuple(ca.log(at_least(goal + n["lift"], n["least"])) for goal in goals)
    reference, aged, measured, counted = goals

    # shape of friction, now and as old as the measurement
    play, aged_play = _play(s["play"], reference, n["width"]), _play(s["aged_play"], aged, n["width"])
    shape, aged_shape = (reference - play) / n["width"], (aged - aged_play) / n["width"]
    level, aged_level = ((at - n["middle"]) * n["per_unit"] for at in (reference, aged))

    # least squares along strokes
    stroke = _play(s["stroke"], aged, n["stroke_width"])
    sliding = ca.fabs(aged - stroke) >= 0.99 * n["stroke_width"]
    learning = ca.if_else(sliding, fresh, 0.0)
    rate = (aged - s["before"]) / n["sample"]
    x = ca.vertcat(aged_shape, 1, aged_level, rate * n["delay"] / n["scale"])
    learned, prior = ca.vertcat(*(s[name] for name in LEARNED)), ca.diag(ca.vertcat(*(n[name] for name in _PRIORS)))
    p = _symmetric([s[name] for name in COVARIANCE])
    p = p + learning * n["forgotten"] * (prior - p)
    px = p @ x
    seen = (aged - measured + n["gain"] * lagged_aged) / n["scale"]
    gain = learning / (n["noise"] + at_least(ca.dot(x, px), 0.0))
    learned_new, p_new = learned + gain * (seen - ca.dot(x, learned)) * px, p - gain * px @ px.T
    older = n["delay"] * _within(learned_new[3], MOST_AGE) * rate

    # error, its filter, and the integral
    error = aged - counted - older
    filtered = s["filtered"] + fresh * n["filter_share"] * (error - s["filtered"])
    integral = s["integral"] + ca.if_else(sliding, fresh, _WAITING * fresh) * n["ki_h"] * filtered
    known = n["scale"] / n["gain"] * ca.dot(learned_new[:3], ca.vertcat(shape, 1, level))
    wanted = n["kp"] * filtered + integral + known
    if logarithms:
        input_tension = n["slip"] * ca.exp(reference + n["turn"] * shape)
        wanted = _within(wanted, _MOST_EXPONENT)
        correction = _within(input_tension * (ca.exp(wanted) - 1), n["clamp"])
        acted = ca.log(at_least(1 + correction / input_tension, math.exp(-_MOST_EXPONENT)))
    else:
        correction = acted = _within(wanted, n["clamp"])
    outward = (wanted - acted) * filtered > 0
    found = (
        *(filtered, ca.if_else(outward, s["integral"], integral), correction, acted),
        s["lagged"] + n["lag_share"] * (acted - s["lagged"]),
        *(play, aged_play, stroke, aged, *ca.vertsplit(learned_new)),
        *(p_new[i, j] for i in range(len(LEARNED)) for j in range(i + 1)),
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

    def __init__(self, *, logarithms: bool) -> None:
        law = feedback_step(logarithms=logarithms)
        whole = ca.vertcat(*law.inputs)
        self._function = ca.Function("feedback", [whole], [ca.vertcat(*law.outputs.values())])
        self._buffer, self.evaluate = self._function.buffer()
        self.given = np.zeros(len(law.inputs))
        self.found = np.zeros(len(law.outputs))
        self._buffer.set_arg(0, _view(self.given))
        self._buffer.set_res(0, _view(self.found))


class _Delay:
    """A delay line between whole samples."""

    def __init__(self, age: tuple[int, float], value: float) -> None:
        whole, self._part = age
        self._past = deque([value] * (whole + 2), maxlen=whole + 2)

    @property
    def last(self) -> float:
        """The youngest value."""
        return self._past[0]

    def after(self, value: float) -> float:
        """The delayed value once this one has come."""
        self._past.appendleft(value)
        younger, older = self._past[-2], self._past[-1]
        return younger + self._part * (older - younger)


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
        self._references = _Delay(law.age, reference)
        self._acted = _Delay(law.acted_age, 0.0)
        self._step = _Step(logarithms=law.slip is not None)
        self._step.given[_SEEN:] = (*law.start(reference), *law.numbers)
        self._states = self._step.given[_SEEN : _SEEN + len(STATES)]

    @property
    def correction(self) -> float:
        """The last correction [unit of the command]."""
        return float(self._states[STATES.index("correction")])

    @property
    def age_s(self) -> float:
        """Age of the measurement as it has been learned [s]."""
        share = float(self._states[STATES.index(LEARNED[3])])
        return self.law.delay_s * (1 + min(max(share, -MOST_AGE), MOST_AGE))

    def step(self, reference: float, measured: float) -> float:
        """Correction of the command after one more sample; a missing (NaN) measurement holds the error.

        Parameters
        ----------
        reference : float
            Of this instant; one that is missing (NaN) is taken as the last one.
        measured : float
            That arrives now.
        """
        now = reference if math.isfinite(reference) else self._references.last
        aged = self._references.after(now)
        acted = self._acted.after(float(self._states[STATES.index("lagged")]))
        fresh = math.isfinite(measured)
        step = self._step
        step.given[:_SEEN] = (now, aged, acted, measured if fresh else aged, float(fresh))
        step.evaluate()
        self._states[:] = step.found
        return self.correction
