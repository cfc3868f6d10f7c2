"""Which law of the chain the data supports: one coefficient or two, adhesion, offsets, speed terms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.judging import OutputError
from tendonff.compensator.identification.fitting.residuals import ChainResiduals, FitPiece, spans_of
from tendonff.compensator.identification.parameters import CONSTANTS, CORE, SPEED_TERMS, Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.least_squares import Solution, gauss_newton_step, solve

D = Parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCandidate:
    """A candidate law of the chain, fitted, and how it did."""

    name: str
    task: ChainResiduals  # with its free parameters
    solution: Solution
    # fit, validation: where it was fitted, and where it was not
    fit: OutputError
    validation: OutputError
    chosen: bool = False

    @property
    def values(self) -> dict[Parameter, float]:
        """All of them."""
        return self.task.complete(self.solution.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenLaw:
    """The law that was chosen, fitted to all rows on few masses."""

    task: ChainResiduals  # with its free parameters; the others are fixed
    solution: Solution
    candidates: tuple[ChainCandidate, ...]
    judge: (
        ChainResiduals | None
    )  # the rows of validation files; None where parts of the fitted ones are held out in turn


def fit_free(
    task: ChainResiduals, start: Mapping[Parameter, float], span_N: float, most: int, tolerance: float
) -> Solution:
    """Fit the free parameters of a task in at most so many evaluations; `span_N` is the output tension's range."""
    return solve(
        task.evaluate,
        [name.tensions.begun(name, start[name], span_N) for name in task.free],
        most=most,
        tolerance=tolerance,
    )


def candidate(name: str, task: ChainResiduals, solution: Solution, judge: ChainResiduals | None) -> ChainCandidate:
    """A fitted law, with its errors."""
    if judge is None:
        validation = task.held_out(solution)
    else:
        validation = replace(judge, model=task.model).error_at(task.complete(solution.values))
    fit = task.error_of(solution.residuals)
    return ChainCandidate(name=name, task=task, solution=solution, fit=fit, validation=validation)


class _Search:
    """Candidates one after the other, each judged where it was not fitted."""

    def __init__(
        self,
        task: ChainResiduals,
        validation: Sequence[FitPiece],
        start: Mapping[Parameter, float],
        span_N: float,
        mean_N: float,
    ) -> None:
        self.judge = replace(task, pieces=validation) if validation else None
        self.start, self.span_N, self.mean_N = start, span_N, mean_N
        self.candidates: list[ChainCandidate] = []
        self.best = self.attempt(task, task.fixed, "asymmetric with presliding")

    def attempt(self, task: ChainResiduals, at: Mapping[Parameter, float], name: str) -> ChainCandidate:
        solution = fit_free(task, at, self.span_N, 15, 1e-4)
        found = candidate(name, task, solution, self.judge)
        self.candidates.append(found)
        return found

    def is_worse(self, task: ChainResiduals, at: Mapping[Parameter, float], most: float) -> bool:
        """Whether a Gauss-Newton step from a start promises more than a share of the best law's error.

        Where that law leaves much itself, the slopes tell little, and no.
        """
        best = self.best.fit.robust_rms
        if best > TUNED.robust_share * spans_of(task.pieces)[0]:
            return False
        found = task.evaluate({str(name): at[name] for name in task.free})
        left = found.values + found.slopes @ gauss_newton_step(found.values, found.slopes)
        return task.error_of(replace(found, values=left)).robust_rms > most * best

    def with_one_more(self, extra: Parameter) -> tuple[ChainResiduals, dict[Parameter, float]]:
        """The best law with one more free value, and its start; a Stribeck effect comes with its velocity."""
        more = (extra, D.STRIBECK_VELOCITY) if extra is D.STATIC_EXCESS else (extra,)
        known, task = self.best.values, self.best.task
        return replace(task, fixed=known, free=(*task.free, *more)), self._nudged(known, extra)

    def attempt_with(self, extra: Parameter) -> ChainCandidate:
        """Fit the best law with one more free value."""
        return self.attempt(*self.with_one_more(extra), f"{self.best.name}, {extra.spec.effect}")

    def _nudged(self, at: Mapping[Parameter, float], extra: Parameter) -> dict[Parameter, float]:
        """A start that has something of a further effect, the friction at the mean tension being the same."""
        if extra is not D.ADHESION:
            return {**at, extra: at[extra] + extra.tensions.nudge}
        more = float(np.clip(self.start.get(extra, 0.0), extra.tensions.nudge * self.mean_N, 0.1 * self.mean_N))
        share = (self.mean_N + at[extra]) / (self.mean_N + at[extra] + more)
        mus = {name: share * at[name] for name in (D.MU, D.MU_RELEASE)}
        return {**at, extra: at[extra] + more, **mus}

    def gain(self, found: ChainCandidate) -> float:
        """Information that another law gains, or loses, by Bayes' criterion: the price of its values is taken off.

        The sample size counts rows that are independent of each other; fitted and held-out rows count alike.
        """
        task = self.best.task
        rows = task.independent_rows(self.best.solution.residuals)
        fit = self.best.fit.robust_rms / max(found.fit.robust_rms, 1e-300)
        judged = self.best.validation.robust_rms / max(found.validation.robust_rms, 1e-300)
        price = (len(found.task.free) - len(task.free)) * np.log(max(rows, 2.0))
        return float(rows * (np.log(fit) + np.log(judged)) - price)


def choose_law(
    task: ChainResiduals,
    validation: Sequence[FitPiece],
    start: Mapping[Parameter, float],
    span_N: float,
    mean_N: float,
    *,
    biases: bool,
) -> ChosenLaw:
    """Add to the law of a task on few masses, with a coefficient for each direction, what the data supports.

    The rows of `validation` judge, or without them parts of the fitted ones in turn; with `biases` the cells' offsets
    may be free.
    """
    scenario = task.model.values()
    base = tuple(n for n in (D.ADHESION, D.LOAD_EXPONENT, D.STATIC_EXCESS) if scenario[n] > 0)
    if D.STATIC_EXCESS in base:
        base = (*base, D.STRIBECK_VELOCITY)
    extras = (*CONSTANTS, D.LOAD_EXPONENT, *SPEED_TERMS, D.STRIBECK_VELOCITY)
    fixed: dict[Parameter, float] = {**task.fixed, **{n: scenario[n] for n in extras}}
    model = replace(task.model, load_reference_N=float(f"{mean_N:.3g}"))
    task = replace(task, model=model, fixed=fixed, free=(*task.free, *base))
    search = _Search(task, validation, start, span_N, mean_N)
    # From one end alone a wrong symmetry is made up for by the tendon's stiffness, and hard to see afterwards.
    if task.pieces[0].explain is not Explain.POSITION:
        same = replace(
            search.best.task,
            model=replace(task.model, symmetric=True),
            free=tuple(n for n in task.free if n is not D.MU_RELEASE),
        )
        least = TUNED.simpler_within * search.best.validation.robust_rms
        found = search.attempt(same, search.best.values, "symmetric with presliding")
        if found.validation.robust_rms <= least and search.gain(found) > 0:
            search.best = found
    constants = CONSTANTS if biases else (D.ADHESION,)
    _add_constants(search, constants)
    if _try_load_exponent(search, scenario):
        _add_constants(search, constants)
    before = search.best
    for extra in SPEED_TERMS:
        if extra not in search.best.task.free:
            _try_speed_term(search, extra)
    if search.best is not before:  # friction that depends on speed may have hidden that which does not
        _add_constants(search, constants)
    best = search.best
    chosen = replace(task, model=best.task.model, free=best.task.free, fixed=best.values)
    solution = fit_free(chosen, chosen.fixed, span_N, 20, 1e-4)
    for _ in range(2):
        poor: list[Parameter] = [
            n
            for n in chosen.free
            if n not in (*CORE, *CONSTANTS, D.STRIBECK_VELOCITY)
            and not TUNED.sure * solution.standard_error(n) < abs(solution.values[n])
        ]
        if not poor:
            break
        if D.STATIC_EXCESS in poor and D.STRIBECK_VELOCITY in chosen.free:
            poor.append(D.STRIBECK_VELOCITY)
        known = chosen.complete(solution.values)
        known.update({n: scenario[n] for n in poor})
        chosen = replace(chosen, fixed=known, free=tuple(n for n in chosen.free if n not in poor))
        solution = fit_free(chosen, known, span_N, 20, 1e-4)
    same_law = (
        law.name for law in search.candidates if law.task.free == chosen.free and law.task.model == chosen.model
    )
    name = next(same_law, best.name)  # without the terms that were taken out again
    candidates = tuple(replace(law, chosen=law.name == name) for law in search.candidates)
    judge = search.judge and replace(search.judge, model=chosen.model)
    return ChosenLaw(task=chosen, solution=solution, candidates=candidates, judge=judge)


def _add_constants(search: _Search, offered: Sequence[Parameter]) -> None:
    """Adhesion and offsets, the most useful first; two at most, for a third acts like the two together."""
    for _ in range(min(2, len(offered))):
        tried = [search.attempt_with(extra) for extra in offered if extra not in search.best.task.free]
        useful = [found for found in tried if search.gain(found) > TUNED.worth_a_constant]
        if not useful:
            return
        search.best = max(useful, key=search.gain)


def _try_load_exponent(search: _Search, scenario: Mapping[Parameter, float]) -> bool:
    """Friction that falls with the load in the place of adhesion and offsets, as which it is read otherwise."""
    best, exponent = search.best, D.LOAD_EXPONENT
    constants = [n for n in CONSTANTS if n in best.task.free]
    if D.LOAD_EXPONENT in best.task.free or not constants:
        return False
    known = {**best.values, **{n: scenario[n] for n in constants}}
    # The friction at the mean tension stays the same.
    more = (search.mean_N + best.values[D.ADHESION]) / (search.mean_N + known[D.ADHESION])
    start = {**known, **{n: more * known[n] for n in (D.MU, D.MU_RELEASE)}, exponent: exponent.tensions.nudge}
    free = (*(n for n in best.task.free if n not in constants), D.LOAD_EXPONENT)
    name, task = f"{best.name.partition(',')[0]}, {exponent.spec.effect}", replace(best.task, free=free, fixed=start)
    if search.is_worse(task, start, TUNED.slightly):
        return False
    found = search.attempt(task, start, name)
    certain = found.solution.values[D.LOAD_EXPONENT] > TUNED.sure * found.solution.standard_error(D.LOAD_EXPONENT)
    better = found.fit.robust_rms < best.fit.robust_rms  # a delay that is still in the log bends held-out parts alone
    if not (certain and better and search.gain(found) > TUNED.worth_a_constant):
        return False
    search.best = found
    return True


def _try_speed_term(search: _Search, extra: Parameter) -> None:
    best = search.best
    # Other files may be faster than those that were fitted.
    if search.judge is None and search.is_worse(*search.with_one_more(extra), 1 / TUNED.slightly):
        return
    found = search.attempt_with(extra)
    before, after = best.validation.robust_rms, found.validation.robust_rms
    fits_better = TUNED.nearly_as_good * found.fit.robust_rms < best.fit.robust_rms
    better = TUNED.nearly_as_good * after < before or (fits_better and TUNED.slightly * after < before)
    if better and _is_plausible(found, extra):
        search.best = found


def _is_plausible(found: ChainCandidate, extra: Parameter) -> bool:
    """The data tell the values of a term that depends on speed, and visit the speeds that it is about."""
    solution = found.solution
    if not solution.values[extra] > TUNED.sure * solution.standard_error(extra):
        return False
    if extra is not D.STATIC_EXCESS:
        return True
    velocity = solution.values[D.STRIBECK_VELOCITY]
    # Searched by its logarithm: an error as large as the value leaves every size open.
    if not velocity > TUNED.sure * solution.standard_error(D.STRIBECK_VELOCITY):
        return False
    slowest, fastest = visited_speeds_m_per_s(found.task, found.values)
    return slowest <= velocity <= fastest


def visited_speeds_m_per_s(task: ChainResiduals, values: Mapping[Parameter, float]) -> tuple[float, float]:
    """Slow and fast end of the speeds at which the tendon's near end moves [m/s]."""
    positions = ((task.model.predict(values, run.drive).near_m, run.record.step_s) for run in task.pieces)
    every = np.concatenate([np.abs(np.gradient(position, step_s)) for position, step_s in positions])
    slowest, fastest = np.percentile(every[every > 0], TUNED.visited_percentiles)
    return float(slowest), float(fastest)
