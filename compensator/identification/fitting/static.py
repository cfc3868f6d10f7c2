"""Stage (a): static friction, adhesion and the cells' bias, and which of the laws the data supports."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.errors import Prediction, explained, span_of
from tendonff.compensator.identification.fitting.judging import (
    Folds,
    OutputError,
    error_of,
    folds_of,
)
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.least_squares import (
    Blocks,
    Evaluate,
    Residuals,
    Solution,
    Unknown,
    gauss_newton_step,
    minimise,
)
from tendonff.ocp.fits.static import (
    NEUTRAL,
    ORDER,
    Response,
    Sizes,
    StaticParameter,
    input_from_output,
    output_from_input,
)

P = StaticParameter
CONSTANTS = (P.ADHESION, P.INPUT_BIAS, P.OUTPUT_BIAS)


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticModel:
    """Candidate law: its name and its free values, the last effect's at the end."""

    name: str  # for the report
    free: tuple[StaticParameter, ...]

    @property
    def asymmetric(self) -> bool:
        """Pulling and releasing have coefficients of their own."""
        return P.RELEASE in self.free

    @property
    def constants(self) -> bool:
        """Adhesion p and a bias are free."""
        return P.ADHESION in self.free

    @property
    def presliding(self) -> bool:
        """A soft bristle before gross sliding; needs the motion."""
        return P.BRISTLE in self.free

    def with_effect(self, effect: StaticParameter) -> Self:
        """The law with one more effect."""
        more = (effect, *(each for each in ORDER if each.spec.goes_with == effect))
        joint = "," if len(self.free) > len(_SLIDING) - (not self.asymmetric) else " with"
        return replace(self, name=f"{self.name}{joint} {effect.spec.effect}", free=(*self.free, *more))


_SLIDING = (P.PULL, P.RELEASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticFit:
    """A candidate, fitted."""

    model: StaticModel
    explain: Explain  # OUTPUT or INPUT
    values: dict[StaticParameter, float]  # all of them
    solution: Solution
    unit_N: float  # of the solution's residuals
    middle_m: float  # middle of the near end's travel in the fitted records, where the guide's force is zero
    # all values by a fit without each of the held-out parts
    without: Mapping[int, dict[StaticParameter, float]] = field(default_factory=dict)

    def held_out(self, records: Sequence[Record]) -> OutputError:
        """Error on parts of the fitted records that each was not fitted to, in turn."""
        runs = list(_runs(records, self.explain))
        parts = []
        for run, folds in zip(runs, _folds(runs), strict=True):
            for fold in np.unique(folds).tolist():
                found = respond(self.without[fold], run.piece, self.explain, self.middle_m, run.thin).prediction_N
                parts.append((found - run.wanted)[run.good][folds == fold])
        return error_of(parts, self.unit_N)

    def stands_out(self, bias: StaticParameter) -> bool:
        """A bias that was fitted differs from zero beyond its doubt; with presliding there is no more to doubt."""
        low, high = self.solution.interval(bias)
        return self.model.presliding or not low <= 0 <= high

    def predicted(self, record: Record) -> list[Prediction]:
        """Prediction of every piece of a record."""
        responses = (respond(self.values, p, self.explain, self.middle_m) for p in record.pieces)
        return [Prediction(explained=response.prediction_N) for response in responses]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A piece, thinned to what the low-pass leaves, with its explained channel."""

    name: str  # of the file
    piece: Piece
    thin: int
    wanted: Array
    good: Mask


def middle_of(records: Sequence[Record]) -> float:
    """Middle of the near end's travel over all records [m]; 0 without positions."""
    if not all(r.has_input_position for r in records):
        return 0.0
    travel = np.concatenate([r.joined("input_m") for r in records])
    return float(travel.min() + travel.max()) / 2


def respond(
    values: Mapping[StaticParameter, float], piece: Piece, explain: Explain, middle_m: float, thin: int = 1
) -> Response:
    """Prediction of the explained channel in every `thin`-th row of a piece; the guide's force is zero at
    `middle_m`.
    """
    if explain is Explain.OUTPUT:
        return output_from_input(values, piece.input_N[::thin], float(piece.output_N[0]))
    motion_m = piece.travel_m()[::thin] - middle_m
    return input_from_output(values, piece.output_N[::thin], motion_m, float(piece.input_N[0]))


def candidates(explain: Explain) -> tuple[StaticModel, ...]:
    """The laws that are tried, simpler ones before those with one more effect."""
    laws = [StaticModel(name="symmetric", free=_SLIDING[:1]), StaticModel(name="asymmetric", free=_SLIDING)]
    for effect in ORDER:
        term = effect.spec
        if term.effect and term.explains in ("", explain):
            laws += [law.with_effect(effect) for law in laws if set(term.beyond) <= set(law.free)]
    return tuple(laws)


def _runs(records: Sequence[Record], explain: Explain) -> Iterator[_Run]:
    for record in records:
        # Ten samples in the cut-off's period: a low-passed channel holds no more.
        thin = max(1, int(1 / (10 * record.cutoff_Hz * record.step_s)))
        for piece in record.pieces:
            yield _Run(
                name=record.name,
                piece=piece,
                thin=thin,
                wanted=explained(piece, explain)[::thin],
                good=piece.good[::thin],
            )


def fit_static(
    records: Sequence[Record],
    model: StaticModel,
    explain: Explain,
    *,
    most: int = 60,
    start: StaticFit | None = None,
    hold_out: bool = True,
) -> StaticFit:
    """Fit one candidate to all records together, OUTPUT or INPUT explained; `start` is a simpler law's fit.

    With `hold_out` it is fitted without each part of the records as well.
    """
    task = _Task.of(records, model, explain, model.free)
    fit = task.fit(records, most, start)
    if model.constants and explain is Explain.OUTPUT and P.ADHESION in fit.solution.at_bound:
        # The adhesion would have to be negative: both biases are free instead.
        biases = tuple(P.OUTPUT_BIAS if name is P.ADHESION else name for name in model.free)
        other = _Task.of(records, model, explain, biases)
        split = other.fit(records, most, start)
        if split.solution.cost < 0.999 * fit.solution.cost:
            task, fit = other, split
    return replace(fit, without=task.refitted(records, start, fit.solution)) if hold_out else fit


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """Residuals of one law over measured pieces."""

    model: StaticModel
    explain: Explain
    free: Sequence[StaticParameter]
    runs: Sequence[_Run]
    middle_m: float
    span_N: float
    blocks: Blocks

    @classmethod
    def of(
        cls, records: Sequence[Record], model: StaticModel, explain: Explain, free: Sequence[StaticParameter]
    ) -> Self:
        """The task over all records."""
        runs = list(_runs(records, explain))
        seconds = sum(float(np.ptp(r.piece.time_s)) for r in runs)
        return cls(
            model=model,
            explain=explain,
            free=free,
            runs=runs,
            middle_m=middle_of(records),
            span_N=max(span_of(records, explain), 1e-12),
            blocks=block_numbers([r.piece.time_s[:: r.thin][r.good] for r in runs], seconds),
        )

    @property
    def unit_N(self) -> float:
        """Of the residuals."""
        return TUNED.static_robust_share * self.span_N

    def fit(self, records: Sequence[Record], most: int, start: StaticFit | None) -> StaticFit:
        """The law fitted to all rows, in at most so many evaluations from one start."""
        unknowns = _unknowns(records, self.free, self.span_N, start)
        starts = [] if start is None else [unknowns]
        if start is None or not {P.BRISTLE, P.PULL_SPREAD} & set(self.free):
            starts.append(self._best_of_grid(unknowns, start))
        found = min((minimise(self.evaluate, first, most=most) for first in starts), key=lambda m: m.cost)
        solution = found.with_covariance()
        return StaticFit(
            model=self.model,
            explain=self.explain,
            values=complete(solution.values, self.model),
            solution=solution,
            unit_N=self.unit_N,
            middle_m=self.middle_m,
        )

    def evaluate(self, values: Mapping[str, float]) -> Residuals:
        """Residuals with slopes over the free values."""
        full, columns = complete(values, self.model), [ORDER.index(name) for name in self.free]
        differences, slopes = [], []
        for run in self.runs:
            response = respond(full, run.piece, self.explain, self.middle_m, run.thin)
            differences.append((response.prediction_N - run.wanted)[run.good] / self.unit_N)
            by_all = response.slopes[run.good] / self.unit_N
            slopes.append(by_all[:, columns])
            if not self.model.asymmetric:  # one exponent for both directions; no symmetric law has spread bounds
                slopes[-1][:, 0] += by_all[:, ORDER.index(P.RELEASE)]
        return Residuals(values=np.concatenate(differences), slopes=np.concatenate(slopes), blocks=self.blocks)

    def _best_of_grid(self, unknowns: Sequence[Unknown], start: StaticFit | None) -> list[Unknown]:
        """The exponents on a grid that come nearest; a release that never slides shows in no slope, so it is tried
        too.
        """
        tried = (*TUNED.exponent_starts, *(() if start is None else (start.values[P.PULL],)))
        shares = TUNED.release_starts if self.model.asymmetric else (1.0,)
        grid = [_with_exponents(unknowns, pull, share * pull) for pull in tried for share in shares]
        return min(grid, key=lambda us: self._cost_on_few({u.name: u.start for u in us}))

    def _cost_on_few(self, values: Mapping[str, float]) -> float:
        """Cost on a few of the rows."""
        full, differences = complete(values, self.model), []
        for run in self.runs:
            every = max(1, int(TUNED.knot_s / (run.thin * float(run.piece.time_s[1] - run.piece.time_s[0]))))
            response = respond(full, run.piece, self.explain, self.middle_m, run.thin * every)
            differences.append((response.prediction_N - run.wanted[::every])[run.good[::every]] / self.unit_N)
        return float(np.mean(np.sqrt(1 + np.concatenate(differences) ** 2)))

    def refitted(
        self, records: Sequence[Record], start: StaticFit | None, solution: Solution
    ) -> dict[int, dict[StaticParameter, float]]:
        """Values of fits without each part of the rows, from those of the whole fit on."""
        unknowns = _unknowns(records, self.free, self.span_N, start)
        near = [replace(u, start=solution.values[u.name]) for u in unknowns]
        folds = np.concatenate(_folds(self.runs))
        without = {}
        for fold in np.unique(folds).tolist():
            rest = folds != fold

            def on_the_rest(values: Mapping[str, float], rest: Mask = rest) -> Residuals:
                found = solution.residuals if values == solution.values else self.evaluate(values)
                return Residuals(values=found.values[rest], slopes=found.slopes[rest], blocks=found.blocks[rest])

            without[fold] = complete(_near_minimum(on_the_rest, near) if rest.any() else solution.values, self.model)
        return without


def _near_minimum(evaluate: Evaluate, unknowns: Sequence[Unknown]) -> dict[str, float]:
    """Minimiser near the start: by two Gauss-Newton steps where they close in on it within the bounds, else searched.

    A value that is on its bound, and that the first step would move beyond, stays there. With linear weights for large
    residuals the steps shrink by a ratio, which gives the steps that are left out.
    """
    low, high, scale = (np.array(one) for one in zip(*((u.low, u.high, u.scale) for u in unknowns), strict=True))
    names, values = [u.name for u in unknowns], np.array([u.start for u in unknowns])
    free, ratio, size = np.ones(len(values), dtype=bool), 0.0, 0.0
    for _ in range(2):
        found = evaluate(dict(zip(names, values.tolist(), strict=True)))
        step = _step_within(found, free)
        if not size:
            free = ~(
                (values <= low + TUNED.on_bound * scale) & (step < 0)
                | (values >= high - TUNED.on_bound * scale) & (step > 0)
            )
            step = _step_within(found, free)
        after = float(np.abs(step / scale).max())
        ratio, size = after / max(size, 1e-300) if size else 0.0, after
        values = values + step / (1 - min(ratio, TUNED.most_ratio))
        if ratio > TUNED.most_ratio or not (
            np.isfinite(values).all() and (values >= low).all() and (values <= high).all()
        ):
            return minimise(evaluate, unknowns, most=10, tolerance=1e-4).values
        if not size:
            break
    return dict(zip(names, values.tolist(), strict=True))


def _step_within(found: Residuals, free: Mask) -> Array:
    """Gauss-Newton step over some values, shape (k,); the others stay."""
    step = np.zeros(len(free))
    step[free] = gauss_newton_step(found.values, found.slopes[:, free])
    return step


def _folds(runs: Sequence[_Run]) -> list[Folds]:
    """Held-out part of every fitted row, run by run."""
    return folds_of([(run.name, run.piece.time_s[:: run.thin][run.good]) for run in runs])


def block_numbers(clocks_s: Sequence[Array], seconds: float) -> Blocks:
    """Block of every row, the runs with these clocks one after the other; together they take `seconds`."""
    block_s = min(seconds / TUNED.static_blocks, TUNED.longest_block_s / 2)
    return np.concatenate([np.floor(t / block_s).astype(np.int64) + 10_000_000 * k for k, t in enumerate(clocks_s)])


def complete(values: Mapping[str, float], model: StaticModel) -> dict[StaticParameter, float]:
    """All values from the free ones."""
    full = {k: values.get(k, NEUTRAL[k]) for k in ORDER}
    if not model.asymmetric:
        full[P.RELEASE], full[P.RELEASE_SPREAD] = full[P.PULL], full[P.PULL_SPREAD]
    return full


def _with_exponents(unknowns: Sequence[Unknown], pull: float, release: float) -> list[Unknown]:
    starts = {str(P.PULL): pull, str(P.RELEASE): release}
    return [replace(u, start=starts.get(u.name, u.start)) for u in unknowns]


def _unknowns(
    records: Sequence[Record], free: Sequence[StaticParameter], span: float, start: StaticFit | None
) -> list[Unknown]:
    """Start, bounds and scale of the free values."""
    known = {} if start is None else start.values
    output = np.concatenate([r.joined("output_N") for r in records])
    travels = (float(np.ptp(p.input_m)) for r in records for p in r.pieces if p.input_m is not None)
    sizes = Sizes(
        span_N=span,
        far_span_N=max(float(np.ptp(output)), span),
        least_N=max(0.0, -float(output.min())),
        travel_m=max(travels, default=1.0) or 1.0,
    )
    unknowns = []
    for name in free:
        first, low, high, scale = name.spec.bounds(sizes, known.get(name))
        unknowns.append(
            Unknown(name=str(name), start=first, low=low, high=high, scale=scale, logarithmic=name.spec.logarithmic)
        )
    return unknowns
