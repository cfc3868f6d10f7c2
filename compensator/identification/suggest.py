"""An excitation for identification within the limits of a rig, as a force file."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.reading import Array
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import CapstanLaw

ROW_S = 0.005
RATE_SHARE, FORCE_SHARE = 0.5, 0.9
"""Shares of the actuator's limits that the excitation uses."""

LEAST_HOLD_S, HOLD_TAUS = 1.0, 5.0
STROKE_S, SMALL_STROKE_S, STEP_S = 2.0, 0.8, 0.4
SWEEP_S = 12.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """A force file with the reasons for its parts.

    Parameters
    ----------
    time_s, force_N : ndarray, shape (n,)
    parts : tuple of str
        What each part is for, with its start.
    """

    time_s: Array
    force_N: Array
    parts: tuple[str, ...]


class _Pen:
    """Draws a force as smooth moves and holds."""

    def __init__(self, force_N: float, rate_N_per_s: float) -> None:
        self.pieces: list[Array] = [np.array([force_N])]
        self.parts: list[str] = []
        self._rate = rate_N_per_s

    @property
    def now_s(self) -> float:
        return (sum(len(p) for p in self.pieces) - 1) * ROW_S

    def note(self, text: str) -> None:
        self.parts.append(f"{self.now_s:.4g} s: {text}")

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


def suggest(scenario: Scenario) -> Excitation:
    """An excitation for the rig of a scenario, within the limits of its actuator.

    Raises
    ------
    InputError
        If the limits leave no room.
    """
    t = scenario.transmission
    law = CapstanLaw.of(t)
    high = FORCE_SHARE * t.actuator.force_max_N
    low = max(t.actuator.force_min_N, 0.08 * high)
    if high < 1.5 * low:
        raise InputError(
            f"force_min_N = {t.actuator.force_min_N:g} and force_max_N = {t.actuator.force_max_N:g} leave no room to "
            "excite friction; give force_max_N of at least 1.7 times force_min_N"
        )
    # Enough for the output to move to and fro through several dead bands, not more.
    dead = math.exp(law.pull_exponent + law.release_exponent)
    high = min(high, max(low * dead**2, 4 * low))
    middle = math.sqrt(low * high)
    hold = max(LEAST_HOLD_S, HOLD_TAUS * t.tendon.relaxation_time_s)
    pen = _Pen(middle, RATE_SHARE * t.actuator.force_rate_max_N_per_s)
    pen.note("rest: bias of the cells against each other, if the tension is uniform")
    pen.hold(1.0)
    pen.note("full strokes: friction in either direction over the whole range of load")
    for top in (high, 0.6 * high, high):
        pen.move(top, STROKE_S)
        pen.move(low, STROKE_S)
    pen.note(f"holds of {hold:.3g} s after steps: stiffness and relaxation")
    for level in (high, low, middle, high, low, high, middle, low):
        pen.move(level, STEP_S)
        pen.hold(hold)
    pen.note("small reversals without gross sliding: bristle stiffness")
    pen.move(0.7 * high, SMALL_STROKE_S)
    for share in (0.1, 0.2, 0.3, 0.4):
        pen.move(0.7 * high * (1 - share), SMALL_STROKE_S)
        pen.move(0.7 * high, SMALL_STROKE_S)
    pen.note("two sines: speed dependence, and a part to judge the law on")
    centre = (low + high) / 2
    pen.move(centre, STROKE_S)
    pen.sweep(0.95 * (high - centre), SWEEP_S)
    pen.hold(0.5)
    force = np.concatenate(pen.pieces)
    return Excitation(time_s=np.arange(len(force), dtype=np.float64) * ROW_S, force_N=force, parts=tuple(pen.parts))
