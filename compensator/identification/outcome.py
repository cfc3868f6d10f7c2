"""Results of the selected law: its errors and curves beside the others', and the scenario with its values.

The scenario takes every value of the law that was fitted; the error of its re-simulation is reported too.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from tendonff.compensator.identification.answer.estimate import Estimate, is_known
from tendonff.compensator.identification.answer.records import ELONGATION, CandidateLaw, Channel, FileResult
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.delay import earlier
from tendonff.compensator.identification.fitting.dynamic import ChainLaw, DynamicFit
from tendonff.compensator.identification.fitting.errors import (
    FileError,
    FittedLaw,
    centred,
    errors_of,
    explained,
    percent_of,
    pooled_percent,
    span_of,
)
from tendonff.compensator.identification.fitting.model_selection import StaticSelection
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain, put_into
from tendonff.compensator.identification.fitting.residuals import FitPiece
from tendonff.compensator.identification.fitting.static import StaticFit, respond
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record, clean, mean_pose
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.identification.study import Study
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import NO_JOINTS, CapstanLaw, exponent_lines
from tendonff.models.capstan.spread_bounds import middle_exponent
from tendonff.models.fidelity import Level
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.static import NEUTRAL, StaticParameter, in_gross_sliding

P, D = StaticParameter, Parameter


CHANNELS = {
    Explain.OUTPUT: ("output tension", "input tension", 1.0, "N"),
    Explain.INPUT: ("input tension", "output tension", 1.0, "N"),
    Explain.POSITION: ("actuator position", "input tension", 1e3, "mm"),
}
"""Predicted channel, what drives it, and the factor and unit in which the channel is shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Errors of the chosen law."""

    errors: tuple[FileError, ...]
    files: tuple[FileResult, ...]
    fit_percent: float
    validation_percent: float | None  # on validation files
    channels: tuple[Channel, ...]


def compared(
    stage: StaticSelection | None, chain: DynamicFit | None, records: Sequence[Record]
) -> tuple[CandidateLaw, ...]:
    """All laws on one measure: the same rows, RMS, the same range; the best is chosen.

    The chain is kept where it is at least as good as the best capstan law where neither was fitted. Without a static
    stage nothing was measured at the far end.
    """
    if chain is None:
        return () if stage is None else stage.laws
    judge, task = chain.law.judge, chain.law.task
    scale = 100 / max(span_of(records, chain.explain), 1e-300)
    laws = []
    folds = None if judge is not None else task.folds()
    for law, fit in zip(stage.laws, stage.tried, strict=True) if stage is not None else ():

        def predict(run: FitPiece, fold: int, fit: StaticFit = fit) -> Array:
            return respond(fit.without.get(fold, fit.values), run.piece, Explain.OUTPUT, fit.middle_m).prediction_N

        def at_fit(run: FitPiece, _: int, fit: StaticFit = fit) -> Array:
            return respond(fit.values, run.piece, Explain.OUTPUT, fit.middle_m).prediction_N

        fitted = task.error(at_fit)
        judged = task.error(predict, folds) if judge is None else judge.error(at_fit)
        laws.append(replace(law, fit_percent=scale * fitted.rms, validation_percent=scale * judged.rms, chosen=False))
    laws += [
        CandidateLaw(
            name=one.name,
            stage="dynamic",
            free_values=len(one.task.free),
            fit_percent=scale * one.fit.rms,
            validation_percent=scale * one.validation.rms,
            chosen=one.chosen,
        )
        for one in chain.law.candidates
    ]
    if stage is None:
        return tuple(laws)
    static_best = next(k for k, law in enumerate(stage.laws) if law.chosen)
    chain_best = next(k for k, law in enumerate(laws) if law.chosen)
    # Tensions alone show the bristle in the shape of the loops only, which other things shape as well.
    error, stiffness = _bristle_error(chain), chain.values[D.BRISTLE]
    sure = is_known(error, stiffness) or all(r.has_positions for r in records)
    least = laws[chain_best].validation_percent * (1.0 if sure else TUNED.slightly)
    if laws[static_best].validation_percent < least:
        laws[chain_best] = replace(laws[chain_best], chosen=False)
        laws[static_best] = replace(laws[static_best], chosen=True)
    return tuple(laws)


def _bristle_error(chain: DynamicFit) -> float:
    """Standard error of the bristle; infinite where it is not free."""
    return chain.solution.standard_error(D.BRISTLE) if D.BRISTLE in chain.solution.values else math.inf


def outcome_of(law: FittedLaw, records: Sequence[Record], judges: Sequence[Record]) -> Outcome:
    """Errors and curves of the chosen law."""
    fitted, judged = (errors_of(law, some) for some in (records, judges))
    by_role = (("fit", fitted, records), ("validate", judged, judges))
    unit = "m" if law.explain is Explain.POSITION else "N"
    return Outcome(
        errors=(*fitted, *judged),
        files=tuple(
            FileResult(
                name=error.name,
                role=role,
                numbers={
                    f"rms_{unit}": error.rms,
                    f"range_{unit}": error.span,
                    "rms_percent_of_range": error.percent,
                },
                findings=record.findings,
            )
            for role, errors, some in by_role
            for error, record in zip(errors, some, strict=True)
        ),
        fit_percent=pooled_percent(fitted, records, law.explain),
        validation_percent=pooled_percent(judged, judges, law.explain) if judges else None,
        channels=tuple(
            channel for role, _, some in by_role for record in some for channel in _channels(law, record, role)
        ),
    )


def _channels(law: FittedLaw, record: Record, role: str) -> Iterator[Channel]:
    """Channel of each piece that the law explains, then its elongation."""
    name, other, scale, unit = CHANNELS[law.explain]
    for piece, prediction in zip(record.pieces, law.predicted(record), strict=True):
        measured, model = (centred(x, law.explain) for x in (explained(piece, law.explain), prediction.explained))
        channel = partial(Channel, file=record.name, role=role, time_s=piece.time_s, over_unit="N")
        yield channel(
            figure="time",
            name=name,
            unit=unit,
            measured=scale * measured,
            model=scale * model,
            over=piece.output_N if law.explain is Explain.INPUT else piece.input_N,
            over_name=other,
            turned=law.explain is Explain.INPUT,
        )
        if (modelled := prediction.elongation_m) is not None:
            moved, modelled = (1e3 * (x - x.mean()) for x in (piece.elongation_m(), modelled))
            yield channel(
                figure=ELONGATION,
                name="elongation",
                unit="mm",
                measured=moved,
                model=modelled,
                over=piece.input_N,
                over_name="input tension",
                turned=True,
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A scenario with fitted values."""

    scenario: Scenario
    # what the input and the output cell read at zero, beyond what was taken off when the files were read
    offsets_N: tuple[float, float] = (0.0, 0.0)
    doubtful: bool = False  # these readings do not stand out from their doubt, and are not kept for reading files
    # error of the scenario's own law, static or of the chain, simulated again [% of range]; None where none was fitted
    percent: float | None = None
    judged_percent: float | None = None  # the same on the validation files; None without
    # what the chain of the scenario leaves where a capstan law was fitted [% of range]; None where nothing drives it
    chain_percent: float | None = None


def carried_on(study: Study, law: DynamicFit | StaticFit) -> Fitted:
    """The scenario with the values of the law that won, and its own error: that of the file, read back.

    What a cell reads at zero is part of that only where the file has it.
    """
    scenario, records, judges = study.scenario, study.records, study.judges
    if isinstance(law, DynamicFit):
        fitted = scenario_of_chain(scenario, law, records)
    else:
        fitted = scenario_of_static(scenario, law, records, static_only=study.asked.static_only)
    how = fitted.scenario.measurement
    if how != scenario.measurement:
        joints, delay = scenario.transmission.joints, study.delay
        shift_s = delay.seconds if delay is not None and delay.identified else 0.0
        records, judges = (
            [earlier(clean(read_measurement(file, how, joints), how), shift_s) for file in files]
            for files in (study.asked.files, study.asked.judging)
        )
    bare = replace(fitted, offsets_N=(0.0, 0.0))

    def percent(some: Sequence[Record]) -> float | None:
        if not some:
            return None
        if isinstance(law, DynamicFit):
            return _percent(_chain_of(bare, law.explain), some)
        return percent_of(static_law_of(bare, law, mean_pose(some)), some)

    return replace(fitted, percent=percent(records), judged_percent=percent(judges))


def scenario_of_chain(scenario: Scenario, fit: DynamicFit, records: Sequence[Record]) -> Fitted:
    """The scenario with all values of a fitted chain: they were fitted together and belong together."""
    changed = replace(scenario, transmission=put_into(scenario.transmission, fit.model, fit.values))
    return _fitted(changed, fit.model.level, (fit.values[D.INPUT_BIAS], fit.values[D.OUTPUT_BIAS]), records)


def scenario_of_static(scenario: Scenario, fit: StaticFit, records: Sequence[Record], *, static_only: bool) -> Fitted:
    """The scenario with all values of a fitted capstan law, at the fidelity level whose chain comes closest."""
    t, values = scenario.transmission, fit.values
    f, lines = t.friction, exponent_lines(t, mean_pose(records))
    pull, release = (line.mu(a) for line, a in zip(lines, in_gross_sliding(values), strict=True))
    ratio = f.mu_static / f.mu_dynamic if f.mu_dynamic > 0 else 1.0
    friction = replace(
        replace(f, load_exponent=None, reference_tension_N=None),
        mu_dynamic=pull,
        mu_static=ratio * pull,
        mu_dynamic_release=release,
        mu_static_release=ratio * release,
        adhesion_N=max(values[P.ADHESION], 0.0),
        **_stated("friction", fit),
    )
    if fit.model.presliding:
        friction = replace(friction, soft_bristle_stiffness_N_per_m=values[P.BRISTLE])
    how = replace(
        scenario.measurement,
        explain=fit.explain if fit.explain is Explain.INPUT else scenario.measurement.explain,
        guide_zero_m=fit.middle_m if values[P.GUIDE] else None,
        **_stated("measurement", fit),
    )
    changed = replace(scenario, transmission=replace(t, friction=friction), measurement=how)
    biases = (P.INPUT_BIAS, P.OUTPUT_BIAS)
    offsets = (values[P.INPUT_BIAS], values[P.OUTPUT_BIAS])
    doubtful = not all(fit.stands_out(bias) for bias in biases if bias in fit.solution.values)
    own = scenario.run.level
    driven = static_only or fit.explain is Explain.INPUT or any(r.signed for r in records)
    levels = [Level.PRESLIDING] if fit.model.presliding else [own] if driven else [own, Level.VISCOELASTIC]
    tried = [_fitted(changed, level, offsets, records, doubtful=doubtful) for level in dict.fromkeys(levels)]
    if driven:
        return tried[0]
    left = [_percent(_chain_of(found, fit.explain), records) for found in tried]
    best = min(range(len(tried)), key=left.__getitem__)
    return replace(tried[best], chain_percent=left[best])


def _stated(table: str, fit: StaticFit) -> dict[str, Any]:
    """Keys of a table of the scenario that a fitted capstan law states; None where it has no such effect."""
    keys: dict[str, Any] = {}
    for parameter in P:
        value, term = fit.values[parameter], parameter.spec
        own = {term.key: None if value == term.neutral else value} if term.key else {}
        keys |= own | (dict(term.beside_keys) if value != term.neutral else {})
    return {key.partition(".")[2]: value for key, value in keys.items() if key.startswith(f"{table}.")}


def static_law_of(fitted: Fitted, fit: StaticFit, joint_rad: Mapping[str, float] = NO_JOINTS) -> StaticFit:
    """The capstan law that a fitted scenario holds, of the kind of `fit`, from its own keys; the joints' angles."""
    t, how = fitted.scenario.transmission, fitted.scenario.measurement
    law, friction = CapstanLaw.of(t, joint_rad), t.friction
    values = {
        P.PULL: -middle_exponent(-law.pull_exponent, law.pull_spread),
        P.RELEASE: middle_exponent(law.release_exponent, law.release_spread),
        P.PULL_SPREAD: law.pull_spread,
        P.RELEASE_SPREAD: law.release_spread,
        P.ADHESION: law.adhesion_N,
        P.INPUT_BIAS: fitted.offsets_N[0],
        P.OUTPUT_BIAS: fitted.offsets_N[1],
    }
    tables = {"friction": friction, "measurement": how}
    for parameter in P:
        table, _, key = parameter.spec.key.partition(".")
        if key and parameter not in values:
            values[parameter] = getattr(tables[table], key) or parameter.spec.neutral
    if fit.model.presliding:
        values[P.BRISTLE] = friction.soft_bristle_stiffness_N_per_m
    return replace(
        fit, values={**NEUTRAL, **values}, middle_m=fit.middle_m if how.guide_zero_m is None else how.guide_zero_m
    )


def with_drive(scenario: Scenario, estimates: Sequence[Estimate]) -> Scenario:
    """The scenario with another dry friction of the drive and its gear."""
    found = {f"actuator.{each.name}": each.value for each in estimates}
    return replace(scenario, transmission=with_numbers(scenario.transmission, found))


def _fitted(
    scenario: Scenario,
    level: Level,
    offsets_N: tuple[float, float],
    records: Sequence[Record],
    *,
    doubtful: bool = False,
) -> Fitted:
    """The scenario with its level; what the cells read at zero becomes part of how files are read, if it is sure."""
    how = scenario.measurement
    if any(offsets_N) and not doubtful and not any(r.zeroed for r in records):
        before = (how.input_offset_N or 0.0, how.output_offset_N or 0.0)
        how = replace(how, input_offset_N=before[0] + offsets_N[0], output_offset_N=before[1] + offsets_N[1])
    run = replace(scenario.run, level=level)
    return Fitted(
        scenario=replace(scenario, name=f"{scenario.name}, fitted", run=run, measurement=how),
        offsets_N=offsets_N,
        doubtful=doubtful,
    )


def _chain_of(fitted: Fitted, explain: Explain) -> ChainLaw:
    """The chain that a fitted scenario holds, with its own number of masses."""
    t = fitted.scenario.transmission
    model = ParametricChain(
        transmission=t, level=fitted.scenario.run.level, count=t.path.segments, longest_step_s=TUNED.fine_step_s
    )
    offsets = dict(zip((D.INPUT_BIAS, D.OUTPUT_BIAS), fitted.offsets_N, strict=True))
    return ChainLaw(model=model, values=model.values() | offsets, explain=explain)


def _percent(law: ChainLaw, records: Sequence[Record]) -> float:
    """Error of a chain in percent of range; infinite where it fails."""
    try:
        return percent_of(law, records)
    except SolveError:
        return float("inf")
