"""`identify`: parameters of a transmission, with confidence intervals, from measured files."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.progress import DOUBT
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification import messages
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.estimates import estimates_of, summarise_excitation
from tendonff.compensator.identification.fitting import tendon
from tendonff.compensator.identification.fitting.delay import Delay, align, earlier
from tendonff.compensator.identification.fitting.drive import drive_estimate
from tendonff.compensator.identification.fitting.dynamic import DynamicFit, fit_coarse, fit_dynamic
from tendonff.compensator.identification.fitting.model_selection import StaticSelection, choose_explain, select_static
from tendonff.compensator.identification.fitting.sliding import friction_by_section, sliding_ratios
from tendonff.compensator.identification.fitting.static import StaticFit
from tendonff.compensator.identification.fitting.uncertainty import between_files
from tendonff.compensator.identification.measured.cleaning import Record, clean, joints_of, mean_pose
from tendonff.compensator.identification.measured.plan import (
    check_plan,
    check_question,
    data_doubts,
    magnitude_warning,
    unit_warning,
)
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.outcome import Fitted, Outcome, carried_on, compared, outcome_of, with_coulomb
from tendonff.compensator.identification.output import Identification
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.identification.result import CandidateLaw
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import exponent_lines
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.static import StaticParameter

P, D = StaticParameter, Parameter

STILL_RAD = 0.05
"""A joint whose angle has less range than this stands still."""


def identify(
    scenario: Scenario,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    static_only: bool = False,
    conditions: Mapping[str, str] | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
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
    conditions : mapping of str to str, optional
        Labels by file name: estimates are told for each label.
    say, confirm : callable, optional
        Told what is being done; asked before a fit that takes very many steps (the default declines).

    Raises
    ------
    InputError
        If a file cannot be used.
    """
    fit_files, judging = [Path(file) for file in data], [Path(file) for file in validate]
    check_question(scenario, fit_files, judging)
    how, theta = scenario.measurement, scenario.transmission.path.total_angle_rad
    raw = [read_measurement(path, how, scenario.transmission.joints) for path in (*fit_files, *judging)]
    check_plan(raw, how, static_only=static_only, say=say, confirm=confirm)
    everything = [clean(one, how) for one in raw]
    records: Sequence[Record] = everything[: len(fit_files)]
    judges = everything[len(fit_files) :]
    _check_common_friction(scenario, records)
    if static_only:
        _check_rest(everything)
    doubts = [unit_warning(how, _positions_of(records)), *data_doubts(raw, how.explain)]
    for doubt in filter(None, doubts):
        say(f"{DOUBT}{doubt}")
    warnings = [*doubts, *messages.about_issues(everything)]
    foreign = _foreign(scenario, records)
    if _proximal(scenario, everything, static_only=static_only):
        fits = _fit_proximal(scenario, records, judges, say)
    else:
        fits = _fit(scenario, records, judges, static_only=static_only, say=say)
    records = fits.records
    warnings += [foreign, fits.warning]
    laws = compared(fits.stage, fits.chain, records)
    law = fits.chosen(laws, scenario.transmission.friction.adhesion_N)
    chain = law if isinstance(law, DynamicFit) else None
    outcome = outcome_of(law, records, fits.judges)
    told = between_files(chain.files, chain.values, records, conditions or {}) if chain is not None else ((), [])
    warnings += [*told[1], messages.about_delay(fits.delay), messages.about_moments(outcome)]
    sliding = sliding_ratios(records)
    failure = _failure(outcome)
    if failure:
        warnings.append(messages.about_no_law(laws, failure, sliding, records))
    now = summarise_excitation(records)
    estimates, names, correlation = estimates_of(scenario, law, now, described=not failure, static_only=static_only)
    fitted = Fitted(scenario=scenario)
    if not failure:
        say("replay of the fitted scenario")
        fitted = carried_on(scenario, law, records, static_only=static_only)
        warnings += messages.about_fitted(fitted, records)
        warnings += [messages.about_uneven_path(chain, theta), "" if chain is None else chain.caution]
    sections = friction_by_section(fit_files, how, theta, fitted.scenario.transmission.friction.adhesion_N)
    of_drive = drive_estimate(scenario, raw[: len(fit_files)])
    if of_drive is not None:
        estimates = (*estimates, of_drive)
        fitted = replace(fitted, scenario=with_coulomb(fitted.scenario, of_drive.value))
    return Identification(
        scenario=fitted.scenario,
        explain=law.explain,
        described=not failure,
        estimates=estimates,
        correlation_names=names,
        correlation=correlation,
        laws=laws,
        files=outcome.files,
        fit_percent=outcome.fit_percent,
        replay_percent=fitted.percent,
        validation_percent=outcome.validation_percent,
        comparisons=outcome.comparisons,
        sliding=sliding,
        warnings=tuple(filter(None, warnings)),
        inputs=(*fit_files, *judging),
        by_file=told[0],
        sections=sections,
        output_delay_s=None if fits.delay is None else fits.delay.seconds,
        comparable=not foreign,
    )


def _proximal(scenario: Scenario, records: Sequence[Record], *, static_only: bool) -> bool:
    """Nothing is compared at the far end: the output tension was not measured, or its position is to be explained."""
    without = [r.name for r in records if not r.has_output]
    if without and len(without) < len(records):
        raise InputError(
            f"{', '.join(without)}: no output tension, which the other files have; fit them apart, or leave it out of "
            'all with explain = "position"'
        )
    if not without and scenario.measurement.explain is not Explain.POSITION:
        return False
    if static_only:
        raise InputError("the static law needs the output tension; without it leave --static out")
    if not all(r.has_input_position for r in records):
        raise InputError(
            "without the output tension the position of the input end is needed; name it with --input-position-column"
        )
    return True


def _check_common_friction(scenario: Scenario, records: Sequence[Record]) -> None:
    """Refuse a path on which the coefficients that are looked for act nowhere."""
    if not all(line.angle_rad > 0 for line in exponent_lines(scenario.transmission, mean_pose(records))):
        raise InputError(
            "every section that touches has friction of its own, so that [friction] mu_dynamic acts nowhere; leave "
            "mu_dynamic out of the sections whose friction is to be found"
        )


def _check_rest(records: Sequence[Record]) -> None:
    """Refuse, for the static law, a path that joints move."""
    for record in records:
        for name, angle in joints_of([record]).items():
            low, high = np.percentile(angle, [1, 99])
            if high - low > STILL_RAD:
                raise InputError(
                    f"{record.name}: {name} moves by {high - low:.2g} rad, the static law knows no path that moves; "
                    "leave --static out, or log with the joints at rest"
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fits:
    """What was fitted, and to which records: a delay of the output is taken out of them."""

    records: Sequence[Record]
    judges: Sequence[Record]
    stage: StaticSelection | None = None  # None where nothing was measured at the far end
    chain: DynamicFit | None = None  # None where it was not tried, or failed
    delay: Delay | None = None
    warning: str = ""

    def chosen(self, laws: Sequence[CandidateLaw], adhesion_N: float) -> DynamicFit | StaticFit:
        """The law that won; a static one with its doubt, and with the scenario's adhesion where it tells none."""
        dynamic = any(law.chosen and law.stage == "dynamic" for law in laws)
        if self.stage is not None and not dynamic:
            return self.stage.reported(adhesion_N)
        if self.chain is None:
            raise InputError("no law could be fitted to these files")
        return self.chain


def _fit_proximal(
    scenario: Scenario, records: Sequence[Record], judges: Sequence[Record], say: Callable[[str], None]
) -> _Fits:
    """The chain between the measured input tension and the scenario's load, against the position of the input end."""
    say("first look")
    coarse = fit_coarse(records, scenario.transmission, {}, Explain.POSITION)
    warning = (
        "nothing was measured at the far end: the load is the scenario's, "
        f"{scenario.transmission.load.stiffness_N_per_m:g} N/m; an error of it goes into the estimates"
    )
    chain = fit_dynamic(coarse, {}, validation=judges, say=say)
    return _Fits(records=records, judges=judges, chain=chain, warning=warning)


def _fit(
    scenario: Scenario,
    records: Sequence[Record],
    judges: Sequence[Record],
    *,
    static_only: bool,
    say: Callable[[str], None],
) -> _Fits:
    """Static law, and the chain where it can be tried."""
    transmission = scenario.transmission
    say("first look")
    explain, coarse = choose_explain(records, scenario.measurement.explain, transmission, static_only=static_only)
    delay: Delay | None = None
    given = records
    if coarse is not None and explain is Explain.OUTPUT and coarse.percent < TUNED.poor_percent:
        delay, coarse, records = align(records, coarse, transmission)
        if delay.told:
            given, judges = ([earlier(r, delay.seconds) for r in some] for some in (given, judges))
    say("static stage")
    stage = select_static(records, judges, explain)
    fits = _Fits(records=given, judges=judges, stage=stage, delay=delay)
    if coarse is None or coarse.percent >= 3 * TUNED.poor_percent:
        return fits
    start = _start(scenario, stage, mean_pose(records))
    try:
        if all(r.has_positions for r in records):
            say("tendon stage")
            found, explained = tendon.fit_tendon(records, stage.fit.values, transmission.tendon)
            if explained >= TUNED.explained_enough:
                near = start | {D.BRISTLE: coarse.solution.values[D.BRISTLE]}
                near |= {D(k): v for k, v in found.items()}
                other = fit_coarse(records, transmission, near, several=False)
                coarse = min(coarse, other, key=lambda c: c.solution.cost)
        biases, offsets = _biased(stage, records), not any(r.zeroed for r in records)
        chain = fit_dynamic(coarse, start, validation=judges, biases=biases, offsets=offsets, say=say)
    except SolveError as error:
        return replace(fits, warning=f"the dynamic stage found no answer ({error}); the static law is reported")
    return replace(fits, chain=chain)


def _positions_of(records: Sequence[Record]) -> list[str]:
    """Which positions were read in every file."""
    ends = (("input_position", "input_m"), ("output_position", "output_m"))
    return [key for key, name in ends if all(getattr(r.pieces[0], name) is not None for r in records)]


def _foreign(scenario: Scenario, records: Sequence[Record]) -> str:
    """What to say where the measured tensions are far from those of the scenario; empty where they are not."""
    names = ("input_N", "output_N") if all(r.has_output for r in records) else ("input_N",)
    largest = max(float(np.abs(r.joined(name)).max()) for r in records for name in names)
    return magnitude_warning(largest, scenario.transmission.actuator.force_max_N)


def _start(scenario: Scenario, stage: StaticSelection, joint_rad: Mapping[str, float]) -> dict[Parameter, float]:
    """What the static stage hands on."""
    values = stage.fit.values
    pull, release = exponent_lines(scenario.transmission, joint_rad)
    return {
        D.MU_PULL: max(pull.mu(values[P.PULL]), 1e-4),
        D.MU_RELEASE: max(release.mu(values[P.RELEASE]), 1e-4),
        D.ADHESION: values[P.ADHESION],
    }


def _biased(stage: StaticSelection, records: Sequence[Record]) -> bool:
    """The static law wants a bias of the input cell beyond its doubt."""
    name = P.INPUT_BIAS.value
    if name not in stage.fit.solution.values:
        return False
    size = abs(stage.fit.solution.values[name])
    span = max(float(np.ptp(r.joined("input_N"))) for r in records)
    return size > 3 * stage.fit.solution.standard_error(name) and size > 0.005 * span


def _failure(outcome: Outcome) -> str:
    """Why the law does not describe the device, by the errors that are printed; empty where it does."""
    for percent, which in ((outcome.fit_percent, "fitted"), (outcome.validation_percent, "validation")):
        if percent is not None and not percent <= TUNED.poor_percent:
            return f"an RMS error of {percent:.3g} % of range on {which} files (more than {TUNED.poor_percent:g} %)"
    widest = max(f.error.span for f in outcome.files)
    poor = [
        f for f in outcome.files if f.error.percent > TUNED.poor_percent and f.error.rms > TUNED.small_share * widest
    ]
    if poor:
        worst = max(poor, key=lambda f: f.error.percent)
        return (
            f"an RMS error of {worst.error.percent:.3g} % of its own range on {worst.error.name} (more than "
            f"{TUNED.poor_percent:g} %; {len(poor)} of {len(outcome.files)} files)"
        )
    return ""
