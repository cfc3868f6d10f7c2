"""Residuals of the whole chain against measured pieces: output tension, and elongation where positions exist."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.errors import centred, explained
from tendonff.compensator.identification.fitting.judging import (
    FAILED,
    Folds,
    OutputError,
    error_of,
    folds_of,
    values_without,
)
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import SHORT_GAP_STEPS, Piece, Record
from tendonff.compensator.identification.measured.smoothing import low_pass_piece
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.chain import ChainResponse, Drive
from tendonff.ocp.fits.least_squares import Residuals, Solution

_T = TypeVar("_T", np.float64, np.int_)

FAILED_RESIDUAL = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class FitPiece:
    """A piece as the residuals need it."""

    record: Record  # that it is from
    piece: Piece
    drive: Drive
    good: Mask
    thin: int
    explain: Explain  # OUTPUT or POSITION

    @property
    def measured(self) -> Array:
        """The explained channel, shape (n,)."""
        return explained(self.piece, self.explain)

    @property
    def with_elongation(self) -> bool:
        """The elongation is compared as well."""
        return self.record.has_positions and self.explain is Explain.OUTPUT

    def predicted(self, response: ChainResponse) -> tuple[Array, Array]:
        """The explained channel of a response, shape (n,), and its slopes, shape (n, k)."""
        if self.explain is Explain.POSITION:
            return response.near_m, response.near_slopes
        return response.output_N, response.output_slopes

    def off(self, prediction: Array) -> Array:
        """Prediction less measurement at the fitted rows; the zero of positions is arbitrary."""
        return centred((self.shaped(prediction) - self.measured[:: self.thin])[self.good], self.explain)

    def shaped(self, x: Array) -> Array:
        """Prediction after low-pass and thinning."""
        return low_pass_piece(x, self.record.step_s, self.record.cutoff_Hz)[:: self.thin]


def _rows_to_sweep(x: Array, span: float) -> int:
    """Rows until so large a range is covered; all of them where it never is."""
    swept = np.maximum.accumulate(x) - np.minimum.accumulate(x)
    return int(np.argmax(swept >= span)) if swept[-1] >= span else len(x)


def _gap_ends(good: Mask) -> list[int]:
    """Rows after bridges that may hide an extreme of the input, which friction would remember."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], good, [True]]).astype(np.int8)))
    return [
        int(stop)
        for start, stop in zip(edges[::2], edges[1::2], strict=True)
        if SHORT_GAP_STEPS < stop - start < len(good) - start
    ]


def fit_pieces(records: Sequence[Record], explain: Explain = Explain.OUTPUT) -> list[FitPiece]:
    """Pieces of all records, thinned to what their low-pass leaves; OUTPUT or POSITION is compared."""
    found = []
    widest = max((float(np.ptp(r.joined("input_N"))) for r in records), default=0.0)
    for record in records:
        thin = max(1, int(1 / (6 * record.cutoff_Hz * record.step_s)))
        edge = int(0.5 / (record.cutoff_Hz * record.step_s))
        for piece in record.pieces:
            good, span = piece.good.copy(), max(float(np.ptp(piece.input_N)), TUNED.small_piece * widest)
            most = int(TUNED.forget_most * len(good))
            good[: min(max(_rows_to_sweep(piece.input_N, TUNED.forget_share * span), edge), most)] = False
            good[len(good) - edge :] = False  # the low-pass has one side only
            for end in _gap_ends(piece.good):
                good[end : end + min(_rows_to_sweep(piece.input_N[end:], TUNED.forget_bridge * span), most)] = False
            first = piece.input_N[0] if explain is Explain.POSITION else piece.output_N[0]
            drive = Drive(
                input_N=piece.input_N,
                step_s=record.step_s,
                first_output_N=float(first),
                motion=piece.motion_from_start(),
            )
            found.append(
                FitPiece(record=record, piece=piece, drive=drive, good=good[::thin], thin=thin, explain=explain)
            )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainResiduals:
    """Residuals of a chain model over pieces, in given units."""

    model: ParametricChain
    pieces: Sequence[FitPiece]
    fixed: Mapping[Parameter, float]
    free: tuple[Parameter, ...]
    output_unit: float
    elongation_unit_m: float
    block_s: float

    BLOCKS_A_PIECE: ClassVar[int] = 10_000_000

    @property
    def rows(self) -> int:
        """Fitted rows of the output."""
        return sum(int(run.good.sum()) for run in self.pieces)

    def complete(self, values: Mapping[str, float]) -> dict[Parameter, float]:
        """All parameters from the free ones."""
        return self.model.tied({**self.fixed, **{Parameter(name): value for name, value in values.items()}})

    def continued(self, solution: Solution) -> "ChainResiduals":
        """The task from a solution on, in units of the size of its residuals, which decides how each channel counts."""
        output, elongation = self.channel_rms(solution.residuals)
        return replace(
            self, fixed=self.complete(solution.values), output_unit=2 * output, elongation_unit_m=2 * elongation
        )

    def differences(self, values: Mapping[str, float]) -> Residuals:
        """Residuals and slopes over the free parameters; SolveError where the chain fails."""
        full = self.complete(values)
        parts: list[tuple[Array, Array, Array]] = []
        for number, run in enumerate(self.pieces):
            response = self.model.predict(full, run.drive, self.free)
            good = run.good
            block = np.floor(run.piece.time_s[:: run.thin][good] / self.block_s) + self.BLOCKS_A_PIECE * number
            prediction, by = run.predicted(response)
            slopes = centred(run.shaped(by)[good], run.explain)
            parts.append((run.off(prediction) / self.output_unit, slopes / self.output_unit, block))
            if run.with_elongation:
                moved = (run.shaped(response.elongation_m) - run.piece.elongation_m()[:: run.thin])[good]
                slopes = run.shaped(response.elongation_slopes)[good]
                # The zero of the positions is arbitrary.
                moved, slopes = moved - moved.mean(), slopes - slopes.mean(axis=0)
                parts.append((moved / self.elongation_unit_m, slopes / self.elongation_unit_m, block))
        differences, slopes, blocks = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Residuals(values=differences, slopes=slopes, blocks=blocks.astype(np.int64))

    def evaluate(self, values: Mapping[str, float]) -> Residuals:
        """The same; very large residuals where the chain fails."""
        try:
            return self.differences(values)
        except SolveError:
            rows = sum(int(r.good.sum()) * (2 if r.with_elongation else 1) for r in self.pieces)
            failed, slopes = np.full(rows, FAILED_RESIDUAL), np.zeros((rows, len(self.free)))
            return Residuals(values=failed, slopes=slopes, blocks=np.zeros(rows, dtype=np.int64))

    def folds(self) -> list[Folds]:
        """Held-out part of every fitted row of the explained channel, piece by piece."""
        return folds_of([(run.record.name, run.piece.time_s[:: run.thin][run.good]) for run in self.pieces])

    def held_out(self, solution: Solution) -> OutputError:
        """Error of the chain on parts that it was not fitted to, in turn."""
        folds = self.folds()
        rows = [
            np.concatenate([f, f] if run.with_elongation else [f]) for run, f in zip(self.pieces, folds, strict=True)
        ]
        without = {
            fold: self.complete(values) for fold, values in values_without(solution, np.concatenate(rows)).items()
        }
        return self.error(lambda run, fold: self.predicted(without[fold], run), folds)

    def predicted(self, full: Mapping[Parameter, float], run: FitPiece) -> Array:
        """The explained channel by the chain."""
        return run.predicted(self.model.predict(full, run.drive))[0]

    def error_of(self, residuals: Residuals) -> OutputError:
        """Error over the fitted rows whose residuals are known."""
        return error_of([self.output_unit * rows for rows, _ in self.by_channel(residuals.values)], self.output_unit)

    def error_at(self, full: Mapping[Parameter, float]) -> OutputError:
        """Error of the chain at given values."""
        return self.error(lambda run, _: self.predicted(full, run))

    def error(self, predict: Callable[[FitPiece, int], Array], folds: Sequence[Folds] | None = None) -> OutputError:
        """Error of a prediction over the fitted rows, which may differ from part to part: one measure for all laws."""
        parts = []
        for number, run in enumerate(self.pieces):
            own = np.zeros(int(run.good.sum()), dtype=np.int64) if folds is None else folds[number]
            try:
                parts += [run.off(predict(run, fold))[own == fold] for fold in np.unique(own).tolist()]
            except SolveError:
                return FAILED
        return error_of(parts, self.output_unit)

    def independent_rows(self, residuals: Residuals) -> float:
        """Rows of the output that are independent of each other, by the residuals' autocorrelation."""
        total = 0.0
        for explained_rows, _ in self.by_channel(residuals.values):
            rows = len(explained_rows)
            off = explained_rows / np.sqrt(np.sqrt(1 + explained_rows**2))
            if rows > 8 and float(np.ptp(off)) > 0:
                correlation = correlate(off, off, method="fft")[rows - 1 :]
                correlation /= correlation[0]
                turn = np.flatnonzero(correlation < 0)
                reach = int(turn[0]) if len(turn) else rows
                total += rows / (1 + 2 * float(correlation[1:reach].sum()))
        return max(total, 1.0)

    def channel_rms(self, residuals: Residuals) -> tuple[float, float]:
        """Robust size of the output's and the elongation's residuals [N], [m]."""
        units = (self.output_unit, self.elongation_unit_m)
        channels = zip(*self.by_channel(residuals.values), strict=True)
        sizes = []
        for parts, unit in zip(channels, units, strict=True):
            every = np.concatenate(parts)
            size = 1.4826 * float(np.median(np.abs(every))) * unit if len(every) else unit
            sizes.append(max(size, 1e-6 * unit))
        return sizes[0], sizes[1]

    def by_channel(self, values: NDArray[_T]) -> list[tuple[NDArray[_T], NDArray[_T]]]:
        """Rows of the explained channel and of the elongation, piece by piece."""
        found, at = [], 0
        for run in self.pieces:
            rows = int(run.good.sum())
            middle, stop = at + rows, at + rows * (2 if run.with_elongation else 1)
            found.append((values[at:middle], values[middle:stop]))
            at = stop
        return found


def spans_of(pieces: Sequence[FitPiece]) -> tuple[float, float]:
    """Ranges of the explained channel and of the elongation [m] over all pieces."""
    output = max(r.measured.max() for r in pieces) - min(r.measured.min() for r in pieces)
    travel = max((float(np.ptp(r.piece.elongation_m())) for r in pieces if r.with_elongation), default=1.0)
    return max(float(output), 1e-15), max(travel, 1e-15)
