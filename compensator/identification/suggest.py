"""An excitation for identification within the limits of a rig, as a force file."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.parameters import CORE, TENDON, Parameter, ParametricChain
from tendonff.compensator.scenario.sampled.sampling import initial_tension, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.fits.chain import ChainResponse, Drive
from tendonff.ocp.tendon.inverse import invert

D = Parameter

ROW_S = 0.005
RATE_SHARE, FORCE_SHARE = 0.5, 0.9
"""Shares of the actuator's limits that the excitation uses."""

LEAST_HOLD_S = 1.0
STROKE_S, SMALL_STROKE_S, STEP_S = 2.0, 0.8, 0.4
LOW_SHARE, LEAST_FORCE_N = 0.08, 0.5
MASSES, SEARCH_STEP_S, NOISE_SHARE = 6, ROW_S, 0.005
"""Of the chain that weighs plans against each other; noise of the cells as a share of their range."""

PRIOR = 1e-2
"""Information that is there before: everything is known to ten times its size."""

FITTED = (*CORE, D.ADHESION, *TENDON)
"""Parameters of a fit on which a design depends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """A force file with the reasons for its parts.

    Attributes
    ----------
    time_s, force_N : Array
        Shape (n,).
    parts : tuple of str
        What each part is for, with its start.
    expected_percent : float or None
        Error of a design that the noise of the cells would leave [% of the reference's range]; None without a
        reference.
    """

    time_s: Array
    force_N: Array
    parts: tuple[str, ...]
    expected_percent: float | None = None

    def lines(self, folder: Path) -> tuple[str, ...]:
        """Its file in this folder, its parts and its benefit in words."""
        head = f"{folder / 'suggested_force.csv'}: {self.time_s[-1]:.4g} s, up to {self.force_N.max():.4g} N"
        return (head, *(f"  {part}" for part in self.parts), *filter(None, (self.gain,)))

    @property
    def gain(self) -> str:
        """Expected benefit, in a sentence; empty where it is unknown."""
        if self.expected_percent is None:
            return ""
        return (
            f"noise of {100 * NOISE_SHARE:g} % of range on the cells would leave an error of "
            f"{self.expected_percent:.2g} % in a design"
        )


class _Pen:
    """Draws a force as smooth moves and holds."""

    def __init__(self, force_N: float, rate_N_per_s: float) -> None:
        self.pieces: list[Array] = [np.array([force_N])]
        self.parts: list[str] = []
        self._rate = rate_N_per_s

    def note(self, text: str) -> None:
        now_s = (sum(len(p) for p in self.pieces) - 1) * ROW_S
        self.parts.append(f"{now_s:.4g} s: {text}")

    def hold(self, seconds: float) -> None:
        self.pieces.append(np.full(max(1, round(seconds / ROW_S)), self.pieces[-1][-1]))

    def move(self, force_N: float, seconds: float) -> None:
        """A quintic move, as slow as asked or as the rate demands."""
        start = float(self.pieces[-1][-1])
        seconds = max(seconds, 1.9 * abs(force_N - start) / self._rate)  # the quintic's top speed is 1.875 of its mean
        s = np.arange(1, max(2, math.ceil(seconds / ROW_S)) + 1) / max(2, math.ceil(seconds / ROW_S))
        self.pieces.append(start + (force_N - start) * s**3 * (10 - 15 * s + 6 * s * s))

    def sweep(self, amplitude_N: float, seconds: float) -> None:
        """Two sines that fade in and out, whose speeds cover a decade."""
        start = float(self.pieces[-1][-1])
        t = np.arange(1, round(seconds / ROW_S) + 1) * ROW_S
        fade = np.clip(np.minimum(t, seconds - t) / 1.0, 0, 1)
        waves = np.array([(0.65, 0.4), (0.35, 1.7)])
        steepest = amplitude_N * float(np.sum(waves[:, 0] * 2 * np.pi * waves[:, 1] + waves[:, 0]))
        scale = min(1.0, self._rate / steepest)
        wave = sum(share * np.sin(2 * np.pi * f * t) for share, f in waves)
        self.pieces.append(start + scale * amplitude_N * fade * fade * (3 - 2 * fade) * wave)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Parts of an excitation."""

    strokes: tuple[float, ...]  # tops of the full strokes, as shares of the high force
    stroke_s: float  # time of each way
    holds: int  # holds after steps, up to 8
    hold_taus: float  # their length in relaxation times; at least a second each
    reversals: tuple[float, ...]  # shares of the high force from which small reversals start
    sweep_s: float


PLANS = (
    Plan(strokes=(1.0, 0.6, 1.0), stroke_s=2.0, holds=8, hold_taus=5.0, reversals=(0.7,), sweep_s=12.0),
    *(
        Plan(strokes=strokes, stroke_s=stroke_s, holds=holds, hold_taus=3.5, reversals=reversals, sweep_s=sweep_s)
        for strokes, stroke_s in (((1.0, 0.6, 1.0), 2.0), ((1.0, 0.3, 0.6) * 2, 1.2), ((1.0, 0.4, 0.2) * 3, 1.0))
        for holds in (3, 8)
        for reversals in ((0.7,), (0.6, 0.2))
        for sweep_s in (6.0, 14.0)
    ),
)
"""Those that are tried; the first is the longest that is suggested."""


@in_turn
def suggest(scenario: Scenario) -> Excitation:
    """An excitation for the rig of a scenario, within the limits of its actuator.

    Of several plans the one that leaves a design with the least expected error, by the exact sensitivities of the
    chain and with the same noise on the cells.

    Raises
    ------
    InputError
        If the limits leave no room.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> excitation = tf.suggest(scenario)  # doctest: +SKIP
    >>> excitation.write("excitation.csv")  # doctest: +SKIP
    """
    start = _start_N(scenario)
    first = draw_plan(scenario, PLANS[0], _lowest_N(scenario, None), start)
    wanted = _wanted(scenario)
    if wanted is None:
        return first
    information = Information(scenario, *wanted)
    best, least = first, information.expected_percent(first.force_N)
    lowest = _lowest_N(scenario, wanted[0])
    for plan in PLANS[1:]:
        tried = draw_plan(scenario, plan, lowest, start)
        if tried.time_s[-1] > first.time_s[-1]:
            continue
        expected = information.expected_percent(tried.force_N)
        if expected < least:
            best, least = tried, expected
    return replace(best, expected_percent=least)


def _start_N(scenario: Scenario) -> float | None:
    """Tension at rest before the start, as a simulation of the force takes it; None where the scenario tells none."""
    try:
        return initial_tension(scenario)
    except (InputError, ParameterError):
        return None


def _wanted(scenario: Scenario) -> tuple[Array, float] | None:
    """The reference and its step; None where the path moves, or there is no reference to ask for anything."""
    if scenario.transmission.joints:
        return None
    try:
        reference = sample_reference(scenario, strict=False)
    except (InputError, ParameterError):
        return None
    return reference.tension_N, reference.step_s


def _lowest_N(scenario: Scenario, reference_N: Array | None) -> float:
    """Least force: a share of the largest or, with a reference, what its lowest tension asks for if that is less."""
    t = scenario.transmission
    usual = max(t.actuator.force_min_N, LOW_SHARE * FORCE_SHARE * t.actuator.force_max_N)
    if reference_N is None:
        return usual
    released = CapstanLaw.of(t).input_for_N(float(reference_N.min()), Branch.RELEASE)
    deepest = float(t.actuator.law.force_N(released, -1.0))
    return min(usual, max(t.actuator.force_min_N, deepest, LEAST_FORCE_N))


class Information:
    """Expected error of a design based on a fit to an excitation."""

    def __init__(self, scenario: Scenario, reference_N: Array, step_s: float) -> None:
        t = scenario.transmission
        self._model = ParametricChain(
            transmission=t, level=Level.PRESLIDING, count=MASSES, longest_step_s=SEARCH_STEP_S
        )
        self._values = self._model.values()
        self._sizes = np.array([max(abs(self._values[name]), 1.0 if name is D.ADHESION else 1e-9) for name in FITTED])
        self._noise_N = NOISE_SHARE * t.actuator.force_max_N
        rows = slice(None, None, max(1, round(SEARCH_STEP_S / step_s)))
        chain = Chain.of(t, Level.PRESLIDING, MASSES)
        force = invert(chain, reference_N, step_s).force_N[rows]
        response = self._respond(np.maximum(force, LEAST_FORCE_N), float(reference_N[0]))
        slopes = response.output_slopes * self._sizes
        self._design = slopes.T @ slopes / len(slopes)
        self._span_N = max(float(np.ptp(reference_N)), 1e-9)

    def _respond(self, force_N: Array, rest_N: float) -> ChainResponse:
        drive = Drive(input_N=force_N, step_s=SEARCH_STEP_S, first_output_N=rest_N)
        return self._model.predict(self._values, drive, FITTED)

    def expected_percent(self, force_N: Array) -> float:
        """RMS error of a design from these parameters' scatter alone [% of the reference's range]."""
        response = self._respond(force_N, float(force_N[0]))
        elongation = response.elongation_slopes - response.elongation_slopes.mean(axis=0)
        stretch = NOISE_SHARE * max(float(np.ptp(response.elongation_m)), 1e-12)
        parts = (response.output_slopes / self._noise_N, elongation / stretch)
        rows = np.concatenate(parts) * self._sizes
        information = rows.T @ rows + PRIOR * np.eye(len(FITTED))
        return float(100 * np.sqrt(np.trace(np.linalg.solve(information, self._design))) / self._span_N)


def draw_plan(scenario: Scenario, plan: Plan, low_N: float, start_N: float | None = None) -> Excitation:
    """The force of a plan, from the tension at rest on where there is one; InputError if the limits leave no room."""
    t = scenario.transmission
    law, low = CapstanLaw.of(t), low_N
    high = FORCE_SHARE * t.actuator.force_max_N
    if high < 1.5 * low:
        raise InputError(
            f"force_min_N = {t.actuator.force_min_N:g} and force_max_N = {t.actuator.force_max_N:g} leave no room to "
            "excite friction; give force_max_N of at least 1.7 times force_min_N"
        )
    # Enough for the output to move to and fro through several dead bands, not more.
    dead = math.exp(law.pull_exponent + law.release_exponent)
    usual = max(t.actuator.force_min_N, LOW_SHARE * high)
    high = min(high, max(usual * dead**2, 4 * usual))
    middle = math.sqrt(low * high)
    hold = max(LEAST_HOLD_S, plan.hold_taus * t.tendon.relaxation_time_s)
    start = min(max(middle if start_N is None else start_N, t.actuator.force_min_N), t.actuator.force_max_N)
    pen = _Pen(start, RATE_SHARE * t.actuator.force_rate_max_N_per_s)
    pen.note("rest: offset of the cells against each other, if the tension is uniform")
    pen.hold(1.0)
    pen.note(f"full strokes down to {low:.3g} N: friction in either direction over the whole range of load")
    for place in plan.strokes:
        pen.move(max(place * high, 2 * low), plan.stroke_s)
        pen.move(low, plan.stroke_s)
    pen.note(f"holds of {hold:.3g} s after steps: stiffness and relaxation")
    for level in (high, low, middle, high, low, high, middle, low)[: plan.holds]:
        pen.move(level, STEP_S)
        pen.hold(hold)
    pen.note("small reversals without gross sliding: bristle stiffness")
    for place in plan.reversals:
        top = max(place * high, 2 * low)
        pen.move(top, SMALL_STROKE_S)
        for share in (0.1, 0.2, 0.3, 0.4):
            pen.move(top * (1 - share), SMALL_STROKE_S)
            pen.move(top, SMALL_STROKE_S)
    pen.note("two sines: speed dependence, and a part to judge the law on")
    centre = (low + high) / 2
    pen.move(centre, STROKE_S)
    pen.sweep(0.95 * (high - centre), plan.sweep_s)
    pen.hold(0.5)
    force = np.concatenate(pen.pieces)
    return Excitation(time_s=np.arange(len(force), dtype=np.float64) * ROW_S, force_N=force, parts=tuple(pen.parts))
