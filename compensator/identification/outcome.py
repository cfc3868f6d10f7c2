"""Errors, compared laws and curves of the law that won."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.identification.fitting.dynamic import DynamicFit
from tendonff.compensator.identification.fitting.errors import (
    FittedLaw,
    centred,
    errors_of,
    explained,
    pooled_percent,
    span_of,
)
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.fitting.residuals import FitPiece
from tendonff.compensator.identification.fitting.static import StaticFit, respond
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.result import CandidateLaw, FileResult, PieceComparison
from tendonff.compensator.scenario.measurement import Explain


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How the chosen law does."""

    files: tuple[FileResult, ...]
    fit_percent: float
    validation_percent: float | None  # on validation files
    comparisons: tuple[PieceComparison, ...]


def compared(
    stage: StaticSelection | None, chain: DynamicFit | None, records: Sequence[Record]
) -> tuple[CandidateLaw, ...]:
    """All laws on one measure: the same rows, RMS, the same range; the best is chosen.

    The chain is kept where it is at least as good as the best static law where neither was fitted. Without a static
    stage nothing was measured at the far end.
    """
    if chain is None:
        return () if stage is None else stage.laws
    judge, train = chain.law.judge, chain.law.train
    scale = 100 / max(span_of(records, chain.explain), 1e-300)
    laws = []
    for law, fit in zip(stage.laws, stage.tried, strict=True) if stage is not None else ():

        def predict(run: FitPiece, fit: StaticFit = fit) -> Array:
            return respond(fit.values, run.piece, Explain.OUTPUT, fit.middle_m).prediction_N

        fitted, judged = (scale * task.rms_of(predict).rms_N for task in (train, judge))
        laws.append(replace(law, fit_percent=fitted, validation_percent=judged, chosen=False))
    laws += [
        CandidateLaw(
            name=one.name,
            stage="dynamic",
            free_values=len(one.task.free),
            fit_percent=scale * one.fit.rms_N,
            validation_percent=scale * one.validation.rms_N,
            chosen=one.chosen,
        )
        for one in chain.law.candidates
    ]
    if stage is None:
        return tuple(laws)
    static_best = next(k for k, law in enumerate(stage.laws) if law.chosen)
    chain_best = next(k for k, law in enumerate(laws) if law.chosen)
    if laws[static_best].validation_percent < laws[chain_best].validation_percent:
        laws[chain_best] = replace(laws[chain_best], chosen=False)
        laws[static_best] = replace(laws[static_best], chosen=True)
    return tuple(laws)


def outcome_of(law: FittedLaw, records: Sequence[Record], judges: Sequence[Record]) -> Outcome:
    """Errors and curves of the chosen law."""
    fitted, judged = (errors_of(law, some) for some in (records, judges))
    by_role = (("fit", fitted, records), ("validate", judged, judges))
    return Outcome(
        files=tuple(
            FileResult(role=role, error=error, findings=record.findings)
            for role, errors, some in by_role
            for error, record in zip(errors, some, strict=True)
        ),
        fit_percent=pooled_percent(fitted, records, law.explain),
        validation_percent=pooled_percent(judged, judges, law.explain) if judges else None,
        comparisons=tuple(
            piece for role, _, some in by_role for record in some for piece in _comparisons(law, record, role)
        ),
    )


def _comparisons(law: FittedLaw, record: Record, role: str) -> list[PieceComparison]:
    found = []
    for piece, prediction in zip(record.pieces, law.predicted(record), strict=True):
        measured, model = (centred(x, law.explain) for x in (explained(piece, law.explain), prediction.explained))
        moved, modelled = None, prediction.elongation_m
        if modelled is not None:
            moved, modelled = (x - x.mean() for x in (piece.elongation_m(), modelled))
        found.append(
            PieceComparison(
                name=record.name,
                role=role,
                time_s=piece.time_s,
                input_N=piece.input_N,
                given=piece.output_N if law.explain is Explain.INPUT else piece.input_N,
                measured=measured,
                model=model,
                elongation_m=moved,
                model_elongation_m=modelled,
            )
        )
    return found
