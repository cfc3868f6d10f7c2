"""Stage (c): the whole chain against the measurement: presliding, Stribeck effect, viscous friction, visco-elasticity."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.cleaning import Piece, Record
from tendonff.compensator.identification.reading import Array, Mask
from tendonff.compensator.identification.smoothing import low_pass
from tendonff.compensator.identification.static import FileError
from tendonff.models.fidelity import Level
from tendonff.models.transmission import Transmission
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fit_dynamic import ChainModel, Drive, DynamicParameter
from tendonff.ocp.least_squares import Residuals, Solution, Unknown, block_covariance, solve

D = DynamicParameter

COARSE_MASSES, COARSE_STEP_S = 8, 2e-3
FINE_MASSES, FINE_STEP_S = 30, 1e-3
ROBUST_UNIT = 0.02
FORGET_SHARE, FORGET_MOST = 0.6, 0.3
"""Rows before the input has swept this share of its range are not fitted, for what the tendon did before the first row is
not known and friction remembers it; at most this share of a piece is given up for that."""

BRISTLE_STARTS = (0.1, 1.0, 10.0)
IDENTIFIABLE = 0.5
"""A positive value counts as identified when its standard error is below this share of it."""

DYNAMIC_BLOCKS = 20
"""Blocks of rows that are taken as independent: long, for friction carries an error on until the next sweep."""

REPLICAS = 8
"""Runs with more noise on the input, for what its noise does to the answer."""

FAILED_RESIDUAL = 1e3

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
WORTH_A_VALUE = 1.15
"""A further value is worth having where it lowers the validation error by this factor."""

TRAINING_SHARE = 0.65
"""Without validation files the law is fitted to this share of each piece and judged on the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainLaw:
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
    laws : tuple of ChainLaw
        The laws that were compared.
    """

    model: ChainModel
    values: dict[DynamicParameter, float]
    solution: Solution
    expected: dict[DynamicParameter, float]
    laws: tuple[ChainLaw, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A piece as the residuals need it."""

    piece: Piece
    drive: Drive
    good: Mask
    thin: int
    cutoff_Hz: float
    step_s: float
    with_elongation: bool

    def shaped(self, x: Array) -> Array:
        """What the low-pass and the thinning leave of a prediction."""
        return low_pass(x, self.step_s, self.cutoff_Hz)[:: self.thin]

    @property
    def elongation(self) -> Array:
        assert self.piece.input_m is not None  # noqa: S101 - only where `with_elongation`
        assert self.piece.output_m is not None  # noqa: S101
        return self.piece.input_m - self.piece.output_m


def runs_of(records: Sequence[Record]) -> list[_Run]:
    """Pieces of all records, thinned to what their low-pass leaves."""
    found = []
    span = max((float(np.ptp(r.joined("input_N"))) for r in records), default=0.0)
    for record in records:
        thin = max(1, int(1 / (6 * record.cutoff_Hz * record.step_s)))
        edge = int(0.5 / (record.cutoff_Hz * record.step_s))
        for piece in record.pieces:
            good = piece.good.copy()
            swept = np.maximum.accumulate(piece.input_N) - np.minimum.accumulate(piece.input_N)
            known = int(np.argmax(swept >= FORGET_SHARE * span)) if swept[-1] >= FORGET_SHARE * span else len(good)
            good[: min(max(known, edge), int(FORGET_MOST * len(good)))] = False
            good[len(good) - edge :] = False  # the low-pass has one side only
            drive = Drive(input_N=piece.input_N, step_s=record.step_s, first_output_N=float(piece.output_N[0]))
            found.append(
                _Run(
                    piece=piece,
                    drive=drive,
                    good=good[::thin],
                    thin=thin,
                    cutoff_Hz=record.cutoff_Hz,
                    step_s=record.step_s,
                    with_elongation=record.has_positions,
                )
            )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """Residuals of a chain model over runs, in given units."""

    model: ChainModel
    runs: Sequence[_Run]
    fixed: Mapping[DynamicParameter, float]
    free: tuple[DynamicParameter, ...]
    output_unit_N: float
    elongation_unit_m: float
    block_s: float

    def complete(self, values: Mapping[str, float]) -> dict[DynamicParameter, float]:
        """All parameters from the free ones."""
        full = {**self.fixed, **{D(name): value for name, value in values.items()}}
        if self.model.symmetric:
            full[D.MU_RELEASE] = full[D.MU_PULL]
        return full

    def evaluate(self, values: Mapping[str, float]) -> Residuals:
        """Residuals and slopes over the free parameters."""
        try:
            return self._evaluate(self.complete(values), self.free)
        except SolveError:
            return self._failed()

    def _evaluate(self, full: Mapping[DynamicParameter, float], over: tuple[DynamicParameter, ...]) -> Residuals:
        parts: list[tuple[Array, Array, Array]] = []
        for number, run in enumerate(self.runs):
            response = self.model.respond(full, run.drive, over)
            good = run.good
            time = run.piece.time_s[:: run.thin][good]
            block = np.floor(time / self.block_s) + 1e7 * number
            wanted = run.piece.output_N[:: run.thin]
            difference = (run.shaped(response.output_N) - wanted)[good] / self.output_unit_N
            parts.append((difference, run.shaped(response.output_slopes)[good] / self.output_unit_N, block))
            if run.with_elongation:
                moved = (run.shaped(response.elongation_m) - run.elongation[:: run.thin])[good]
                slopes = run.shaped(response.elongation_slopes)[good]
                # The zero of the positions is arbitrary.
                moved, slopes = moved - moved.mean(), slopes - slopes.mean(axis=0)
                parts.append((moved / self.elongation_unit_m, slopes / self.elongation_unit_m, block))
        values, slopes, blocks = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Residuals(values=values, slopes=slopes, blocks=blocks.astype(np.int64))

    def _failed(self) -> Residuals:
        rows = sum(int(r.good.sum()) * (2 if r.with_elongation else 1) for r in self.runs)
        return Residuals(
            values=np.full(rows, FAILED_RESIDUAL),
            slopes=np.zeros((rows, len(self.free))),
            blocks=np.zeros(rows, dtype=np.int64),
        )

    def split(self, validation: Sequence[_Run]) -> tuple["_Task", "_Task"]:
        """A task to fit and one to judge: on `validation`, or on the last part of each piece."""
        if validation:
            return self, replace(self, runs=validation)
        early, late = [], []
        for run in self.runs:
            usable = np.flatnonzero(run.good)
            border = usable[int(TRAINING_SHARE * (len(usable) - 1))] if usable.size else 0
            rows = np.arange(len(run.good))
            early.append(replace(run, good=run.good & (rows <= border)))
            late.append(replace(run, good=run.good & (rows > border)))
        return replace(self, runs=early), replace(self, runs=late)

    def robust_rms_N(self, full: Mapping[DynamicParameter, float]) -> float:
        """Error of the output with large deviations counted linearly [N]."""
        total, rows = 0.0, 0
        for run in self.runs:
            try:
                response = self.model.respond(full, run.drive)
            except SolveError:
                return float("inf")
            off = (run.shaped(response.output_N) - run.piece.output_N[:: run.thin])[run.good] / self.output_unit_N
            total += float(np.sum(2 * (np.sqrt(1 + off**2) - 1)))
            rows += len(off)
        return self.output_unit_N * float(np.sqrt(total / max(rows, 1)))

    def channel_rms(self, residuals: Residuals) -> tuple[float, float]:
        """Robust size of the output's and the elongation's residuals [N], [m]."""
        outputs, moves, at = [], [], 0
        for run in self.runs:
            rows = int(run.good.sum())
            outputs.append(residuals.values[at : at + rows])
            at += rows
            if run.with_elongation:
                moves.append(residuals.values[at : at + rows])
                at += rows

        def size(parts: list[Array], unit: float) -> float:
            if not parts:
                return unit
            return max(float(1.4826 * np.median(np.abs(np.concatenate(parts)))) * unit, 1e-6 * unit)

        return size(outputs, self.output_unit_N), size(moves, self.elongation_unit_m)


def _spans(runs: Sequence[_Run]) -> tuple[float, float]:
    output = max(r.piece.output_N.max() for r in runs) - min(r.piece.output_N.min() for r in runs)
    travel = max((float(np.ptp(r.elongation)) for r in runs if r.with_elongation), default=1.0)
    return max(float(output), 1e-12), max(travel, 1e-15)


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
    task: _Task, start: Mapping[DynamicParameter, float], span_N: float, most: int, tolerance: float
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


def fit_dynamic(
    records: Sequence[Record],
    transmission: Transmission,
    start: Mapping[DynamicParameter, float],
    *,
    validation: Sequence[Record] = (),
    biases: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> DynamicFit:
    """Fit the chain at its presliding level, from coarse to fine.

    Parameters
    ----------
    records : sequence of Record
    transmission : Transmission
        Path, masses and load, and the values of what the data cannot tell.
    start : mapping of DynamicParameter to float
        From the stages before; the rest comes from `transmission`.
    validation : sequence of Record, optional
        Files that decide which law is chosen; without them the last third of `records` does.
    biases : bool, optional
        The input cell's bias may be free.
    say : callable, optional
        Told what is being done.
    """
    runs = runs_of(records)
    span_N, span_m = _spans(runs)
    coarse = ChainModel(
        transmission=transmission,
        level=Level.PRESLIDING,
        count=COARSE_MASSES,
        longest_step_s=COARSE_STEP_S,
    )
    known = {**coarse.values(), **start}
    seconds = sum(float(np.ptp(r.piece.time_s)) for r in runs)
    free = CORE + (TENDON if all(r.with_elongation for r in runs) else ())
    task = _Task(
        model=coarse,
        runs=runs,
        fixed=known,
        free=free,
        output_unit_N=ROBUST_UNIT * span_N,
        elongation_unit_m=ROBUST_UNIT * span_m,
        block_s=float(np.clip(seconds / DYNAMIC_BLOCKS, 0.1, 10.0)),
    )
    say("dynamic stage: coarse chain")
    starts = [{**known, D.BRISTLE: factor * known[D.BRISTLE]} for factor in BRISTLE_STARTS]
    first = min((_solve(task, at, span_N, 5, 1e-3) for at in starts), key=lambda s: s.cost)
    best = _solve(task, task.complete(first.values), span_N, 10, 1e-3)
    known = task.complete(best.values)
    mean_N = float(np.mean(np.concatenate([r.piece.output_N for r in runs])))
    # Now units of the size of the residuals, which decides how much each channel counts.
    output_unit, elongation_unit = task.channel_rms(best.residuals)
    task = replace(task, fixed=known, output_unit_N=2 * output_unit, elongation_unit_m=2 * elongation_unit)
    say("dynamic stage: choice of the law")
    extras = (*EXTRAS, *((D.INPUT_BIAS,) if biases else ()))
    task, solution, laws = _choose(task, runs_of(validation), extras, start, span_N, mean_N)
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
    solution = _with_input_noise(task, solution, records)
    return DynamicFit(
        model=task.model, values=task.complete(solution.values), solution=solution, expected=expected, laws=laws
    )


def _choose(
    task: _Task,
    validation: Sequence[_Run],
    extras: Sequence[DynamicParameter],
    start: Mapping[DynamicParameter, float],
    span_N: float,
    mean_N: float,
) -> tuple[_Task, Solution, tuple[ChainLaw, ...]]:
    """Add to the law what lowers the error where it was not fitted: on other files, or on the last third of these."""
    own = {n: _fallback(n, start, task.model) for n in extras}
    task = replace(task, fixed={**task.fixed, **own})
    train, judge = task.split(validation)
    laws = []

    def attempt(candidate: _Task, at: Mapping[DynamicParameter, float], name: str) -> tuple[Solution, float]:
        found = _solve(candidate, at, span_N, 12, 1e-3)
        error = replace(judge, model=candidate.model).robust_rms_N(candidate.complete(found.values))
        fitted = candidate.robust_rms_N(candidate.complete(found.values))
        laws.append(ChainLaw(name=name, size=len(candidate.free), fit_rms_N=fitted, validation_rms_N=error))
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
        if error <= WORTH_A_VALUE * least:
            train, best, least, name = same, found, error, "symmetric with presliding"
    for extra in extras:
        at = train.complete(best.values)
        candidate = replace(train, fixed=at, free=(*train.free, extra))
        nudged = {**at, extra: at[extra] + NUDGES.get(extra, 0.0) * (mean_N if extra is D.ADHESION else 1.0)}
        found, error = attempt(candidate, nudged, f"{name}, {LAW_NAMES[extra]}")
        if WORTH_A_VALUE * error < least:
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
            if n not in CORE
            and not solution.standard_error(n) < IDENTIFIABLE * relevant_size(n, solution.values[n], mean_N)
        ]
        if not poor:
            break
        known = {**chosen.complete(solution.values), **{n: _fallback(n, start, task.model) for n in poor}}
        chosen = replace(chosen, fixed=known, free=tuple(n for n in chosen.free if n not in poor))
        solution = _solve(chosen, known, span_N, 20, 1e-4)
    return chosen, solution, tuple(laws)


def _fallback(name: DynamicParameter, start: Mapping[DynamicParameter, float], model: ChainModel) -> float:
    """Value of what the data cannot tell: the scenario's own."""
    own = model.values()[name]
    return own if name not in (D.INPUT_BIAS, D.OUTPUT_BIAS) else start.get(name, own)


def _expected(task: _Task, names: tuple[DynamicParameter, ...]) -> dict[DynamicParameter, float]:
    """Standard errors if all of `names` were free, by the slopes at the present values."""
    values = {n: task.fixed[n] for n in names}
    try:
        residuals = replace(task, free=names).evaluate(values)
    except ValueError:
        return dict.fromkeys(names, float("inf"))
    covariance, _ = block_covariance(residuals, robust=True)
    return dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))


def _with_input_noise(task: _Task, solution: Solution, records: Sequence[Record]) -> Solution:
    """Take the input's noise into account: what it shifts is taken out, what it scatters joins the covariance.

    The model is driven by a measurement, whose noise is not in the residuals' statistics and is rectified by the play
    of friction. More noise of the same kind is put on the input and one Gauss-Newton step tells where the answer goes.
    """
    noisy = [(r, record.input_noise_N) for record, r in zip(_records_of_runs(records), task.runs, strict=True)]
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
            extra = run.piece.quiet.apply(noise * rng.standard_normal(len(run.drive.input_N)))
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


def _records_of_runs(records: Sequence[Record]) -> list[Record]:
    return [record for record in records for _ in record.pieces]


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
        for run in runs_of([record]):
            response = fit.model.respond(fit.values, run.drive)
            wanted.append(run.piece.output_N)
            given.append(low_pass(response.output_N, run.step_s, run.cutoff_Hz))
            good.append(run.piece.good)
        y, x, kept = np.concatenate(wanted), np.concatenate(given), np.concatenate(good)
        rms = float(np.sqrt(np.mean((x - y)[kept] ** 2)))
        found.append(FileError(name=record.name, rms_N=rms, range_N=float(np.ptp(y))))
    return tuple(found)
