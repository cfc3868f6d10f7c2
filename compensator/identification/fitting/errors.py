"""Error of a law, static or of the chain, on measured files: one measure for all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.scenario.measurement import Explain


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Prediction of a law for a piece."""

    explained: Array  # shape (n,); the explained channel, N or m
    elongation_m: Array | None = None  # shape (n,); of laws that have one


class FittedLaw(Protocol):
    """A law with its values."""

    @property
    def explain(self) -> Explain:
        """OUTPUT, INPUT or POSITION."""

    def predicted(self, record: Record) -> list[Prediction]:
        """Prediction of every piece of a record."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileError:
    """Error of a law on a file.

    Attributes
    ----------
    name : str
        Name of the file.
    rms : float
        RMS error of the explained channel, N or m.
    span : float
        Its largest less its smallest value.
    """

    name: str
    rms: float
    span: float

    @property
    def percent(self) -> float:
        """Rms in percent of the file's own range."""
        return 100 * self.rms / self.span if self.span > 0 else 0.0


def explained(piece: Piece, explain: Explain) -> Array:
    """The channel that a law explains, shape (n,); positions have an unknown zero."""
    if explain is Explain.POSITION:
        return piece.travel_m()
    return piece.output_N if explain is Explain.OUTPUT else piece.input_N


def centred(x: Array, explain: Explain) -> Array:
    """Rows of the explained channel without what its arbitrary zero adds."""
    return np.asarray(x - x.mean(axis=0)) if explain is Explain.POSITION and len(x) else x


def span_of(records: Sequence[Record], explain: Explain) -> float:
    """Range of the explained channel over all records, N or m."""
    parts = [explained(p, explain) for r in records for p in r.pieces]
    if explain is Explain.POSITION:  # the zero may differ from piece to piece
        return max(float(np.ptp(x)) for x in parts)
    return float(max(x.max() for x in parts) - min(x.min() for x in parts))


def errors_of(law: FittedLaw, records: Sequence[Record]) -> tuple[FileError, ...]:
    """Error of a law over the whole of each record; SolveError if a simulation fails."""
    found = []
    for record in records:
        wanted = [explained(p, law.explain) for p in record.pieces]
        off = np.concatenate(
            [
                centred((prediction.explained - x)[p.good], law.explain)
                for prediction, x, p in zip(law.predicted(record), wanted, record.pieces, strict=True)
            ]
        )
        rms = float(np.sqrt(np.sum(off**2) / max(len(off), 1)))
        found.append(FileError(name=record.name, rms=rms, span=float(np.ptp(np.concatenate(wanted)))))
    return tuple(found)


def pooled_percent(errors: Sequence[FileError], records: Sequence[Record], explain: Explain) -> float:
    """Rms over all records in percent of their common range."""
    rows = np.array([sum(len(p.time_s) for p in r.pieces) for r in records], dtype=np.float64)
    square = float(np.average([e.rms**2 for e in errors], weights=rows))
    return 100 * float(np.sqrt(square)) / max(span_of(records, explain), 1e-300)


def percent_of(law: FittedLaw, records: Sequence[Record]) -> float:
    """Rms of a law over all records in percent of their common range."""
    return pooled_percent(errors_of(law, records), records, law.explain)
