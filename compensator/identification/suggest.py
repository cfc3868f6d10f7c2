"""An excitation for identification within the limits of a rig, as a force file."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.pen import Pen
from tendonff.compensator.scenario.sampled.sampling import initial_tension, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn

ROW_S = 0.005
RATE_SHARE, FORCE_SHARE = 0.5, 0.9
"""Shares of the actuator's limits that the excitation uses."""

LOW_SHARE = 0.08
"""Least force, as a share of the largest, where no reference asks for less."""

LEAST_ROOM = 1.5
"""Ratio of the largest force to the least without which nothing slides."""

HOLD_TAUS, LEAST_HOLD_S = 5.0, 1.0
"""Holds in relaxation times, which are to end, and at least."""

STROKE_S, SMALL_STROKE_S, STEP_S, SWEEP_S = 2.0, 0.8, 0.4, 12.0
WAVES = ((0.65, 0.4), (0.35, 1.7))
"""Share of the amplitude and frequency [Hz] of the two sines: their speeds cover a decade."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """A force file with the reasons for its parts.

    Attributes
    ----------
    time_s, force_N : Array
        Shape (n,).
    parts : tuple of str
        What each part is for, with its start.
    """

    time_s: Array
    force_N: Array
    parts: tuple[str, ...]

    def lines(self, folder: Path) -> tuple[str, ...]:
        """Its file in this folder and its parts in words."""
        head = f"{folder / 'suggested_force.csv'}: {self.time_s[-1]:.4g} s, up to {self.force_N.max():.4g} N"
        return (head, *(f"  {part}" for part in self.parts))


@in_turn
def suggest(scenario: Scenario) -> Excitation:
    """An excitation for the rig of a scenario, within the limits of its actuator.

    It goes as deep as the scenario's reference asks for: friction at low tensions is what a design needs most.

    Raises
    ------
    InputError
        If the limits leave no room.

    Examples
    --------
    >>> import tendonff as tf
    >>> excitation = tf.suggest(tf.load_scenario("examples/finger.toml"))
    >>> bool(40 <= excitation.time_s[-1] <= 60)
    True
    """
    t = scenario.transmission
    law, low = CapstanLaw.of(t), _lowest_N(scenario)
    high = FORCE_SHARE * t.actuator.force_max_N
    if high < LEAST_ROOM * low:
        raise InputError(
            f"force_min_N = {t.actuator.force_min_N:g} and force_max_N = {t.actuator.force_max_N:g} leave no room to "
            f"excite friction; give force_max_N of at least {LEAST_ROOM / FORCE_SHARE:.1f} times force_min_N"
        )
    # Enough for the output to move to and fro through several dead bands, not more.
    dead = math.exp(law.pull_exponent + law.release_exponent)
    high = min(high, _usual_N(scenario) * max(dead**2, 4.0))
    middle = math.sqrt(low * high)
    pen = Pen(_start_N(scenario, middle), ROW_S, most_per_s=RATE_SHARE * t.actuator.force_rate_max_N_per_s)
    pen.note("rest: offset of the cells against each other, if the tension is uniform")
    pen.hold(LEAST_HOLD_S)
    pen.note(f"full strokes down to {low:.3g} N: friction in either direction over the whole range of load")
    for place in (1.0, 0.6, 1.0):
        pen.move(max(place * high, 2 * low), STROKE_S)
        pen.move(low, STROKE_S)
    hold = max(LEAST_HOLD_S, HOLD_TAUS * t.tendon.relaxation_time_s)
    pen.note(f"holds of {hold:.3g} s after steps: stiffness and relaxation")
    for level in (high, low, middle, high, low, high, middle, low):
        pen.move(level, STEP_S)
        pen.hold(hold)
    pen.note("small reversals without gross sliding: bristle stiffness")
    top = max(0.7 * high, 2 * low)
    pen.move(top, SMALL_STROKE_S)
    for share in (0.1, 0.2, 0.3, 0.4):
        pen.move(top * (1 - share), SMALL_STROKE_S)
        pen.move(top, SMALL_STROKE_S)
    pen.note("two sines: speed dependence, and a part to judge the law on")
    pen.move((low + high) / 2, STROKE_S)
    _sweep(pen, (high - low) / 2, RATE_SHARE * t.actuator.force_rate_max_N_per_s)
    pen.hold(LEAST_HOLD_S)
    return Excitation(time_s=pen.time_s, force_N=pen.drawn, parts=tuple(pen.parts))


def _sweep(pen: Pen, amplitude_N: float, rate_N_per_s: float) -> None:
    """Two sines that fade in and out within a second."""
    t = np.arange(1, round(SWEEP_S / ROW_S) + 1) * ROW_S
    fade = np.clip(np.minimum(t, SWEEP_S - t), 0, 1)
    steepest = amplitude_N * sum(share * (2 * math.pi * f + 1) for share, f in WAVES)
    wave = sum(share * np.sin(2 * np.pi * f * t) for share, f in WAVES)
    pen.add(pen.last + min(1.0, rate_N_per_s / steepest) * amplitude_N * fade * fade * (3 - 2 * fade) * wave)


def _start_N(scenario: Scenario, otherwise: float) -> float:
    """Tension at rest before the start, as a simulation of the force takes it, within the actuator's limits."""
    actuator = scenario.transmission.actuator
    try:
        start = initial_tension(scenario)
    except (InputError, ParameterError):
        start = otherwise
    return min(max(start, actuator.force_min_N), actuator.force_max_N)


def _usual_N(scenario: Scenario) -> float:
    """Least force where no reference asks for less: a share of the largest."""
    actuator = scenario.transmission.actuator
    return max(actuator.force_min_N, LOW_SHARE * FORCE_SHARE * actuator.force_max_N)


def _lowest_N(scenario: Scenario) -> float:
    """Least force: what the lowest tension of the reference asks for, if that is less than usual."""
    t, usual = scenario.transmission, _usual_N(scenario)
    if t.joints:
        return usual
    try:
        reference = sample_reference(scenario, strict=False).tension_N
    except (InputError, ParameterError):
        return usual
    released = CapstanLaw.of(t).input_for_N(float(reference.min()), Branch.RELEASE)
    return min(usual, max(t.actuator.force_min_N, float(t.actuator.law.force_N(released, -1.0)), 0.0))
