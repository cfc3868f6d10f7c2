"""Which channel can be explained, which static law the data supports, and how both are judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.fitting.dynamic import CoarseFit, fit_coarse
from tendonff.compensator.identification.fitting.residuals import TRAINING_SHARE
from tendonff.compensator.identification.fitting.static import (
    SIMPLER_WITHIN,
    StaticFit,
    StaticModel,
    candidates,
    errors_of,
    fit_static,
    middle_of,
    pooled_percent,
)
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.identification.result import POOR_PERCENT, CandidateLaw
from tendonff.compensator.scenario.measurement import Explain
from tendonff.models.parameters import Transmission
from tendonff.ocp.errors import SolveError

BETTER_BY = 0.6
"""The other channel is explained instead where it leaves less than this share of the error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticSelection:
    """The static stage's answer."""

    fit: StaticFit  # the chosen law, fitted to all records
    laws: tuple[CandidateLaw, ...]  # all that were compared
    # fit_percent, validation_percent: of the chosen law
    fit_percent: float
    validation_percent: float
    tried: tuple[StaticFit, ...]  # the candidates as they were fitted to the training rows, in the order of `laws`


def choose_explain(
    records: Sequence[Record], wanted: Explain, transmission: Transmission, *, static_only: bool = False
) -> tuple[Explain, CoarseFit | None]:
    """Channel that the laws can explain, and the chain's first fit where it was tried.

    The output is explained where the chain, driven by the measured input, gives it; forces that change sign cannot
    drive a chain. Else the input is, where the motion and the output explain it better.

    Parameters
    ----------
    wanted : Explain
        What the user asked for.
    static_only : bool, optional
        Do not try the chain.

    Raises
    ------
    InputError
        If the input is to be explained and its position was not measured.
    """
    positions = all(r.has_input_position for r in records)
    if wanted is Explain.INPUT and not positions:
        raise InputError(
            'explain = "input" needs the position of the input end in every file; '
            "name its column with --input-position-column, or explain the output"
        )
    if wanted is Explain.INPUT:
        return Explain.INPUT, None
    signed = any(r.signed for r in records)
    chain = None
    if signed or static_only:
        play = StaticModel(name="play", asymmetric=not signed, constants=True)
        left = _static_percent(records, play, Explain.OUTPUT)
    else:
        try:
            chain = fit_coarse(records, transmission, {})
            left = chain.percent
        except SolveError:
            left = float("inf")
    if wanted is Explain.OUTPUT or not positions or (left < POOR_PERCENT and not signed):
        return Explain.OUTPUT, chain
    moved = _static_percent(records, StaticModel(name="motion", constants=True, presliding=True), Explain.INPUT)
    return (Explain.INPUT, None) if moved < BETTER_BY * left else (Explain.OUTPUT, chain)


def _static_percent(records: Sequence[Record], model: StaticModel, explain: Explain) -> float:
    fit = fit_static(records, model, explain, most=15)
    return pooled_percent(errors_of(fit, records, middle_of(records)), records, explain)


def select_static(records: Sequence[Record], validation: Sequence[Record], explain: Explain) -> StaticSelection:
    """Fit the candidates, judge them where they were not fitted, keep the simplest that is as good as the best.

    Parameters
    ----------
    explain : Explain
        OUTPUT or INPUT.
    """
    signed = any(r.signed for r in records)
    train, judge = (records, validation) if validation else split(records)
    tried: list[tuple[StaticFit, CandidateLaw]] = []
    by_model: dict[StaticModel, StaticFit] = {}
    best_of: dict[tuple[bool, bool, bool], StaticFit] = {}
    for model in candidates(explain):
        if signed and model.presliding and not model.constants:
            continue  # forces that change sign need the pre-tension
        simpler = best_of.get((model.constants, model.presliding, False)) or best_of.get(
            (model.constants, False, False)
        )
        if model.spread:
            simpler = by_model[replace(model, name=model.name.rpartition(",")[0], spread=False)]
        fit = by_model[model] = fit_static(train, model, explain, most=40, start=simpler)
        best_of[model.constants, model.presliding, model.guide] = fit
        middle = middle_of(train)
        law = CandidateLaw(
            name=model.name,
            stage="static",
            free_values=model.size,
            fit_percent=pooled_percent(errors_of(fit, train, middle), train, explain),
            validation_percent=pooled_percent(errors_of(fit, judge, middle), judge, explain),
            chosen=False,
        )
        tried.append((fit, law))
    least = min(law.validation_percent for _, law in tried)
    enough = [pair for pair in tried if pair[1].validation_percent <= SIMPLER_WITHIN * least]
    chosen, chosen_law = min(enough, key=lambda pair: pair[1].free_values)
    fit = chosen if train is records else fit_static(records, chosen.model, explain, start=chosen)
    laws = tuple(replace(law, chosen=law is chosen_law) for _, law in tried)
    return StaticSelection(
        fit=fit,
        laws=laws,
        fit_percent=pooled_percent(errors_of(fit, records, middle_of(records)), records, explain),
        validation_percent=chosen_law.validation_percent,
        tried=tuple(fit for fit, _ in tried),
    )


def split(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """First and last part of every piece."""
    early = [replace(r, pieces=tuple(_part(p, 0, TRAINING_SHARE) for p in r.pieces)) for r in records]
    late = [replace(r, pieces=tuple(_part(p, TRAINING_SHARE, 1) for p in r.pieces)) for r in records]
    return early, late


def _part(piece: Piece, start: float, stop: float) -> Piece:
    return piece.part(slice(round(start * len(piece.time_s)), max(round(stop * len(piece.time_s)), 2)))
