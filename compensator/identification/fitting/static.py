"""Stage (a): static friction, adhesion and the cells' bias, and which of the laws the data supports."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.identification.measured.reading import Array, Mask
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.least_squares import Residuals, Solution, Unknown, solve
from tendonff.ocp.fits.static import NEUTRAL, ORDER, Response, StaticParameter, input_from_output, output_from_input

ROBUST_UNIT = 0.03
"""Residuals beyond this share of the range count linearly instead of squared."""

SIMPLER_WITHIN = 1.02
"""The simplest law whose validation error is within this factor of the least is chosen."""

EXPONENT_STARTS = (0.02, 0.1, 0.3, 0.6, 1.2, 2.5, 4.0)
MOST_EXPONENT = 8.0
BLOCKS_WANTED = 60
LEAST_SPREAD = 1e-3

P = StaticParameter


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticModel:
    """One candidate law: what it lets vary."""

    name: str  # for the report
    asymmetric: bool = False  # pulling and releasing have coefficients of their own
    constants: bool = False  # adhesion p and a bias
    presliding: bool = False  # a soft bristle before gross sliding; needs the motion
    guide: bool = False  # a spring beside the tendon; needs the motion
    spread: bool = False  # with presliding two bristles, else plays with spread bounds

    @property
    def size(self) -> int:
        """Number of free values."""
        spread = self.spread * (1 if self.presliding else 1 + self.asymmetric)
        return 1 + self.asymmetric + 2 * self.constants + self.presliding + self.guide + spread


@dataclass(frozen=True, slots=True, kw_only=True)
class FileError:
    """How well a law explains one file."""

    name: str
    rms: float  # RMS error of the explained channel, N or m
    span: float  # its largest less its smallest value

    @property
    def percent(self) -> float:
        """Rms in percent of the file's own range."""
        return 100 * self.rms / self.span if self.span > 0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticFit:
    """A candidate, fitted."""

    model: StaticModel
    explain: Explain  # OUTPUT or INPUT
    values: dict[StaticParameter, float]  # all of them
    solution: Solution
    bias_split: bool  # the adhesion would have to be negative: both biases are free instead


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A piece, thinned to what the low-pass leaves, with its explained channel."""

    piece: Piece
    keep: slice
    wanted: Array
    good: Mask
    middle_m: float


def explained(piece: Piece, explain: Explain) -> Array:
    """The channel that the model explains, shape (n,)."""
    if explain is Explain.POSITION:
        return piece.travel_m()
    return piece.output_N if explain is Explain.OUTPUT else piece.input_N


def middle_of(records: Sequence[Record]) -> float:
    """Middle of the input end's travel over all records [m]; 0 without positions."""
    if not all(r.has_input_position for r in records):
        return 0.0
    ends = [
        (float(p.input_m.min()), float(p.input_m.max())) for r in records for p in r.pieces if p.input_m is not None
    ]
    return (min(a for a, _ in ends) + max(b for _, b in ends)) / 2


def respond(
    values: Mapping[StaticParameter, float], piece: Piece, explain: Explain, middle_m: float, thin: int = 1
) -> Response:
    """Prediction of the explained channel of one piece.

    Parameters
    ----------
    middle_m : float
        Where the guide's force is zero [m].
    thin : int, optional
        Take every so many rows.
    """
    if explain is Explain.OUTPUT:
        return output_from_input(values, piece.input_N[::thin], float(piece.output_N[0]))
    motion_m = piece.travel_m()[::thin] - middle_m
    return input_from_output(values, piece.output_N[::thin], motion_m, float(piece.input_N[0]))


def candidates(explain: Explain) -> tuple[StaticModel, ...]:
    """The laws that are tried, simplest first."""
    plain = (
        StaticModel(name="symmetric"),
        StaticModel(name="asymmetric", asymmetric=True),
        StaticModel(name="symmetric with adhesion", constants=True),
        StaticModel(name="asymmetric with adhesion", asymmetric=True, constants=True),
    )
    if explain is Explain.OUTPUT:
        return (*plain, *(replace(m, name=f"{m.name}, spread bounds", spread=True) for m in plain if m.asymmetric))
    soft = [replace(m, name=f"{m.name}{',' if m.constants else ' with'} presliding", presliding=True) for m in plain]
    guided = [replace(m, name=f"{m.name}, guide spring", guide=True) for m in soft if m.constants]
    spread = [replace(m, name=f"{m.name}, two bristles", spread=True) for m in (*soft, *guided) if m.constants]
    return (*plain, *soft, *guided, *spread)


def _thinning(record: Record) -> int:
    """Rows per ten samples of the cut-off's period: a low-passed channel holds no more."""
    return max(1, int(1 / (10 * record.cutoff_Hz * record.step_s)))


def _runs(records: Sequence[Record], explain: Explain) -> Iterator[_Run]:
    middle = middle_of(records)
    for record in records:
        thin = _thinning(record)
        for piece in record.pieces:
            keep = slice(None, None, thin)
            yield _Run(
                piece=piece, keep=keep, wanted=explained(piece, explain)[keep], good=piece.good[keep], middle_m=middle
            )


def span_of(records: Sequence[Record], explain: Explain) -> float:
    """Range of the explained channel over all records, N or m."""
    parts = [explained(p, explain) for r in records for p in r.pieces]
    if explain is Explain.POSITION:  # the zero may differ from piece to piece
        return max(float(np.ptp(x)) for x in parts)
    return float(max(x.max() for x in parts) - min(x.min() for x in parts))


def fit_static(
    records: Sequence[Record], model: StaticModel, explain: Explain, *, most: int = 60, start: StaticFit | None = None
) -> StaticFit:
    """Fit one candidate to all records together.

    Parameters
    ----------
    explain : Explain
        OUTPUT or INPUT.
    most : int, optional
        Largest number of evaluations.
    start : StaticFit, optional
        A simpler law's fit to start from.
    """
    fit = _fit(records, model, explain, most, start, bias_split=False)
    if model.constants and explain is Explain.OUTPUT and P.ADHESION.value in fit.solution.at_bound:
        split = _fit(records, model, explain, most, start, bias_split=True)
        if split.solution.cost < 0.999 * fit.solution.cost:
            return split
    return fit


def _fit(
    records: Sequence[Record],
    model: StaticModel,
    explain: Explain,
    most: int,
    start: StaticFit | None,
    *,
    bias_split: bool,
) -> StaticFit:
    runs = list(_runs(records, explain))
    span = max(span_of(records, explain), 1e-12)
    unit = ROBUST_UNIT * span
    unknowns = _unknowns(records, runs, model, span, start, bias_split=bias_split)
    seconds = sum(float(np.ptp(r.piece.time_s)) for r in runs)
    block_s = float(np.clip(seconds / BLOCKS_WANTED, 0.1, 5.0))
    blocks = np.concatenate(
        [
            np.floor(r.piece.time_s[r.keep] / block_s)[r.good].astype(np.int64) + 10_000_000 * k
            for k, r in enumerate(runs)
        ]
    )

    def evaluate(values: Mapping[str, float]) -> Residuals:
        full = complete(values, model)
        differences, slopes = [], []
        for run in runs:
            thin = run.keep.step or 1
            response = respond(full, run.piece, explain, run.middle_m, thin)
            differences.append((response.prediction_N - run.wanted)[run.good] / unit)
            slopes.append(response.slopes[run.good] / unit)
        by_all = np.concatenate(slopes)
        return Residuals(values=np.concatenate(differences), slopes=_chosen(by_all, unknowns, model), blocks=blocks)

    first = min(
        (_with_exponent(unknowns, a) for a in (EXPONENT_STARTS if start is None else ())),
        key=lambda us: float(np.sum(np.sqrt(1 + evaluate({u.name: u.start for u in us}).values ** 2))),
        default=unknowns,
    )
    solution = solve(evaluate, first, most=most)
    return StaticFit(
        model=model,
        explain=explain,
        values=complete(solution.values, model),
        solution=solution,
        bias_split=bias_split,
    )


def complete(values: Mapping[str, float], model: StaticModel) -> dict[StaticParameter, float]:
    """All values from the free ones."""
    full = {k: values.get(k.value, NEUTRAL[k]) for k in ORDER}
    if not model.asymmetric:
        full[P.RELEASE], full[P.RELEASE_SPREAD] = full[P.PULL], full[P.PULL_SPREAD]
    return full


def _chosen(slopes: Array, unknowns: Sequence[Unknown], model: StaticModel) -> Array:
    """Columns of the free values; a symmetric law has one exponent for both directions."""
    index = {k.value: i for i, k in enumerate(ORDER)}
    columns = slopes[:, [index[u.name] for u in unknowns]].copy()
    if not model.asymmetric:
        columns[:, 0] += slopes[:, index[P.RELEASE.value]]  # no symmetric law has spread bounds
    return columns


def _with_exponent(unknowns: Sequence[Unknown], exponent: float) -> list[Unknown]:
    names = (P.PULL.value, P.RELEASE.value)
    return [replace(u, start=exponent) if u.name in names else u for u in unknowns]


def _unknowns(
    records: Sequence[Record],
    runs: Sequence[_Run],
    model: StaticModel,
    span: float,
    start: StaticFit | None,
    *,
    bias_split: bool,
) -> list[Unknown]:
    known = {} if start is None else start.values
    lowest = min(float(r.joined("output_N").min()) for r in records)
    far_span = max(float(np.ptp(np.concatenate([r.joined("output_N") for r in records]))), span)
    list_of = [Unknown(name=P.PULL.value, start=known.get(P.PULL, 0.5), low=0, high=MOST_EXPONENT, scale=0.2)]
    if model.asymmetric:
        list_of.append(
            Unknown(name=P.RELEASE.value, start=known.get(P.RELEASE, 0.5), low=0, high=MOST_EXPONENT, scale=0.2)
        )
    if model.constants:
        least = max(0.0, -lowest)
        adhesion = max(known.get(P.ADHESION, 0.0), least + 0.05 * far_span)
        if bias_split:
            list_of.append(Unknown(name=P.OUTPUT_BIAS.value, start=0.0, low=-span, high=span, scale=0.05 * span))
        else:
            list_of.append(
                Unknown(name=P.ADHESION.value, start=adhesion, low=least, high=20 * far_span, scale=0.1 * far_span)
            )
        bias = known.get(P.INPUT_BIAS, 0.0)
        list_of.append(Unknown(name=P.INPUT_BIAS.value, start=bias, low=-span, high=span, scale=0.05 * span))
    travel = max((float(np.ptp(r.piece.input_m)) for r in runs if r.piece.input_m is not None), default=1.0) or 1.0
    if model.presliding:
        bristle = known.get(P.BRISTLE, NEUTRAL[P.BRISTLE])
        if bristle >= NEUTRAL[P.BRISTLE]:
            bristle = 20 * span / travel
        list_of.append(
            Unknown(
                name=P.BRISTLE.value,
                start=bristle,
                low=span / travel,
                high=1e5 * span / travel,
                scale=1,
                logarithmic=True,
            )
        )
    if model.spread and model.presliding:
        list_of.append(Unknown(name=P.BRISTLE_SPREAD.value, start=1.0, low=0, high=6, scale=0.5))
    elif model.spread:
        list_of += [
            Unknown(name=name.value, start=LEAST_SPREAD + 0.3, low=LEAST_SPREAD, high=1, scale=0.2)
            for name in (P.PULL_SPREAD, P.RELEASE_SPREAD)
        ]
    if model.guide:
        most = 10 * span / travel
        list_of.append(
            Unknown(name=P.GUIDE.value, start=known.get(P.GUIDE, 0.0), low=-most, high=most, scale=0.1 * span / travel)
        )
    return list_of


def errors_of(fit: StaticFit, records: Sequence[Record], middle_m: float) -> tuple[FileError, ...]:
    """Error of a fitted law over the whole of each record.

    Parameters
    ----------
    middle_m : float
        Middle of travel of the records it was fitted to.
    """
    found = []
    for record in records:
        wanted = np.concatenate([explained(p, fit.explain) for p in record.pieces])
        given = np.concatenate([respond(fit.values, p, fit.explain, middle_m).prediction_N for p in record.pieces])
        good = record.joined("good")
        rms = float(np.sqrt(np.mean((given - wanted)[good] ** 2)))
        found.append(FileError(name=record.name, rms=rms, span=float(np.ptp(wanted))))
    return tuple(found)


def pooled_percent(errors: Sequence[FileError], records: Sequence[Record], explain: Explain) -> float:
    """Rms over all records in percent of their common range."""
    rows = np.array([sum(len(p.time_s) for p in r.pieces) for r in records], dtype=np.float64)
    square = float(np.average([e.rms**2 for e in errors], weights=rows))
    return 100 * float(np.sqrt(square)) / max(span_of(records, explain), 1e-300)
