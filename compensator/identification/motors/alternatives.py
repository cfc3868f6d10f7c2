"""Effects that other numbers stand in for: searched for on their own, and how far they move what is found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.law import MechanismLaw, covariance_of
from tendonff.compensator.identification.parameters import PARTNERS, Parameter
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Solution

N = Parameter

ALTERNATIVES = {N.ADHESION: 0.3, N.RELAXING_SHARE: 0.3}
"""Effects that a slope at zero does not show, since other numbers have taken their place: where a search of its own
starts, in pre-tensions and as a share of the stiffness.
"""

AS_GOOD = 1.92
"""Loss of log-likelihood within which a law is not excluded: half of the 95 % quantile of chi-squared of one number.

A law without one of these effects that loses more is excluded, so the effect is taken up: a higher bar, as for effects
that bias nothing, once left mu theta 41 % off where the truth was worth 2.5.
"""

WIDER = 1.5
"""Factor on a standard error by which an alternative is worth a word."""

STEPS, WORTH_A_STEP = 15, 0.1
"""Evaluations of a search, and log-likelihood that a step must gain for another: an effect that is not there is left by
ever smaller steps.
"""

Tried = tuple[tuple[N, float, bool], ...]
Gained = Mapping[N, tuple[float, bool]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternative:
    """A law with one more effect that explains the logs about as well.

    Attributes
    ----------
    effect : Parameter
    values : mapping
    covariance : ndarray, shape (k, k)
        Of these values, in their order.
    """

    effect: N
    values: Mapping[str, float]
    covariance: Array

    @property
    def acts(self) -> bool:
        """The effect is larger than its standard error; else this is the law without it again."""
        return abs(self.values[self.effect]) > float(np.sqrt(self.among([self.effect])[0, 0]))

    def among(self, names: Sequence[str]) -> Array:
        """Covariance of some of the values, shape (n, n)."""
        own = list(self.values)
        at = [own.index(name) for name in names]
        return np.asarray(self.covariance[np.ix_(at, at)])


def with_alternatives(
    law: MechanismLaw, solution: Solution, tried: Tried, say: Callable[[str], None]
) -> tuple[Solution, Tried, dict[N, Alternative]]:
    """Search with each of these effects from well within its range; one that explains the logs better is taken up.

    Then one of several that were taken up is left out again where it only stood in for another. Also returned are the
    laws that explain the logs about as well, by their effect.
    """
    solution, gained, alternatives = _with_more(law, solution, {n: (gain, taken) for n, gain, taken in tried}, say)
    stand_ins = [n for n in ALTERNATIVES if n in solution.values]
    if len(stand_ins) > 1 and (fewer := _without_stand_in(law, solution, gained, stand_ins, say)) is not None:
        solution, gained, alternatives = _with_more(law, *fewer, say)
    return solution, tuple((n, *each) for n, each in gained.items()), alternatives


def _without_stand_in(
    law: MechanismLaw, solution: Solution, gained: Gained, stand_ins: Sequence[N], say: Callable[[str], None]
) -> tuple[Solution, Gained] | None:
    """The law without one of these effects, if the others do as well."""
    fewer = dict[N, Solution]()
    for number in stand_ins:
        say(f"without {number.spec.effect}")
        left_out = (number, *PARTNERS.get(number, ()))
        values = {n: v for n, v in solution.values.items() if n not in left_out}
        try:
            fewer[number] = law.fit(values, most=2 * STEPS)  # the search with both may have gone astray
        except SolveError:
            continue
    best = min(fewer, key=lambda n: fewer[n].cost, default=None)
    if best is None or (gain := gain_of(fewer[best], solution)) >= TUNED.worth_a_constant:
        return None
    return fewer[best], {**gained, best: (gain, False)}


def started(law: MechanismLaw, values: Mapping[str, float], number: N) -> dict[str, float]:
    """Values from which an effect is searched for."""
    share = ALTERNATIVES[number]
    if number is N.ADHESION:
        return {**values, number: share * values[N.TENSION], N.MU: values[N.MU] / (1 + share)}
    partners: dict[str, float] = {n: n.of(law.mechanism) for n in PARTNERS[number]}
    return {**values, number: share, **partners}


def _with_more(
    law: MechanismLaw, solution: Solution, gained: Gained, say: Callable[[str], None]
) -> tuple[Solution, Gained, dict[N, Alternative]]:
    """The law with those of the missing effects that are worth it, and the alternatives to it."""
    known, found = dict(gained), dict[N, Solution]()
    blocks = len(np.unique(solution.residuals.blocks))
    for number in (n for n in ALTERNATIVES if n not in solution.values):
        say(f"with {number.spec.effect}")
        try:
            found[number] = law.fit(
                started(law, solution.values, number), most=STEPS, tolerance=2 * WORTH_A_STEP / blocks
            )
        except SolveError:
            continue
        known[number] = (gain_of(solution, found[number]), False)
    best = min(found, key=lambda n: found[n].cost, default=None)
    if best is not None and known[best][0] >= AS_GOOD:
        known[best] = (known[best][0], True)
        return _with_more(law, found[best], known, say)
    as_good = {
        n: Alternative(effect=n, values=each.values, covariance=covariance_of(law, each))
        for n, each in found.items()
        if known[n][0] > -AS_GOOD
    }
    return solution, known, as_good


def gain_of(fewer: Solution, more: Solution) -> float:
    """Log-likelihood that a law is better by than another."""
    return len(np.unique(fewer.residuals.blocks)) / 2 * float(np.log(fewer.cost / more.cost))


def spanned(solution: Solution, covariance: Array, alternatives: Sequence[Alternative], before: Solution) -> Array:
    """The covariance whose intervals hold those of the alternatives, found beside the values of `before`.

    An interval ends no nearer than that of an alternative whose effect acts, and no combination of the values is known
    better than under any of these laws; without an effect that acts, intervals reach the other values alone.
    """
    reach = float(student.ppf(0.975, max(solution.degrees, 1)))
    names = list(solution.values)
    least = np.sqrt(np.diag(covariance))
    for alternative in alternatives:
        apart = np.array([alternative.values[name] - before.values[name] for name in names]) / reach
        if alternative.acts:
            own = alternative.among(names)
            covariance = _at_least(covariance, own)
            least = np.maximum(least, np.abs(apart) + np.sqrt(np.diag(own)))
        covariance = covariance + np.outer(apart, apart)
    size = np.sqrt(np.diag(covariance))
    known = np.isfinite(least) & np.isfinite(size) & (size > 0)
    factor = np.ones(len(size))
    factor[known] = np.maximum(least[known] / size[known], 1.0)
    return np.asarray(covariance * np.outer(factor, factor))


def _at_least(covariance: Array, other: Array) -> Array:
    """The first covariance and what the other has more of, in any direction."""
    seen = np.isfinite(np.diag(covariance)) & np.isfinite(np.diag(other)) & (np.diag(covariance) > 0)
    if not seen.any():
        return covariance
    at = np.ix_(seen, seen)
    size = np.sqrt(np.diag(covariance)[seen])
    excess, ways = np.linalg.eigh((other[at] - covariance[at]) / np.outer(size, size))
    wide = covariance.copy()
    wide[at] += (ways * np.maximum(excess, 0.0)) @ ways.T * np.outer(size, size)
    return wide
