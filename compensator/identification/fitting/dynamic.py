"""Stage (c): the whole chain against the measurement, from coarse to fine, and which of its laws the data supports."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals, FitPiece, fit_pieces, spans_of
from tendonff.compensator.identification.fitting.static import SIMPLER_WITHIN, FileError
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.smoothing import low_pass
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.chain import ChainModel, DynamicParameter
from tendonff.ocp.fits.least_squares import Solution, Unknown, block_covariance, solve

D = DynamicParameter

COARSE_MASSES, COARSE_STEP_S = 8, 2e-3
FINE_MASSES, FINE_STEP_S = 30, 1e-3
ROBUST_UNIT = 0.02
BRISTLE_STARTS = (0.1, 1.0, 10.0)
IDENTIFIABLE = 0.5
"""A positive value counts as identified when its standard error is below this share of it."""

DYNAMIC_BLOCKS = 12
"""Blocks of rows that are taken as independent: long, for friction carries an error on until the next sweep."""

REPLICAS = 8
"""Runs with more noise on the input, for what its noise does to the answer."""

TENDON = (D.STIFFNESS, D.RELAXING, D.RELAXATION_TIME)
CORE = (D.MU_PULL, D.MU_RELEASE, D.BRISTLE)
EXTRAS = (D.ADHESION, D.STATIC_EXCESS, D.VISCOUS)
NUDGES = {D.ADHESION: 0.01, D.STATIC_EXCESS: 0.02}
LAW_NAMES = {
    D.ADHESION: "adhesion",
    D.STATIC_EXCESS: "Stribeck effect",
    D.VISCOUS: "viscous friction",
    D.INPUT_BIAS: "input bias",
}
WORTH_A_VALUE, SLIGHTLY = 1.4, 1.1
"""A further value is worth having where it lowers the validation error by the first factor, or by the second where it
lowers the fit error by the first ..."""

SURE_OF_EXTRA, WORTH_A_DOUBT = 4.0, 1.8
"""... and is this many standard errors away from nothing, for noise on the input imitates such effects; or where it
lowers the error by more than that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCandidate:
    """A candidate law of the chain, and how it did.

    Parameters
    ----------
    name : str
    size : int
        Number of free values.
    fit_rms_N, validation_rms_N : float
        Robust error of the output where it was fitted, and where it was not.
    chosen : bool
    """

    name: str
    size: int
    fit_rms_N: float
    validation_rms_N: float
    chosen: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicFit:
    """The chain, fitted.

    Parameters
    ----------
    model : ChainModel
    values : dict of DynamicParameter to float
        All of them; what was not free has the value it was given.
    solution : Solution
        Of the free ones, with the input's noise in its covariance.
    expected : dict of DynamicParameter to float
        Standard error that each parameter would have if it were free as well; infinite where the data is blind.
    laws : tuple of ChainCandidate
        The laws that were compared.
    """

    model: ChainModel
    values: dict[DynamicParameter, float]
    solution: Solution
    expected: dict[DynamicParameter, float]
    laws: tuple[ChainCandidate, ...]


def _unknown(name: DynamicParameter, start: float, span_N: float) -> Unknown:
    """Bounds and search scale of one parameter."""
    if name is D.STATIC_EXCESS:
        return Unknown(name=name, start=start, low=0, high=3, scale=0.1)
    if name is D.ADHESION:
        return Unknown(name=name, start=start, low=0, high=20 * span_N, scale=0.05 * span_N)
    if name in (D.INPUT_BIAS, D.OUTPUT_BIAS):
        return Unknown(name=name, start=start, low=-span_N, high=span_N, scale=0.05 * span_N)
    if name is D.VISCOUS:
        return Unknown(name=name, start=start, low=0, high=1e6, scale=max(start, 1.0))
    factor = 20.0 if name in (D.MU_PULL, D.MU_RELEASE) else 1e3
    safe = max(start, 1e-9)
    scale = 0.2 if name in (D.MU_PULL, D.MU_RELEASE, D.STIFFNESS) else 0.7
    return Unknown(name=name, start=safe, low=safe / factor, high=safe * factor, scale=scale, logarithmic=True)


def _solve(
    task: ChainResiduals, start: Mapping[DynamicParameter, float], span_N: float, most: int, tolerance: float
) -> Solution:
    unknowns = [_unknown(name, start[name], span_N) for name in task.free]
    return solve(task.evaluate, unknowns, most=most, tolerance=tolerance)


def relevant_size(name: DynamicParameter, value: float, mean_N: float) -> float:
    """Size that a parameter's standard error is judged against.

    Parameters
    ----------
    name : DynamicParameter
    value : float
    mean_N : float
        Mean output tension.
    """
    if name in (D.ADHESION, D.INPUT_BIAS, D.OUTPUT_BIAS):
        return 0.05 * mean_N
    if name is D.STATIC_EXCESS:
        return 0.2
    return abs(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseFit:
    """A first fit on few masses: where the other stages start, and whether the chain describes the data at all.

    Parameters
    ----------
    task : ChainResiduals
    solution : Solution
    percent : float
        Robust error of the output in percent of its range.
    """

    task: ChainResiduals
    solution: Solution
    percent: float


def fit_coarse(
    records: Sequence[Record], transmission: Transmission, start: Mapping[DynamicParameter, float]
) -> CoarseFit:
    """Fit friction and presliding, and the tendon where positions exist, from several stiffnesses of the bristle.

    Parameters
    ----------
    records : sequence of Record
    transmission : Transmission
    start : mapping of DynamicParameter to float
        From the stages before; the rest comes from `transmission`.
    """
    runs = fit_pieces(records)
    span_N, span_m = spans_of(runs)
    model = ChainModel(
        transmission=transmission, level=Level.PRESLIDING, count=COARSE_MASSES, longest_step_s=COARSE_STEP_S
    )
    known = {**model.values(), **{n: v for n, v in start.items() if n not in EXTRAS}}
    seconds = sum(float(np.ptp(r.piece.time_s)) for r in runs)
    task = ChainResiduals(
        model=model,
        runs=runs,
        fixed=known,
        free=CORE + (TENDON if all(r.with_elongation for r in runs) else ()),
        output_unit_N=ROBUST_UNIT * span_N,
        elongation_unit_m=ROBUST_UNIT * span_m,
        block_s=float(np.clip(seconds / DYNAMIC_BLOCKS, 0.1, 10.0)),
    )
    starts = [{**known, D.BRISTLE: factor * known[D.BRISTLE]} for factor in BRISTLE_STARTS]
    first = min((_solve(task, at, span_N, 5, 1e-3) for at in starts), key=lambda s: s.cost)
    solution = _solve(task, task.complete(first.values), span_N, 10, 1e-3)
    percent = 100 * task.robust_rms_N(task.complete(solution.values)) / span_N
    return CoarseFit(task=task, solution=solution, percent=percent)


def fit_dynamic(
    coarse: CoarseFit,
    start: Mapping[DynamicParameter, float],
    *,
    validation: Sequence[Record] = (),
    biases: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> DynamicFit:
    """Choose the law, then fit the chain at its presliding level, from coarse to fine.

    Parameters
    ----------
    coarse : CoarseFit
    start : mapping of DynamicParameter to float
        From the stages before.
    validation : sequence of Record, optional
        Files that decide which law is chosen; without them the last third of the fitted ones does.
    biases : bool, optional
        The input cell's bias may be free.
    say : callable, optional
        Told what is being done.
    """
    task, best = coarse.task, coarse.solution
    runs, transmission = task.runs, task.model.transmission
    span_N, _ = spans_of(runs)
    known = task.complete(best.values)
    mean_N = float(np.mean(np.concatenate([r.piece.output_N for r in runs])))
    # Now units of the size of the residuals, which decides how much each channel counts.
    output_unit, elongation_unit = task.channel_rms(best.residuals)
    task = replace(task, fixed=known, output_unit_N=2 * output_unit, elongation_unit_m=2 * elongation_unit)
    say("dynamic stage: choice of the law")
    extras = (*EXTRAS, *((D.INPUT_BIAS,) if biases else ()))
    task, solution, laws = _choose(task, fit_pieces(validation), extras, start, span_N, mean_N)
    say("dynamic stage: fine chain")
    known = task.complete(solution.values)
    output_unit, elongation_unit = task.channel_rms(solution.residuals)
    fine = replace(task.model, count=max(FINE_MASSES, transmission.path.segments), longest_step_s=FINE_STEP_S)
    task = replace(task, model=fine, fixed=known, output_unit_N=2 * output_unit, elongation_unit_m=2 * elongation_unit)
    solution = _solve(task, known, span_N, 8, 1e-5)
    say("dynamic stage: uncertainty")
    blind = tuple(n for n in D if n not in task.free)
    flat = replace(task.model, count=COARSE_MASSES, longest_step_s=COARSE_STEP_S)
    expected = _expected(replace(task, model=flat, fixed=task.complete(solution.values)), (*task.free, *blind))
    solution = _with_input_noise(task, solution)
    return DynamicFit(
        model=task.model, values=task.complete(solution.values), solution=solution, expected=expected, laws=laws
    )


def _choose(
    task: ChainResiduals,
    validation: Sequence[FitPiece],
    extras: Sequence[DynamicParameter],
    start: Mapping[DynamicParameter, float],
    span_N: float,
    mean_N: float,
) -> tuple[ChainResiduals, Solution, tuple[ChainCandidate, ...]]:
    """Add to the law what lowers the error where it was not fitted: on other files, or on the last third of these."""
    scenario = task.model.values()
    own = {n: scenario[n] for n in extras}
    task = replace(task, fixed={**task.fixed, **own})
    train, judge = task.split(validation)
    laws = []

    def attempt(candidate: ChainResiduals, at: Mapping[DynamicParameter, float], name: str) -> tuple[Solution, float]:
        found = _solve(candidate, at, span_N, 15, 1e-4)
        error = replace(judge, model=candidate.model).robust_rms_N(candidate.complete(found.values))
        fitted = candidate.robust_rms_N(candidate.complete(found.values))
        laws.append(ChainCandidate(name=name, size=len(candidate.free), fit_rms_N=fitted, validation_rms_N=error))
        return found, error

    name = "symmetric with presliding" if task.model.symmetric else "asymmetric with presliding"
    best, least = attempt(train, train.fixed, name)
    if not task.model.symmetric:
        same = replace(
            train,
            model=replace(train.model, symmetric=True),
            free=tuple(n for n in train.free if n is not D.MU_RELEASE),
        )
        found, error = attempt(same, train.complete(best.values), "symmetric with presliding")
        if error <= SIMPLER_WITHIN * least:
            train, best, least, name = same, found, error, "symmetric with presliding"
    fitted = next(law.fit_rms_N for law in laws if law.name == name)
    for extra in extras:
        at = train.complete(best.values)
        candidate = replace(train, fixed=at, free=(*train.free, extra))
        found, error = attempt(candidate, _nudged(at, extra, start, mean_N), f"{name}, {LAW_NAMES[extra]}")
        told = abs(found.values[extra]) > SURE_OF_EXTRA * found.standard_error(extra)
        agreed = laws[-1].fit_rms_N * WORTH_A_VALUE < fitted and error * SLIGHTLY < least
        if least > (WORTH_A_VALUE if told else WORTH_A_DOUBT) * error or (told and agreed):
            fitted = laws[-1].fit_rms_N
            train, best, least, name = candidate, found, error, f"{name}, {LAW_NAMES[extra]}"
    chosen = replace(task, model=train.model, free=train.free, fixed=train.complete(best.values))
    for law_number, law in enumerate(laws):
        if law.name == name:
            laws[law_number] = replace(law, chosen=True)
    solution = _solve(chosen, chosen.fixed, span_N, 20, 1e-4)
    for _ in range(2):
        poor = [
            n
            for n in chosen.free
            if n not in CORE and not solution.standard_error(n) < IDENTIFIABLE * abs(solution.values[n])
        ]
        if not poor:
            break
        known = {**chosen.complete(solution.values), **{n: scenario[n] for n in poor}}
        chosen = replace(chosen, fixed=known, free=tuple(n for n in chosen.free if n not in poor))
        solution = _solve(chosen, known, span_N, 20, 1e-4)
    return chosen, solution, tuple(laws)


def _nudged(
    at: Mapping[DynamicParameter, float],
    extra: DynamicParameter,
    start: Mapping[DynamicParameter, float],
    mean_N: float,
) -> dict[DynamicParameter, float]:
    """A start that has something of a further effect, the friction at the mean tension being the same."""
    if extra is not D.ADHESION:
        return {**at, extra: at[extra] + NUDGES.get(extra, 0.0)}
    more = float(np.clip(start.get(extra, 0.0), NUDGES[extra] * mean_N, 0.1 * mean_N))
    share = (mean_N + at[extra]) / (mean_N + at[extra] + more)
    return {**at, extra: at[extra] + more, D.MU_PULL: share * at[D.MU_PULL], D.MU_RELEASE: share * at[D.MU_RELEASE]}


def _expected(task: ChainResiduals, names: tuple[DynamicParameter, ...]) -> dict[DynamicParameter, float]:
    """Standard errors if all of `names` were free, by the slopes at the present values."""
    values = {n: task.fixed[n] for n in names}
    try:
        residuals = replace(task, free=names).evaluate({str(n): v for n, v in values.items()})
    except ValueError:
        return dict.fromkeys(names, float("inf"))
    covariance, _ = block_covariance(residuals, robust=True)
    return dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))


def _with_input_noise(task: ChainResiduals, solution: Solution) -> Solution:
    """Take the input's noise into account: what it shifts is taken out, what it scatters joins the covariance.

    The model is driven by a measurement, whose noise is not in the residuals' statistics and is rectified by the play
    of friction. More noise of the same kind is put on the input and one Gauss-Newton step tells where the answer goes.
    """
    noisy = [(run, run.input_noise_N) for run in task.runs]
    if all(noise <= 0 for _, noise in noisy):
        return solution
    quick = replace(task, model=replace(task.model, count=COARSE_MASSES, longest_step_s=COARSE_STEP_S))
    names = task.free
    base = quick.evaluate(solution.values)
    weight = 1 / np.sqrt(1 + base.values**2)
    normal = (base.slopes * weight[:, None]).T
    inverse = np.linalg.pinv(normal @ base.slopes, hermitian=True, rcond=1e-14)
    rng = np.random.default_rng(0)
    moves = []
    for _ in range(REPLICAS):
        shaken = []
        for run, noise in noisy:
            extra = run.piece.input_filter.apply(noise * rng.standard_normal(len(run.drive.input_N)))
            shaken.append(replace(run, drive=replace(run.drive, input_N=run.drive.input_N + extra)))
        other = replace(quick, runs=shaken, free=()).evaluate(solution.values)
        moves.append(-inverse @ (normal @ (other.values - base.values)))
    moved = np.array(moves)
    shift = moved.mean(axis=0)
    scatter = np.atleast_2d(np.cov(moved.T))
    values = {}
    for name, by in zip(names, shift, strict=True):
        corrected = solution.values[name] - float(by)
        positive = name not in (D.INPUT_BIAS, D.OUTPUT_BIAS)
        values[str(name)] = (
            max(corrected, 0.0 if name in EXTRAS else 0.1 * solution.values[name]) if positive else corrected
        )
    covariance = solution.covariance + scatter * (1 + 1 / REPLICAS)
    return replace(solution, values=values, covariance=covariance)


def errors_of(fit: DynamicFit, records: Sequence[Record]) -> tuple[FileError, ...]:
    """Error of the output tension over the whole of each record.

    Parameters
    ----------
    fit : DynamicFit
    records : sequence of Record
    """
    found = []
    for record in records:
        wanted, given, good = [], [], []
        for run in fit_pieces([record]):
            response = fit.model.respond(fit.values, run.drive)
            wanted.append(run.piece.output_N)
            given.append(low_pass(response.output_N, run.step_s, run.cutoff_Hz))
            good.append(run.piece.good)
        y, x, kept = np.concatenate(wanted), np.concatenate(given), np.concatenate(good)
        rms = float(np.sqrt(np.mean((x - y)[kept] ** 2)))
        found.append(FileError(name=record.name, rms_N=rms, range_N=float(np.ptp(y))))
    return tuple(found)
