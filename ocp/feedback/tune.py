"""Gains of loops: as high as margins allow over all branches of the plant, in the ratio with the least error."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.ocp.feedback.law import FeedbackLaw
from tendonff.ocp.feedback.linear import Branch, Complex
from tendonff.ocp.feedback.requirement import Requirement
from tendonff.ocp.mechanism.problem import Array

_RATES, _FASTEST = 5, 6.0
"""Number of Ki/Kp to try, from one turn of phase in the whole motion up to so many times the inverse of all delays and
lags, the filter's included."""
_FILTERS = (0.0, 0.5, 2.5)
"""Time constants of the filter to try, over all other delays and lags [-]."""
_WORTH_A_FILTER = 0.95  # of the error without one, below which a filter helps
_ROUNDING = 1.001  # of the gain
_ROUNDS = 8  # of the gain's reduction where loops disturb each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Margins of one branch.

    Attributes
    ----------
    gain : float
        Factor on the gain up to instability [-]; infinite where there is none.
    phase_deg : float
        Smallest angle to −180° where the loop's gain is 1 [deg]; infinite where it never is.
    oscillation_Hz : float
        Frequency of the oscillation at the gain margin; NaN where there is none.
    crossover_Hz : float
        Frequency of the phase margin; NaN where there is none.
    """

    gain: float
    phase_deg: float
    oscillation_Hz: float
    crossover_Hz: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """A branch on its grid of frequencies.

    Attributes
    ----------
    branch : Branch
    rad_per_s : ndarray, shape (n,)
    plant : ndarray, shape (n, goals, goals)
        Measurements over held corrections.
    """

    branch: Branch
    rad_per_s: Array
    plant: Complex

    @classmethod
    def of(cls, branch: Branch, sample_s: float, delay_s: float) -> "Sampled":
        """A branch sampled, with all delays of its loop."""
        grid = branch.frequencies(sample_s)
        return cls(branch=branch, rad_per_s=grid, plant=branch.response(grid, sample_s, delay_s))

    def opened(self, laws: Sequence[FeedbackLaw], goal: int) -> Complex:
        """Gain of one loop, opened while the others are closed, shape (n,)."""
        own = controller_response(laws[goal], self.rad_per_s)
        others = [k for k in range(len(laws)) if k != goal]
        seen = self.plant[:, goal, goal]
        if others:
            act = np.stack([controller_response(laws[k], self.rad_per_s) for k in others], axis=1)
            among = self.plant[:, others][:, :, others] * act[:, None, :]
            answer = np.linalg.solve(np.eye(len(others)) + among, self.plant[:, others, goal][:, :, None])[:, :, 0]
            seen = seen - np.einsum("wk,wk,wk->w", self.plant[:, goal][:, others], act, answer)
        found: Complex = own * seen
        return found


def controller_response(law: FeedbackLaw, rad_per_s: Array) -> Complex:
    """Correction over error between two samples, shape (n,), without deadband and clamp."""
    z = np.exp(1j * np.asarray(rad_per_s) * law.sample_s)
    share = law.filter_share
    integral = law.integral_per_s * law.sample_s * z / (z - 1)
    found: Complex = (law.proportional + integral) * share / (1 - (1 - share) / z)
    return found


def margins_of(rad_per_s: Array, opened: Complex) -> Margins:
    """Margins of an open loop between samples, by python-control."""
    import control  # takes a second to load, for those alone who ask for feedback

    system = control.FrequencyResponseData(opened, rad_per_s, smooth=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it divides by zero where a loop has no crossing
        gains, phases, _, at_gain, at_phase, _ = control.stability_margins(system, returnall=True)
    gains, phases, at_gain, at_phase = (np.atleast_1d(each) for each in (gains, phases, at_gain, at_phase))
    least = int(np.argmin(gains)) if len(gains) else -1
    nearest = int(np.argmin(np.abs(phases))) if len(phases) else -1
    return Margins(
        gain=float(gains[least]) if least >= 0 else math.inf,
        phase_deg=float(np.abs(phases[nearest])) if nearest >= 0 else math.inf,
        oscillation_Hz=float(at_gain[least]) / math.tau if least >= 0 else math.nan,
        crossover_Hz=float(at_phase[nearest]) / math.tau if nearest >= 0 else math.nan,
    )


def worst_margins(plants: Sequence[Sampled], laws: Sequence[FeedbackLaw]) -> tuple[Margins, ...]:
    """Least margins of each loop over all branches, the others closed."""
    found = []
    for goal in range(len(laws)):
        loops = [(plant.rad_per_s, plant.opened(laws, goal)) for plant in plants]
        gain = margins_of(*max(loops, key=lambda loop: _at_180_deg(loop[1])))
        phase = margins_of(*min(loops, key=lambda loop: _nearest_deg(loop[1])))
        found.append(replace(gain, phase_deg=phase.phase_deg, crossover_Hz=phase.crossover_Hz))
    return tuple(found)


def excess(opened: Complex, requirement: Requirement) -> float:
    """Factor by which a loop's gain is above what its margins allow [-]; 1 where it is as high as it may be.

    Within the phase margin of −180° the gain is kept below 1, at −180° below the inverse of the gain margin.
    """
    size, off = np.abs(opened), np.abs(np.angle(-opened, deg=True))
    near = size[off < requirement.phase_margin_deg]
    return max(float(near.max(initial=0.0)), requirement.gain_margin * _at_180_deg(opened))


def _at_180_deg(opened: Complex) -> float:
    """Largest gain of a loop at −180° [-]; 0 where it never is there."""
    real, imag = opened.real, opened.imag
    crossing = (imag[:-1] * imag[1:] < 0) & (real[:-1] + real[1:] < 0)
    share = imag[:-1] / np.where(crossing, imag[:-1] - imag[1:], 1.0)
    at = np.abs(real[:-1] + share * (real[1:] - real[:-1]))[crossing]
    return float(at.max(initial=0.0))


def _nearest_deg(opened: Complex) -> float:
    """Smallest angle to −180° where a loop's gain crosses 1 [deg]; infinite where it never does."""
    size, off = np.abs(opened), np.abs(np.angle(-opened, deg=True))
    crossing = (size[:-1] - 1) * (size[1:] - 1) < 0
    share = (1 - size[:-1]) / np.where(crossing, size[1:] - size[:-1], 1.0)
    at = (off[:-1] + share * (off[1:] - off[:-1]))[crossing]
    return float(at.min(initial=math.inf))


def as_high_as_allowed(
    plants: Sequence[Sampled], laws: Sequence[FeedbackLaw], requirement: Requirement
) -> tuple[FeedbackLaw, ...] | None:
    """Laws with their gains scaled, each alone and then all together, until every branch just has its margins.

    None where no gain has them.
    """
    alone = []
    for goal, law in enumerate(laws):
        worst = max(
            excess(each.plant[:, goal, goal] * controller_response(law, each.rad_per_s), requirement) for each in plants
        )
        if worst == 0:
            return None  # nothing bounds the gain: there is no loop
        alone.append(law.scaled(1 / worst))
    if len(laws) == 1:
        return tuple(alone)
    for _ in range(_ROUNDS):
        worst = max(excess(each.opened(alone, goal), requirement) for each in plants for goal in range(len(laws)))
        if worst <= _ROUNDING:
            return tuple(alone)
        alone = [law.scaled(1 / worst) for law in alone]
    return None


def tune(
    plants: Sequence[Sampled],
    laws: Sequence[FeedbackLaw],
    requirement: Requirement,
    lag_s: float,
    duration_s: float,
    cost: Callable[[tuple[FeedbackLaw, ...]], float],
) -> tuple[float, tuple[FeedbackLaw, ...]] | None:
    """Gains and filter of all loops with the least cost, and that, within the margins; None where no gain keeps them.

    Parameters
    ----------
    plants : sequence of Sampled
        All branches of all mechanisms that may be the real one.
    laws : sequence of FeedbackLaw
        One for each goal; all but their gains and filter are kept.
    requirement : Requirement
    lag_s : float
        All delays and lags of the loop [s], which set what to try.
    duration_s : float
        Of the motion [s].
    cost : callable
        Of laws to compare.
    """
    best: tuple[float, tuple[FeedbackLaw, ...]] | None = None
    for filter_s in (share * lag_s for share in _FILTERS):
        fastest = _FASTEST / (lag_s + filter_s)
        for rate in np.geomspace(min(math.tau / duration_s, fastest), fastest, _RATES).tolist():
            shapes = [replace(law, proportional=1.0, integral_per_s=rate, filter_s=filter_s) for law in laws]
            if (found := as_high_as_allowed(plants, shapes, requirement)) is None:
                continue
            costs = cost(found)
            worth = 1.0 if best is None or best[1][0].filter_s == filter_s else _WORTH_A_FILTER
            if best is None or costs < worth * best[0]:
                best = costs, found
    return best
