"""Errors, compared laws and curves of the law that won."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.identification.fitting.dynamic import DynamicFit, chain_errors
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.fitting.residuals import FitPiece, fit_pieces
from tendonff.compensator.identification.fitting.static import (
    FileError,
    errors_of,
    explained,
    middle_of,
    pooled_percent,
    respond,
    span_of,
)
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.reading import Array
from tendonff.compensator.identification.measured.smoothing import low_pass
from tendonff.compensator.identification.result import CandidateLaw, FileResult, PieceComparison
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.static import StaticParameter


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How the chosen law does."""

    law: str
    laws: tuple[CandidateLaw, ...]
    files: tuple[FileResult, ...]
    fit_percent: float
    validation_percent: float | None  # on validation files
    comparisons: tuple[PieceComparison, ...]


def compared(
    stage: StaticSelection | None, chain: DynamicFit | None, records: Sequence[Record]
) -> tuple[CandidateLaw, ...]:
    """All laws on one measure: the same rows, RMS, the same range; the best is chosen.

    The chain is kept where it is at least as good as the best static law where neither was fitted.

    Parameters
    ----------
    stage : StaticSelection or None
        None where nothing was measured at the far end.
    """
    if chain is None:
        return () if stage is None else stage.laws
    judge, train = chain.law.judge, chain.law.train
    scale = 100 / max(span_of(records, judge.pieces[0].explain), 1e-300)
    middle = middle_of(records)
    laws = []
    for law, fit in zip(stage.laws, stage.tried, strict=True) if stage is not None else ():

        def predict(p: FitPiece, values: Mapping[StaticParameter, float] = fit.values) -> Array:
            return respond(values, p.piece, Explain.OUTPUT, middle).prediction_N

        fitted, judged = (scale * task.rms_of(predict).rms_N for task in (train, judge))
        laws.append(replace(law, fit_percent=fitted, validation_percent=judged, chosen=False))
    laws += [
        CandidateLaw(
            name=one.name,
            stage="dynamic",
            free_values=one.size,
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


def outcome_of(
    laws: Sequence[CandidateLaw],
    stage: StaticSelection | None,
    chain: DynamicFit | None,
    records: Sequence[Record],
    judges: Sequence[Record],
) -> Outcome:
    """Errors and curves of the chosen law.

    Parameters
    ----------
    stage : StaticSelection or None
        None where nothing was measured at the far end.
    chain : DynamicFit or None
        None where the static law was chosen.
    """
    middle, explain = middle_of(records), Explain.POSITION if stage is None else stage.fit.explain
    fitted, judged = (_errors(stage, chain, some, middle) for some in (records, judges))
    files = tuple(
        FileResult(role=role, error=error, findings=record.findings)
        for role, errors, some in (("fit", fitted, records), ("validate", judged, judges))
        for error, record in zip(errors, some, strict=True)
    )
    return Outcome(
        law=next(law.name for law in laws if law.chosen),
        laws=tuple(laws),
        files=files,
        fit_percent=pooled_percent(fitted, records, explain),
        validation_percent=pooled_percent(judged, judges, explain) if judges else None,
        comparisons=tuple(
            piece
            for role, some in (("fit", records), ("validate", judges))
            for record in some
            for piece in _comparisons(stage, chain, record, role, middle)
        ),
    )


def _errors(
    stage: StaticSelection | None, chain: DynamicFit | None, records: Sequence[Record], middle_m: float
) -> tuple[FileError, ...]:
    if chain is not None:
        explain = Explain.POSITION if stage is None else Explain.OUTPUT
        return chain_errors(chain.model, chain.values, records, explain)
    if stage is None:
        return ()
    return errors_of(stage.fit, records, middle_m)


def _comparisons(
    stage: StaticSelection | None, chain: DynamicFit | None, record: Record, role: str, middle_m: float
) -> list[PieceComparison]:
    found = []
    explain = Explain.POSITION if stage is None else stage.fit.explain
    channel = Explain.POSITION if stage is None else Explain.OUTPUT
    for run, piece in zip(fit_pieces([record], channel), record.pieces, strict=True):
        moved = modelled = None
        measured = explained(piece, explain)
        if chain is not None:
            response = chain.model.respond(chain.values, run.drive)
            model = low_pass(run.predicted(response)[0], record.step_s, record.cutoff_Hz)
            if run.with_elongation:
                moved = run.elongation - run.elongation.mean()
                modelled = low_pass(response.elongation_m, record.step_s, record.cutoff_Hz)
                modelled = modelled - modelled.mean()
        elif stage is not None:
            model = respond(stage.fit.values, piece, explain, middle_m).prediction_N
        else:
            continue
        if explain is Explain.POSITION:
            measured, model = measured - measured.mean(), model - model.mean()
        given = piece.output_N if explain is Explain.INPUT else piece.input_N
        found.append(
            PieceComparison(
                name=record.name,
                role=role,
                time_s=piece.time_s,
                input_N=piece.input_N,
                given=given,
                measured=measured,
                model=model,
                elongation_m=moved,
                model_elongation_m=modelled,
            )
        )
    return found
