"""Which channel can be explained, which capstan law the data supports, and how both are judged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.answer.records import CandidateLaw
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.dynamic import CoarseFit, fit_coarse
from tendonff.compensator.identification.fitting.errors import percent_of, span_of
from tendonff.compensator.identification.fitting.static import (
    CONSTANTS,
    StaticFit,
    StaticModel,
    candidates,
    fit_static,
)
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.gains import EXACT_GAINS, Gains
from tendonff.compensator.identification.pace import UNHURRIED, Pace
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.models.parameters import Transmission
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.static import StaticParameter, in_gross_sliding

P = StaticParameter


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticSelection:
    """The static stage's answer."""

    fit: StaticFit  # the chosen law, fitted to all records; its errors are the scatter between blocks alone
    laws: tuple[CandidateLaw, ...]  # all that were compared
    tried: tuple[StaticFit, ...]  # the candidates, in the order of `laws`

    def reported(self, adhesion_N: float, gains: Gains = EXACT_GAINS) -> StaticFit:
        """The chosen law with what it leaves out in its errors.

        Adhesion and both biases act through their differences alone: where the biases were free, the adhesion is that
        of the scenario.
        """
        least = min(law.validation_percent for law in self.laws)
        pairs = list(zip(self.tried, self.laws, strict=True))
        chosen = next(other for other, law in pairs if law.chosen)
        near = [pair for pair in pairs if pair[1].validation_percent <= TUNED.nearly_as_good * least]
        others = [fit for fit, law in near if fit is not chosen and not _is_beaten(fit, law, near)]
        fit = _with_gains(_doubted(chosen, others), gains)
        if P.OUTPUT_BIAS not in fit.solution.values:
            return fit
        more = dict.fromkeys(CONSTANTS, adhesion_N)
        found = {name: value + more.get(P(name), 0.0) for name, value in fit.solution.values.items()}
        values = {name: value + more.get(name, 0.0) for name, value in fit.values.items()}
        return replace(fit, values=values, solution=replace(fit.solution, values=found))


def _with_gains(fit: StaticFit, gains: Gains) -> StaticFit:
    """Widen friction by what is not known of the two cells' gains: their ratio is added to one exponent and taken off
    the other.
    """
    signs = {P.PULL: 1.0, P.RELEASE: -1.0}
    moved = np.array([signs.get(P(free), 0.0) for free in fit.solution.values]) * gains.ratio_deviation
    return replace(fit, solution=replace(fit.solution, covariance=fit.solution.covariance + np.outer(moved, moved)))


def _is_beaten(fit: StaticFit, law: CandidateLaw, others: Sequence[tuple[StaticFit, CandidateLaw]]) -> bool:
    """A law with more free values does clearly better on held-out data: what this one lacks is there, and no doubt."""
    return any(
        set(fit.model.free) < set(other.model.free)
        and TUNED.slightly * wider.validation_percent < law.validation_percent
        for other, wider in others
    )


def choose_explain(
    records: Sequence[Record],
    wanted: Explain,
    transmission: Transmission,
    *,
    static_only: bool = False,
    pace: Pace = UNHURRIED,
) -> tuple[Explain, CoarseFit | None]:
    """Channel that the laws can explain, and the chain's first fit where it was tried.

    The output is explained where the chain, driven by the measured input, gives it; forces that change sign cannot
    drive a chain. Else the input is, where the motion and the output explain it better; InputError if it is asked for
    and its position was not measured.
    """
    positions = all(r.has_input_position for r in records)
    if wanted is Explain.INPUT and not positions:
        raise InputError(
            'explain = "input" needs the position of the near end in every file; '
            "name its column with --input-position-column, or explain the output"
        )
    if wanted is Explain.INPUT:
        return Explain.INPUT, None
    signed = any(r.signed for r in records)
    chain = None
    if signed or static_only:
        directions = (P.PULL,) if signed else (P.PULL, P.RELEASE)
        play = StaticModel(name="play", free=directions).with_effect(P.ADHESION)
        left = percent_of(fit_static(records, play, Explain.OUTPUT, most=15, hold_out=False), records)
    else:
        try:
            chain = fit_coarse(records, transmission, {}, pace=pace)
            left = chain.percent
        except SolveError:
            left = float("inf")
    if wanted is Explain.OUTPUT or not positions or (left < TUNED.poor_percent and not signed):
        return Explain.OUTPUT, chain
    motion = StaticModel(name="motion", free=(P.PULL,)).with_effect(P.ADHESION).with_effect(P.BRISTLE)
    moved = percent_of(fit_static(records, motion, Explain.INPUT, most=15, hold_out=False), records)
    return (Explain.INPUT, None) if moved < TUNED.other_channel_below * left else (Explain.OUTPUT, chain)


def select_static(records: Sequence[Record], validation: Sequence[Record], explain: Explain) -> StaticSelection:
    """Fit the candidates, judge them where they were not fitted, keep the simplest that is as good as the best."""
    signed = any(r.signed for r in records)
    scale = 100 / max(span_of(records, explain), 1e-300)
    tried: list[tuple[StaticFit, CandidateLaw]] = []
    fits: dict[frozenset[StaticParameter], StaticFit] = {}
    for model in candidates(explain):
        if signed and model.presliding and not model.constants:
            continue  # forces that change sign need the pre-tension
        # The law without the last effect, of either symmetry where there is none of its own.
        simpler = max((own for own in fits if own < set(model.free)), key=len, default=None)
        start = None if simpler is None else fits[simpler]
        fit = fits[frozenset(model.free)] = fit_static(records, model, explain, start=start, hold_out=not validation)
        law = CandidateLaw(
            name=model.name,
            stage="static",
            free_values=len(model.free),
            fit_percent=percent_of(fit, records),
            validation_percent=percent_of(fit, validation) if validation else scale * fit.held_out(records).rms,
            chosen=False,
        )
        tried.append((fit, law))
    least = min(law.validation_percent for _, law in tried)
    enough = [pair for pair in tried if pair[1].validation_percent <= TUNED.simpler_within * least]
    chosen, chosen_law = min(enough, key=lambda pair: pair[1].free_values)
    laws = tuple(replace(law, chosen=law is chosen_law) for _, law in tried)
    return StaticSelection(fit=chosen, laws=laws, tried=tuple(fit for fit, _ in tried))


def _doubted(fit: StaticFit, others: Sequence[StaticFit]) -> StaticFit:
    """Widen friction and constants of a law without presliding by what such a law leaves out.

    A bristle that gives before it slides shows alike after every reversal, which the scatter between blocks does not
    see: each direction's error is that of rows that are all wrong alike, hence the scatter of what single rows say. The
    constants that a law does without move it as well: `others` show by how much.
    """
    if fit.model.presliding:
        return fit
    solution, residuals = fit.solution, fit.solution.residuals
    own = in_gross_sliding(fit.values)
    moves = np.array([np.subtract(in_gross_sliding(other.values), own) for other in others] or [(0.0, 0.0)])
    by_others = np.median(moves**2, axis=0)
    if not fit.model.asymmetric:
        by_others[:] = by_others.max()
    moved = {
        name: square * (fit.values[name] / sliding) ** 2
        for name, sliding, square in zip((P.PULL, P.RELEASE), own, by_others, strict=True)
        if sliding > 0
    }
    # The errors after reversals look like a bias, through the friction for the other cell; adhesion goes with them.
    as_bias_N = (
        fit.unit_N * float(np.percentile(np.abs(residuals.values), TUNED.large_errors_percentile)) * math.exp(own[0])
    )
    doubt = np.array([as_bias_N**2 if P(free) in CONSTANTS else 0.0 for free in solution.values])
    for place, free in enumerate(solution.values):
        if P(free) in moved:
            slopes = residuals.slopes[:, place]
            by_rows = np.sum((slopes * residuals.values) ** 2) / max(float(np.sum(slopes**4)), 1e-300)
            doubt[place] = by_rows + moved[P(free)] + (Parameter.MU_RELEASE.tensions.floor * fit.values[P(free)]) ** 2
    factors = np.sqrt(1 + doubt / np.maximum(np.diag(solution.covariance), 1e-300))
    return replace(fit, solution=replace(solution, covariance=solution.covariance * np.outer(factors, factors)))
