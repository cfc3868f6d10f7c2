"""Intervals of a fit as the uncertainty that a design from it reckons with: the table [robust.spread]."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.uncertain import ASSUMED, TWO_SIDED
from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.parameters import BY_TENSIONS, MU, MU_RELEASE, Parameter
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters.numbers import number_of
from tendonff.models.parameters.transmission import Transmission
from tendonff.models.parameters.uncertainty import Correlation, OtherLaw, Spread

LEAST = 1e-4
"""Least half-width that is written: no rig is known better."""

_FACTORS = {"mu": MU, "stiffness": Parameter.STIFFNESS, "bristle_stiffness": Parameter.BRISTLE}
"""Keys of [robust] that an identified value supersedes."""

_OF_FRICTION = tuple(
    f"friction.{name}"
    for name in (
        "mu_dynamic",
        "mu_dynamic_release",
        "adhesion_N",
        "load_exponent",
        "reference_tension_N",
        "soft_bristle_stiffness_N_per_m",
    )
)
"""Keys of a law of friction that may be another one."""


def with_spread(
    scenario: Scenario, estimates: Sequence[Estimate], names: Sequence[str], matrix: Array, noise: Array
) -> Scenario:
    """The scenario with the interval of every identified value, and their correlation: `matrix`, of the values `names`.

    `noise` is the part of the correlation that is no doubt about the law.

    Coefficients of both directions that are one value, or known only together, vary together. Friction that is not
    identified has the width that the scenario states or, where it states none, the one that a design assumes: beside
    intervals of other values it would count as known exactly.
    """
    found = {
        e.name: (e, Parameter(e.name).spec.key)
        for e in estimates
        if e.name in BY_TENSIONS and Parameter(e.name).spec.key and e.fitted and e.interval is not None
    }
    spreads, done = list[Spread](), set[str]()
    if MU in found and MU_RELEASE in found and _go_together(names, matrix):
        keys = tuple(found[name][1] for name in (MU, MU_RELEASE))
        widths = [w for name in (MU, MU_RELEASE) if (w := _half_width(found[name][0])) is not None]
        if len(widths) == len(keys):
            spreads.append(Spread(keys=keys, half_width=max(widths)))
            done |= {MU, MU_RELEASE}
    for name, (estimate, key) in found.items():
        if name not in done and estimate.interval is not None:
            width = _half_width(estimate)
            low, high = max(estimate.interval[0], 0.0), estimate.interval[1]
            if not Parameter(name).tensions.may_vanish and high > 0:
                low = max(low, estimate.value**2 / high)  # as many times less as it may be more
            if width is not None:
                spreads.append(Spread(keys=(key,), half_width=width))
            elif low < high:
                spreads.append(Spread(keys=(key,), low=low, high=high))
    taken = {key for spread in spreads for key in spread.keys}
    others = tuple(spread for spread in scenario.robust.spread if not taken & set(spread.keys))
    known: dict[str, Any] = {factor: 0.0 for factor, name in _FACTORS.items() if name in found}
    if spreads or not scenario.robust.is_certain:
        covered = taken | {key for spread in others for key in spread.keys}
        kept, known["mu"] = _of_kept_friction(scenario, taken, covered)
        spreads += kept
    robust = replace(scenario.robust, spread=(*others, *spreads), correlation=None, other_law=None, **known)
    errors = {key: _error(estimate) for estimate, key in found.values()}
    return replace(scenario, robust=replace(robust, correlation=_correlation(spreads, names, matrix, noise, errors)))


def with_other_law(scenario: Scenario, other: Transmission | None) -> Scenario:
    """The scenario with the friction of another fitted transmission that the data do not exclude, if there is one."""
    if other is None:
        return scenario
    numbers = {key: number_of(other, key) for key in _OF_FRICTION}
    numbers["friction.load_exponent"] = numbers["friction.load_exponent"] or 0.0
    given = {key: value for key, value in numbers.items() if value is not None}
    law = OtherLaw(keys=tuple(given), values=tuple(float(f"{value:.6g}") for value in given.values()))
    return replace(scenario, robust=replace(scenario.robust, other_law=law))


def _correlation(
    spreads: Sequence[Spread], names: Sequence[str], matrix: Array, noise: Array, errors: Mapping[str, float]
) -> Correlation | None:
    """Correlation of the intervals that a fit has; an interval that is cut off at nothing goes by itself.

    `errors` are the standard errors by key, in those of the normal distribution that has the interval.
    """
    place = {Parameter(name).spec.key: k for k, name in enumerate(names) if name in BY_TENSIONS}
    kept = [spread for spread in spreads if spread.keys[0] in place and spread.half_width is not None]
    if len(kept) < 2:
        return None
    at = [place[spread.keys[0]] for spread in kept]
    own = np.array([errors[spread.keys[0]] for spread in kept])
    both = matrix[np.ix_(at, at)], noise[np.ix_(at, at)] * np.outer(own, own)
    rows, by_noise = (tuple(map(tuple, np.round(each, 3).tolist())) for each in both)
    return Correlation(keys=tuple(spread.name for spread in kept), rows=rows, noise=by_noise)


def _of_kept_friction(scenario: Scenario, taken: set[str], covered: set[str]) -> tuple[list[Spread], float]:
    """Widths of coefficients that are not identified, as intervals of their own, and as the factor `mu` of all.

    Identified keys are `taken`; `covered` are those too that the scenario gives an interval.
    """
    friction, width = scenario.transmission.friction, scenario.robust.mu or ASSUMED.mu
    keys = [Parameter(name).spec.key for name in (MU, MU_RELEASE)][: 1 if friction.mu_dynamic_release is None else 2]
    alone = taken & set(keys) or (covered & set(keys) and not scenario.robust.mu)
    if not alone:
        return [], width
    kept = [key for key in keys if key not in covered and number_of(scenario.transmission, key)]
    return [Spread(keys=(key,), half_width=width) for key in kept], 0.0


def _error(estimate: Estimate) -> float:
    """Standard error over that of the normal distribution that has the interval; the interval is one of Student's t."""
    if estimate.interval is None or not estimate.standard_error:
        return 1.0
    return min(2 * TWO_SIDED * estimate.standard_error / (estimate.interval[1] - estimate.interval[0]), 1.0)


def _half_width(estimate: Estimate) -> float | None:
    """Half of the interval over the value, rounded up; None where that is no share below 1."""
    if estimate.interval is None or estimate.value <= 0:
        return None
    width = float(f"{max((estimate.interval[1] - estimate.interval[0]) / 2 / estimate.value, LEAST):.3g}")
    return width if width < 1 else None


def _go_together(names: Sequence[str], matrix: Array) -> bool:
    if MU_RELEASE not in names or MU not in names:
        return True  # one coefficient for both
    return bool(matrix[list(names).index(MU), list(names).index(MU_RELEASE)] > TUNED.twins)
