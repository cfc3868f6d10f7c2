"""Constants of the law, judged again with the noise of the input taken out of the values.

While noise on the input is taken for friction, whether a rig has load-independent friction is hardly identifiable,
friction that falls with the load looks the same, and an offset of the output cell hides in the two directions'
coefficients. With the input estimated their errors are five to ten times smaller: the law with all of them free is
fitted, and those that are not identifiable are removed again. Where two laws are left, their misfit decides, or both
are answered.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.chain_law import ChosenLaw, candidate, fit_free
from tendonff.compensator.identification.fitting.noisy_input import (
    InputSlopes,
    input_slopes,
    misfit,
    residuals_of,
    with_implied_input,
    with_input_estimated,
)
from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.identification.parameters import BY_TENSIONS, SPEED_TERMS, Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.models.parameters.transmission import LARGEST_EXPONENT
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Residuals, Solution

D = Parameter

_Fitted = tuple[ChainResiduals, Solution]
"""A law's task and its values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondLook:
    """Answer of the second look."""

    law: ChosenLaw
    task: ChainResiduals  # on many masses, with the constants that the data tell
    solution: Solution  # with the input estimated
    other: _Fitted | None = None  # by another dependence on the load, not excluded
    caution: str = ""  # why all stayed as it was; empty where the noise of the input was taken out


def look_again(
    law: ChosenLaw,
    task: ChainResiduals,
    solution: Solution,
    span_N: float,
    *,
    offsets: bool,
    with_granted: Callable[[ChainResiduals, Solution], Solution] = lambda _, solution: solution,
) -> SecondLook:
    """The law with the constants that the data tell, and its values with the input estimated; where that fails all
    stay as they are.

    `with_granted` adds to a solution's errors what is taken for granted; `span_N` is the output tension's range.
    """
    try:
        again = _looked_again(law, task, solution, span_N, offsets, with_granted)
        _check_no_worse((task, solution), (again.task, again.solution))
        return again
    except SolveError as error:
        caution = (
            f"the noise of the input could not be taken out of the values ({error}): load-independent friction may be "
            "too high, and the intervals too narrow; log the input with less noise, or more samples"
        )
        return SecondLook(law=law, task=task, solution=solution, caution=caution)


def _looked_again(
    law: ChosenLaw,
    task: ChainResiduals,
    solution: Solution,
    span_N: float,
    offsets: bool,
    with_granted: Callable[[ChainResiduals, Solution], Solution],
) -> SecondLook:
    proximal = task.pieces[0].explain is Explain.POSITION
    if D.INPUT_BIAS in task.free or all(run.record.input_noise_N <= 0 for run in task.pieces):
        return SecondLook(law=law, task=task, solution=with_input_estimated(task, solution)[0])
    task = replace(task, fixed=task.complete(solution.values))
    constants = [] if D.LOAD_EXPONENT in task.free else [D.ADHESION]  # nearly the same in most data
    offered = [*((D.OUTPUT_BIAS,) if offsets and not proximal else ()), *constants]
    free = (*task.free, *(name for name in offered if name not in task.free))
    wide_fit = with_granted(*_moved(replace(task, free=free), solution, signed=True))
    own, dropped = task.model.values(), set[Parameter]()
    for name, sure in ((D.OUTPUT_BIAS, TUNED.very_sure), (D.ADHESION, TUNED.sure)):
        if name in free and own[name] == 0:
            size = abs(wide_fit.values[name]) if name is D.OUTPUT_BIAS else wide_fit.values[name]
            if not size > sure * wide_fit.standard_error(name):
                wide_fit = _without(wide_fit, name)
                dropped.add(name)
    for name in SPEED_TERMS:  # the coarse chain's long steps imitate them
        if name in free and own[name] == 0 and not wide_fit.values[name] > TUNED.sure * wide_fit.standard_error(name):
            for gone in (name, D.STRIBECK_VELOCITY) if name is D.STATIC_EXCESS else (name,):
                wide_fit = _without(wide_fit, gone, by=wide_fit.values[gone] - own[gone])
                dropped.add(gone)
    chosen, found, slopes = _narrowed(law, task, wide_fit, dropped, span_N)
    if D.OUTPUT_BIAS in chosen.free and own[D.OUTPUT_BIAS] == 0:
        # Its slopes at the start promise more than the misfit holds: the directions' coefficients follow slowly.
        fewer = _narrowed(law, task, _without(wide_fit, D.OUTPUT_BIAS), {*dropped, D.OUTPUT_BIAS}, span_N)
        less, more = _misfits([fewer[:2], (chosen, found)], slopes)
        if not less - more > TUNED.very_sure**2:
            chosen, found, slopes = fewer
    (chosen, found), other = _by_load(chosen, found, slopes)
    return SecondLook(law=_renamed(law, chosen, found), task=chosen, solution=found, other=other)


def _narrowed(
    law: ChosenLaw, task: ChainResiduals, wide_fit: Solution, dropped: set[Parameter], span_N: float
) -> tuple[ChainResiduals, Solution, Sequence[InputSlopes]]:
    """The task without what was dropped, and its values with the input estimated, by slopes over it."""
    own = task.model.values()
    symmetric = task.model.symmetric and _is_symmetric(wide_fit)
    dropped = dropped | ({D.MU_RELEASE} if symmetric else set())
    kept = tuple(D(name) for name in wide_fit.values if name not in dropped)
    chosen = replace(
        task,
        model=replace(task.model, symmetric=symmetric),
        free=kept,
        fixed={**task.fixed, **{name: own[name] for name in dropped - {D.MU_RELEASE}}},
    )
    at = {str(name): float(wide_fit.values[name]) for name in kept}
    if dropped & set(SPEED_TERMS):  # far from nothing, perhaps: the others are searched anew on few masses
        start = {D(name): value for name, value in at.items()}
        quick = replace(law.task, model=replace(law.task.model, symmetric=symmetric), free=kept, fixed=chosen.fixed)
        at = fit_free(quick, {**chosen.fixed, **start}, span_N, 15, 1e-4).values
    return chosen, *with_input_estimated(chosen, replace(wide_fit, values=at, residuals=residuals_of(chosen, at)))


def _by_load(chosen: ChainResiduals, found: Solution, slopes: Sequence[InputSlopes]) -> tuple[_Fitted, _Fitted | None]:
    """The law whose dependence on the load has less misfit, and the other one where the difference is not decisive.

    To the noise of the input, which was in the values, both are nearly the same. Both stick and slide at the same
    times, so they share the slopes over the input.
    """
    rival = _with_other_dependence(chosen, found)
    if rival is None:
        return (chosen, found), None
    try:
        other = _at_its_best(*rival, slopes)
    except SolveError:
        return (chosen, found), None
    mine, its = _misfits([(chosen, found), other], slopes)
    if mine - its > TUNED.decisive:
        return other, None
    constant = next(name for name in (D.ADHESION, D.LOAD_EXPONENT) if name in other[0].free)
    is_close = its - mine <= TUNED.decisive and other[1].values[constant] > 0
    return (chosen, found), other if is_close else None


def _with_other_dependence(chosen: ChainResiduals, found: Solution) -> _Fitted | None:
    """Friction that falls with the load in the place of load-independent friction, or the reverse, and its start.

    Friction at the mean tension, and its slope there, are the same. None without either, and where the scenario states
    one.
    """
    free, own = set(chosen.free), chosen.model.values()
    if (D.ADHESION in free) == (D.LOAD_EXPONENT in free):
        return None
    name, other = (D.ADHESION, D.LOAD_EXPONENT) if D.ADHESION in free else (D.LOAD_EXPONENT, D.ADHESION)
    if own[name] or own[other]:
        return None
    mean_N, value = chosen.model.load_reference_N, found.values[name]
    if name is D.ADHESION:
        share = (mean_N + value) / mean_N
        more = min(value / (mean_N + value), LARGEST_EXPONENT)
    else:
        share = 1 - value
        more = mean_N * value / share
    mus: dict[str, float] = {mu: share * found.values[mu] for mu in (D.MU, D.MU_RELEASE) if mu in free}
    values: dict[str, float] = {**found.values, **mus, other: more}
    kept = tuple(other if each is name else each for each in chosen.free)
    rival = replace(chosen, free=kept, fixed={**chosen.fixed, name: own[name], other: more})
    return rival, replace(found, values={str(each): values[each] for each in kept})


def _at_its_best(task: ChainResiduals, start: Solution, slopes: Sequence[InputSlopes]) -> _Fitted:
    """A law and its values with the input estimated, from the values of a start; slopes over the input are given."""
    start = replace(start, residuals=residuals_of(task, start.values))
    return task, with_input_estimated(task, start, slopes=slopes)[0]


def _moved(task: ChainResiduals, solution: Solution, *, signed: bool = False) -> _Fitted:
    """A task with a coefficient for each direction, and one step from its values with the input estimated."""
    free = task.free if D.MU_RELEASE in task.free else (*task.free, D.MU_RELEASE)
    task = replace(task, model=replace(task.model, symmetric=False), free=free)
    at = {str(name): task.fixed[name] for name in task.free}
    start = replace(solution, values=at, residuals=residuals_of(task, at))
    return task, with_input_estimated(task, start, rounds=1, signed=signed)[0]


def _misfits(laws: Sequence[_Fitted], slopes: Sequence[InputSlopes]) -> list[float]:
    """Misfit of each law with the input that it implies, in one unit."""
    usual = laws[0][0].channel_rms(laws[0][1].residuals)
    return [misfit(task, found, usual, slopes) for task, found in laws]


def _check_no_worse(before: _Fitted, after: _Fitted) -> None:
    """Raise SolveError where a law explains much less than it did.

    Values that are right leave what the noise of the input is rectified to, and others take it for friction: where the
    error grew, both are compared by their errors behind the input that each of them implies, and by their misfit. One
    that is no worse by either is kept: extremes that moved with the input spoil the first, large moves the second.
    """
    both = (before, after)
    sizes = [_size(found.residuals) for _, found in both]
    if sizes[1] > TUNED.nearly_as_good * sizes[0]:
        sizes = [_size(residuals_of(with_implied_input(task, found), found.values)) for task, found in both]
    grown = sizes[1] / max(sizes[0], 1e-300)
    if grown > TUNED.nearly_as_good:
        usual = before[0].channel_rms(before[1].residuals)  # far apart, each with its own slopes
        mine, its = (misfit(task, found, usual, input_slopes(task, found)) for task, found in both)
        if its - mine > TUNED.decisive:
            raise SolveError(f"the error of the law grew by a factor of {grown:.2g}")


def _size(residuals: Residuals) -> float:
    """RMS of the residuals, large ones counted linearly."""
    return float(np.sqrt(np.mean(2 * (np.sqrt(1 + residuals.values**2) - 1))))


def _without(solution: Solution, name: Parameter, by: float | None = None) -> Solution:
    """Values and covariance of the others where one of them is nothing, or less by so much."""
    place, covariance = list(solution.values).index(name), solution.covariance
    share, size = covariance[:, place] / covariance[place, place], solution.values[name] if by is None else by
    values = {
        other: value - float(along) * size for (other, value), along in zip(solution.values.items(), share, strict=True)
    }
    return replace(solution, values=values, covariance=covariance - np.outer(share, covariance[place]))


def _is_symmetric(solution: Solution) -> bool:
    """Whether a single coefficient holds for both directions: their difference is small, and known to be."""
    pull, release = (list(solution.values).index(name) for name in (D.MU, D.MU_RELEASE))
    covariance = solution.covariance
    variance = covariance[pull, pull] + covariance[release, release] - 2 * covariance[pull, release]
    apart = abs(solution.values[D.MU] - solution.values[D.MU_RELEASE])
    deviation = float(np.sqrt(max(variance, 0.0)))
    return bool(apart < TUNED.sure * deviation < TUNED.sure * TUNED.symmetric_share * solution.values[D.MU])


def _renamed(law: ChosenLaw, task: ChainResiduals, solution: Solution) -> ChosenLaw:
    """The chosen law under the name of what it has now, among those that were compared."""
    if set(task.free) == set(law.task.free) and task.model.symmetric == law.task.model.symmetric:
        return law
    name = "symmetric with presliding" if task.model.symmetric else "asymmetric with presliding"
    name += "".join(f", {extra.spec.effect}" for extra in BY_TENSIONS if extra.spec.effect and extra in task.free)
    judge = law.judge and replace(law.judge, model=replace(law.judge.model, symmetric=task.model.symmetric))
    quick = replace(law.task, model=replace(law.task.model, symmetric=task.model.symmetric), free=task.free)
    values = task.complete(solution.values)
    quick = replace(quick, fixed=values)
    found = quick.evaluate({name: values[D(name)] for name in solution.values})
    own = replace(candidate(name, quick, replace(solution, residuals=found), judge), chosen=True)
    others = [replace(one, chosen=False) for one in law.candidates if one.name != name]
    return replace(law, candidates=(*others, own), judge=judge)
