"""Result of the design of a feedback."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.unit import Unit

if TYPE_CHECKING:
    from tendonff.ocp.feedback.design import LoopDesign

CASES = ("feedforward", "feedback", "both")
"""Compared cases: the exact inverse alone, plain feedback of the same gains without friction model, and both."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CaseErrors:
    """Errors of one case over the mechanisms that may be the real one, in the unit of the goal.

    Attributes
    ----------
    rms, peak : ndarray, shape (mechanisms, goals)
        Infinite where the simulation failed.
    worst : ndarray, shape (rows, goals)
        Course of the error on the mechanism with the largest RMS error.
    """

    rms: FloatArray
    peak: FloatArray
    worst: FloatArray

    @property
    def worst_rms(self) -> float:
        """Largest RMS error [unit of the goal]."""
        return float(self.rms.max())

    @property
    def worst_peak(self) -> float:
        """Largest error [unit of the goal]."""
        return float(self.peak.max())


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCycle:
    """Behaviour of the loops under a constant reference, on a plant that is further off than stated.

    Attributes
    ----------
    friction, delay : float
        Factors on the coefficients of friction and on the delay of the measurement [-].
    swing : float
        Peak to peak of the output [unit of the goal].
    hunts : bool
        It does not die out.
    """

    friction: float
    delay: float
    swing: float
    hunts: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FeedbackResult:
    """A feedback, and what it does beside the feedforward.

    Attributes
    ----------
    names : tuple of str
        Of the goals.
    unit : Unit
    seen_unit, command_unit : str
        Of what the loops compare, and of the corrections.
    design : LoopDesign
    cases : dict of str to CaseErrors
        By the names of `CASES`.
    cycles : tuple of LimitCycle
    time_s : ndarray, shape (rows,)
        Of the errors [s].
    reductions : int
        How often the gains were lowered because loops hunted in simulation.
    doubt : str
        Uncertainty of the mechanisms, in words.
    """

    names: tuple[str, ...]
    unit: Unit
    seen_unit: str
    command_unit: str
    design: "LoopDesign"
    cases: dict[str, CaseErrors]
    cycles: tuple[LimitCycle, ...]
    time_s: FloatArray
    reductions: int
    doubt: str

    @property
    def hunts(self) -> bool:
        """Whether any loop hunts still."""
        return any(cycle.hunts for cycle in self.cycles)

    def text(self, value: float) -> str:
        """A value in the unit that is shown."""
        return f"{self.unit.factor * value:.2g} {self.unit.shown}"

    @property
    def bound(self) -> str:
        """Bounds of the gains, in words."""
        design = self.design
        law, margins = design.laws[0], min(design.margins, key=lambda each: each.gain)
        times = [
            f"{1e3 * law.delay_s:.3g} ms of delay" if law.delay_s else "",
            f"samples of {1e3 * law.sample_s:.3g} ms",
        ]
        times += [f"{1e3 * law.lag_s:.3g} ms of lag of the drive" if law.lag_s else ""]
        found = ", ".join(each for each in times if each)
        if np.isfinite(margins.gain):
            return (
                f"bounded by {found}: at {margins.gain:.2g} times the gain it oscillates at "
                f"{margins.oscillation_Hz:.2g} Hz"
            )
        return f"bounded by {found}"

    @property
    def sentence(self) -> str:
        """Benefit of the feedback, and its bounds."""
        both, alone = self.cases["both"], self.cases["feedforward"]
        return (
            f"Feedback beside the feedforward: worst RMS error {self.text(both.worst_rms)} (feedforward alone "
            f"{self.text(alone.worst_rms)}, feedback alone {self.text(self.cases['feedback'].worst_rms)}), peak "
            f"{self.text(both.worst_peak)} ({self.text(alone.worst_peak)}), {self.doubt}; {self.bound}."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user."""
        found, design = [], self.design
        if self.hunts:
            worst = max(self.cycles, key=lambda cycle: cycle.swing)
            found.append(
                f"[feedback] the loop hunts with friction times {worst.friction:g} and delay times {worst.delay:g}: "
                f"{self.text(worst.swing)} peak to peak; raise gain_margin, or measure with less delay"
            )
        if design.least_damping > 0:
            found.append(
                "[feedback] a resonance has hardly any damping but that of friction, which no linearisation shows; "
                f"margins count {100 * design.least_damping:g} % of critical damping: trust the simulations, or add "
                "damping"
            )
        if design.growing:
            found.append(
                f"[feedback] {len(design.growing)} of {len(design.growing) + len(design.plants)} linearisations are "
                "unstable without feedback, so margins do not apply there; the simulations include them"
            )
        if self.cases["both"].worst_rms > self.cases["feedforward"].worst_rms:
            found.append("[feedback] it makes the worst error larger here: leave it out")
        return tuple(found)


def feedback_summary(result: FeedbackResult) -> dict[str, object]:
    """The entry `feedback` of `summary.json`; numbers of several goals by their names."""
    laws, margins = result.design.laws, result.design.margins

    def each(values: list[float]) -> object:
        finite = [value if np.isfinite(value) else None for value in values]
        return finite[0] if len(finite) == 1 else dict(zip(result.names, finite, strict=True))

    return {
        "proportional": each([law.proportional for law in laws]),
        "integral_per_s": each([law.integral_per_s for law in laws]),
        "clamp": each([law.clamp for law in laws]),
        "filter_s": each([law.filter_s for law in laws]),
        "gain_margin": each([margin.gain for margin in margins]),
        "phase_margin_deg": each([margin.phase_deg for margin in margins]),
        "unit": result.unit.key,
        "seen_unit": result.seen_unit,
        "command_unit": result.command_unit,
        "rmse": {name: result.cases[name].worst_rms for name in CASES},
        "peak": {name: result.cases[name].worst_peak for name in CASES},
        "limit_cycles": [
            {
                "friction": c.friction,
                "delay": c.delay,
                "swing": c.swing if np.isfinite(c.swing) else None,
                "hunts": c.hunts,
            }
            for c in result.cycles
        ],
    }
