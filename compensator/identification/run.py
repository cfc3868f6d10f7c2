"""`identify`: parameters of a transmission, with confidence intervals, from measured files."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.estimates import dynamic_estimates, static_estimates
from tendonff.compensator.identification.fitting import dynamic, tendon
from tendonff.compensator.identification.fitting.model_selection import StaticSelection, choose_explain, select_static
from tendonff.compensator.identification.fitting.residuals import fit_pieces
from tendonff.compensator.identification.fitting.sliding_ratio import SlidingRatio, sliding_ratios
from tendonff.compensator.identification.fitting.static import FileError, errors_of, middle_of, pooled_percent, respond
from tendonff.compensator.identification.identifiability import summarise_excitation
from tendonff.compensator.identification.measured.cleaning import Record, clean
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.identification.measured.smoothing import low_pass
from tendonff.compensator.identification.measured.units import magnitude_warning, unit_warnings
from tendonff.compensator.identification.output import Identification
from tendonff.compensator.identification.result import (
    POOR_PERCENT,
    CandidateLaw,
    FileResult,
    PieceComparison,
)
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.static import StaticParameter

P, D = StaticParameter, DynamicParameter

NOT_IN_A_SCENARIO = (P.INPUT_BIAS.value, P.OUTPUT_BIAS.value, P.GUIDE.value)

MOST_ALIKE = 3
"""So many files may each have a line about the same kind of data issue."""


def _quiet(_: str) -> None:
    pass


def identify(
    scenario: Scenario,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    static_only: bool = False,
    say: Callable[[str], None] = _quiet,
) -> Identification:
    """Fit the scenario's transmission to measured files.

    Parameters
    ----------
    scenario : Scenario
        Path, masses and load are taken from it, and every value that is not identifiable from the data; its table
        [measurement] says how the files are to be read.
    data : sequence of str or path
        Files to fit.
    validate : sequence of str or path, optional
        Files that decide which law is chosen; without them the last third of each file of `data` does.
    static_only : bool, optional
        Stop after the static stage.
    say : callable, optional
        Told what is being done.

    Raises
    ------
    InputError
        If a file cannot be used.
    """
    if not data:
        raise InputError("no measured file given; name at least one with --data")
    if scenario.transmission.path.total_angle_rad == 0:
        raise InputError(
            "total_angle_rad is 0: without a wrap angle friction has no coefficient; give the path's angle"
        )
    fitted, judging = [Path(file) for file in data], [Path(file) for file in validate]
    if twice := sorted({p.name for p in fitted if p.resolve() in {v.resolve() for v in judging}}):
        raise InputError(f"{', '.join(twice)}: given with --data and with --validate; a file cannot judge its own fit")
    how = scenario.measurement
    say("reading")
    records = [clean(read_measurement(path, how), how) for path in fitted]
    judges = [clean(read_measurement(path, how), how) for path in judging]
    warnings = [*unit_warnings(how, _positions_of(records)), *_issues_of([*records, *judges])]
    foreign = _foreign(scenario, records)
    warnings += [foreign] if foreign else []
    gross = sliding_ratios(records)
    say("first look")
    explain, coarse = choose_explain(records, how.explain, scenario.transmission)
    say("static stage")
    stage = select_static(records, judges, explain)
    chain: dynamic.DynamicFit | None = None
    if coarse is not None and not static_only and coarse.percent < 3 * POOR_PERCENT:
        start = _start(scenario, stage)
        try:
            if all(r.has_positions for r in records):
                say("tendon stage")
                lengths = tendon.fit_tendon(records, stage.fit.values, scenario.transmission.tendon)
                if lengths.explained >= tendon.EXPLAINED_ENOUGH:
                    coarse = _better(coarse, dynamic.fit_coarse(records, scenario.transmission, _with(start, lengths)))
            chain = dynamic.fit_dynamic(coarse, start, validation=judges, biases=_biased(stage, records), say=say)
            answer = _Answer(records, judges, stage, chain)
        except SolveError as error:
            warnings.append(f"the dynamic stage found no answer ({error}); the static law is reported")
            chain = None
    if chain is None:
        answer = _Answer(records, judges, stage, None)
    left = answer.judged_percent if answer.validation_percent is None else answer.validation_percent
    described = left <= POOR_PERCENT
    if not described:
        warnings.append(_no_law(left, stage, gross, records))
    now = summarise_excitation(records)
    if chain is not None:
        estimates, names, correlation = dynamic_estimates(scenario, chain, now, described=described)
    else:
        estimates, names, correlation = static_estimates(scenario, stage, now, described=described)
    lost = [e.name for e in estimates if e.identifiable and e.name in NOT_IN_A_SCENARIO]
    if described and lost:
        warnings.append(
            f"a scenario has no key for {', '.join(lost)}: fitted.toml leaves them out, and so does a design with it; "
            "subtract a cell's offset from its readings, add the guide's friction force by hand"
        )
    return Identification(
        scenario=_fitted(scenario, {e.name: e.value for e in estimates if e.identifiable}, described=described),
        explain=explain,
        law=answer.law,
        described=described,
        estimates=estimates,
        correlation_names=names,
        correlation=correlation,
        laws=answer.laws,
        files=answer.files,
        fit_percent=answer.fit_percent,
        validation_percent=answer.validation_percent,
        gross=gross,
        warnings=tuple(warnings),
        comparisons=answer.comparisons,
        inputs=(*fitted, *judging),
        comparable=foreign is None,
    )


def _positions_of(records: Sequence[Record]) -> list[str]:
    """Which positions were read in every file."""
    ends = (("input_position", "input_m"), ("output_position", "output_m"))
    return [key for key, name in ends if all(getattr(r.pieces[0], name) is not None for r in records)]


def _foreign(scenario: Scenario, records: Sequence[Record]) -> str | None:
    """What to say where the measured tensions are far from those of the scenario."""
    largest = max(float(np.abs(r.joined(name)).max()) for r in records for name in ("input_N", "output_N"))
    return magnitude_warning(largest, scenario.transmission.actuator.force_max_N)


def _issues_of(records: Sequence[Record]) -> list[str]:
    """What was found in the files, one line each; a kind that many files share takes one line for all of them."""
    lines = []
    for issue in DataIssue:
        found = [(r.name, f.text) for r in records for f in r.findings if f.issue is issue]
        if issue is DataIssue.SKIPPED or not found:
            continue
        files = len({name for name, _ in found})
        if files <= MOST_ALIKE:
            lines += [f"{name}: {text}" for name, text in found]
        else:
            name, text = found[0]
            lines.append(
                f"{issue} in {files} files; {name}: {text.removeprefix(f'{issue}: ')} (the others are in fit.json)"
            )
    return lines


def _start(scenario: Scenario, stage: StaticSelection) -> dict[DynamicParameter, float]:
    """What the static stage hands on."""
    theta, values = scenario.transmission.path.total_angle_rad, stage.fit.values
    return {
        D.MU_PULL: max(values[P.PULL] / theta, 1e-4),
        D.MU_RELEASE: max(values[P.RELEASE] / theta, 1e-4),
        D.ADHESION: values[P.ADHESION],
    }


def _with(start: dict[DynamicParameter, float], lengths: tendon.TendonFit) -> dict[DynamicParameter, float]:
    return start | {D(name): value for name, value in lengths.values.items()}


def _better(one: dynamic.CoarseFit, other: dynamic.CoarseFit) -> dynamic.CoarseFit:
    return one if one.solution.cost <= other.solution.cost else other


def _biased(stage: StaticSelection, records: Sequence[Record]) -> bool:
    """The static law wants a bias of the input cell beyond its doubt."""
    name = P.INPUT_BIAS.value
    if name not in stage.fit.solution.values:
        return False
    size = abs(stage.fit.solution.values[name])
    span = max(float(np.ptp(r.joined("input_N"))) for r in records)
    return size > 3 * stage.fit.solution.standard_error(name) and size > 0.005 * span


def _no_law(left: float, stage: StaticSelection, gross: Sequence[SlidingRatio], records: Sequence[Record]) -> str:
    shown = [
        f"{g.branch} {g.log_ratio:.3g} ({g.interval[0]:.3g} to {g.interval[1]:.3g})"
        for g in gross
        if g.log_ratio is not None and g.interval is not None
    ]
    ratios = f"; ln(T_in/T_out) in gross sliding: {', '.join(shown)}" if shown else ""
    return (
        f"no law explains these files: the best, {stage.fit.model.name}, has an RMS error of {left:.3g} % of "
        f"range (more than {POOR_PERCENT:g} %). A transmission driven at its input end alone behaves differently: "
        f"is the output end, or the path itself, driven? No value was taken over into the fitted scenario{ratios}"
        f"{_positions_wanted(records)}"
    )


def _positions_wanted(records: Sequence[Record]) -> str:
    """What would let a law for a driven output be tried, where it was not."""
    if all(r.has_input_position for r in records):
        return ""
    unread = sorted({name for r in records for name in r.unread})
    offered = f" (columns not read: {', '.join(unread)})" if unread else ""
    return (
        "; laws for a driven output need the motion of the input end, which was not read: name it with "
        f"--input-position-column{offered}"
    )


class _Answer:
    """Errors, laws and comparisons of the final law."""

    def __init__(
        self,
        records: Sequence[Record],
        judges: Sequence[Record],
        stage: StaticSelection,
        chain: dynamic.DynamicFit | None,
    ) -> None:
        self._stage, self._chain = stage, chain
        self._explain = stage.fit.explain
        self._middle = middle_of(records)
        fitted, judged = self._errors(records), self._errors(judges)
        self.files = (
            *(FileResult(role="fit", error=e, findings=r.findings) for e, r in zip(fitted, records, strict=True)),
            *(FileResult(role="validate", error=e, findings=r.findings) for e, r in zip(judged, judges, strict=True)),
        )
        self.fit_percent = pooled_percent(fitted, records, self._explain)
        self.validation_percent = pooled_percent(judged, judges, self._explain) if judges else None
        self.laws: tuple[CandidateLaw, ...] = stage.laws
        self.law = stage.fit.model.name
        self.judged_percent = stage.validation_percent
        if chain is not None:
            span = max(float(np.ptp(np.concatenate([r.joined("output_N") for r in records]))), 1e-300)
            found = [
                CandidateLaw(
                    name=law.name,
                    stage="dynamic",
                    free_values=law.size,
                    fit_percent=100 * law.fit_rms_N / span,
                    validation_percent=100 * law.validation_rms_N / span,
                    chosen=law.chosen,
                )
                for law in chain.laws
            ]
            self.laws = (*(replace(law, chosen=False) for law in stage.laws), *found)
            chosen = next(law for law in found if law.chosen)
            self.law, self.judged_percent = chosen.name, chosen.validation_percent
        self.comparisons = tuple(
            piece
            for role, some in (("fit", records), ("validate", judges))
            for r in some
            for piece in self._curves(r, role)
        )

    def _errors(self, records: Sequence[Record]) -> tuple[FileError, ...]:
        if not records:
            return ()
        if self._chain is not None:
            return dynamic.errors_of(self._chain, records)
        return errors_of(self._stage.fit, records, self._middle)

    def _curves(self, record: Record, role: str) -> list[PieceComparison]:
        found = []
        for run, piece in zip(fit_pieces([record]), record.pieces, strict=True):
            moved = modelled = None
            if self._chain is not None:
                response = self._chain.model.respond(self._chain.values, run.drive)
                model = low_pass(response.output_N, record.step_s, record.cutoff_Hz)
                if record.has_positions:
                    moved = run.elongation - run.elongation.mean()
                    modelled = low_pass(response.elongation_m, record.step_s, record.cutoff_Hz)
                    modelled = modelled - modelled.mean()
            else:
                model = respond(self._stage.fit.values, piece, self._explain, self._middle).prediction_N
            found.append(
                PieceComparison(
                    name=record.name,
                    role=role,
                    time_s=piece.time_s,
                    input_N=piece.input_N,
                    output_N=piece.output_N,
                    model_N=model,
                    elongation_m=moved,
                    model_elongation_m=modelled,
                )
            )
        return found


def _fitted(scenario: Scenario, values: dict[str, float], *, described: bool) -> Scenario:
    """The scenario with the identified values; ratios of what was not identified to what was stay as they are."""
    if not described or not values:
        return scenario
    t = scenario.transmission
    f = t.friction
    mu = values.get("mu_dynamic", f.mu_dynamic)
    release = values.get("mu_dynamic_release", f.release_dynamic)
    ratio = f.mu_static / f.mu_dynamic if f.mu_dynamic > 0 else 1.0
    release_ratio = f.release_static / f.release_dynamic if f.release_dynamic > 0 else ratio
    friction = replace(
        f,
        mu_dynamic=mu,
        mu_static=max(values.get("mu_static", ratio * mu), mu),
        mu_dynamic_release=release,
        mu_static_release=max(values.get("mu_static_release", release_ratio * release), release),
        soft_bristle_stiffness_N_per_m=values.get("soft_bristle_stiffness_N_per_m", f.soft_bristle_stiffness_N_per_m),
        **{k: values.get(k, getattr(f, k)) for k in ("stribeck_velocity_m_per_s", "viscous_N_s_per_m", "adhesion_N")},
    )
    names = ("stiffness_N_per_m", "relaxing_stiffness_N_per_m", "relaxation_time_s", "damping_N_s_per_m")
    cable = replace(t.tendon, **{k: values.get(k, getattr(t.tendon, k)) for k in names})
    level = Level.PRESLIDING if "soft_bristle_stiffness_N_per_m" in values else scenario.run.level
    return replace(
        scenario,
        name=f"{scenario.name}, fitted",
        transmission=replace(t, friction=friction, tendon=cable),
        run=replace(scenario.run, level=level),
    )
