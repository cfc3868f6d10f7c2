"""Identification of one tendon, from what was measured at its ends."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.files.progress import DOUBT
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.answer import messages
from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.estimates import estimates_of, of_gains, summarise_excitation
from tendonff.compensator.identification.fitting import tendon
from tendonff.compensator.identification.fitting.channels import check_channels
from tendonff.compensator.identification.fitting.delay import align, earlier
from tendonff.compensator.identification.fitting.drive import drive_estimates
from tendonff.compensator.identification.fitting.dynamic import DynamicFit, fit_coarse, fit_dynamic
from tendonff.compensator.identification.fitting.model_selection import StaticSelection, choose_explain, select_static
from tendonff.compensator.identification.fitting.sliding import friction_by_section, sliding_ratios
from tendonff.compensator.identification.fitting.static import StaticFit
from tendonff.compensator.identification.fitting.uncertainty import ByFile, between_files
from tendonff.compensator.identification.identify import Request
from tendonff.compensator.identification.measured.cleaning import Record, clean, joints_of, mean_pose
from tendonff.compensator.identification.measured.conditions import STILL_RAD, require_conditions
from tendonff.compensator.identification.measured.doubts import (
    answered,
    column_doubts,
    data_doubts,
    magnitude_warning,
    unit_warning,
)
from tendonff.compensator.identification.measured.gains import gains_of
from tendonff.compensator.identification.measured.plan import (
    check_plan,
    check_question,
    check_signs,
    reversal_doubts,
)
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.identification.outcome import Fitted, Outcome, carried_on, compared, outcome_of, with_drive
from tendonff.compensator.identification.pace import Pace
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.identification.spread import with_other_law, with_spread
from tendonff.compensator.identification.study import Stage, Study, attempted
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import exponent_lines
from tendonff.models.path import SectionKind
from tendonff.ocp.fits.static import StaticParameter

P, D = StaticParameter, Parameter


def fit_tendon(asked: Request[Scenario]) -> Identification[Scenario]:
    """A tendon by the tensions, and the positions, at its ends; InputError if a file cannot be used."""
    study = _read(asked)
    for stage in STAGES:
        study = attempted(stage, study)
    study.pace.end()
    return _answer(study)


def _read(asked: Request[Scenario]) -> Study:
    """Read and clean all files; InputError where the question or a file cannot be used."""
    scenario, confirm, static_only = replace(asked.scenario, measurement=asked.how), asked.confirm, asked.static_only
    check_question(scenario, asked.files, asked.judging)
    how = scenario.measurement
    fitted = len(asked.files)
    require_conditions(how, scenario.transmission.joints, [path.name for path in asked.every], scenario.source.name)
    raw = [read_measurement(path, how, scenario.transmission.joints) for path in asked.every]
    gains = gains_of(raw[:fitted], how)
    raw = [gains.taken_out(one, how) for one in raw]
    how = replace(how, input_gain=_unless_one(gains.input), output_gain=_unless_one(gains.output))
    scenario = replace(scenario, measurement=how)
    run = scenario.run
    clock = (lambda _: True) if "measurement.time_scale" in run.accept else confirm
    announced_s = check_plan(raw, how, static_only=static_only, say=asked.say, confirm=clock)
    everything = [clean(one, how) for one in raw]
    records = everything[:fitted]
    converted = " ".join(each.text for one in raw for each in one.findings if each.issue is DataIssue.UNITS)
    units = [*column_doubts(how, _positions_of(records), converted)]
    units += data_doubts(everything, how, scenario.transmission.actuator.force_max_N)
    accepted = answered(units, run, confirm, file=scenario.source.name)
    check_signs(everything, confirm)
    scenario, turned = _with_bearings_free(scenario)
    _check_common_friction(scenario, records)
    if static_only:
        _check_rest(everything)
    named = unit_warning(how, _positions_of(records), converted)
    doubts = [*accepted, named, *reversal_doubts(everything, how.explain)]
    for doubt in filter(None, doubts):
        asked.say(f"{DOUBT}{doubt}")
    proximal = _proximal(scenario, everything, static_only=static_only)
    if not proximal:
        check_channels(records, how)
    study = Study(
        asked=asked,
        scenario=scenario,
        raw=tuple(raw[:fitted]),
        records=records,
        judges=everything[fitted:],
        pace=Pace(asked.say, announced_s),
        gains=gains,
        explain=Explain.POSITION if proximal else Explain.OUTPUT,
    )
    return study.noted(turned, *doubts, *messages.about_issues(everything), _foreign(scenario, records))


def _unless_one(gain: float) -> float | None:
    """Gain as [measurement] states it: none of a cell without an error."""
    return None if gain == 1 else gain


def first_look(study: Study) -> Study:
    """The channel that the laws explain, the chain's first fit, and the delay of the output."""
    records, transmission = study.records, study.scenario.transmission
    if study.explain is Explain.POSITION:
        stiffness = transmission.load.stiffness_N_per_m
        return replace(study, coarse=fit_coarse(records, transmission, {}, Explain.POSITION, pace=study.pace)).noted(
            f"nothing was measured at the far end: the load is the scenario's, {stiffness:g} N/m; an error of it goes "
            "into the estimates"
        )
    wanted = study.scenario.measurement.explain
    explain, coarse = choose_explain(
        records, wanted, transmission, static_only=study.asked.static_only, pace=study.pace
    )
    return replace(study, explain=explain, coarse=coarse)


def delay_of_the_output(study: Study) -> Study:
    """The study without the delay between its channels, where that is beyond doubt."""
    coarse = study.coarse
    if coarse is None or study.explain is not Explain.OUTPUT or not coarse.percent < TUNED.poor_percent:
        return study
    delay, coarse, _ = align(study.records, coarse, study.scenario.transmission, study.pace)
    found = replace(study, delay=delay, coarse=coarse)
    if delay.identified:
        records, judges = ([earlier(r, delay.seconds) for r in some] for some in (study.records, study.judges))
        found = replace(found, records=records, judges=judges)
    return found.noted(messages.about_delay(delay))


def static_laws(study: Study) -> Study:
    """The static laws, which need both tensions."""
    if study.explain is Explain.POSITION:
        return study
    return replace(study, stage=select_static(study.records, study.judges, study.explain))


def elongation_of_the_tendon(study: Study) -> Study:
    """A nearer start of the chain, where both positions were measured."""
    stage, coarse, records = study.stage, study.coarse, study.records
    if stage is None or coarse is None or not all(r.has_positions for r in records):
        return study
    transmission = study.scenario.transmission
    found = tendon.fit_tendon(records, stage.fit.values, transmission.tendon)
    near = _start(study) | {D.BRISTLE: coarse.solution.values[D.BRISTLE]} | {D(k): v for k, v in found.items()}
    other = fit_coarse(records, transmission, near, several=False, pace=study.pace)
    return replace(study, coarse=min(coarse, other, key=lambda c: c.solution.cost))


def law_of_the_chain(study: Study) -> Study:
    """The chain, where its first fit comes near the data."""
    coarse, records, how = study.coarse, study.records, study.scenario.measurement
    proximal = study.explain is Explain.POSITION
    if coarse is None or (not proximal and coarse.percent >= 3 * TUNED.poor_percent):
        return study
    chain = fit_dynamic(
        coarse,
        records,
        _start(study),
        validation=study.judges,
        biases=study.stage is not None and _biased(study.stage, records),
        gains=study.gains,
        kept_uncertainty=TUNED.kept_uncertainty if how.kept_uncertainty is None else how.kept_uncertainty,
        offsets=not proximal and not any(r.zeroed for r in records),
        begin=study.pace.begin,
    )
    return replace(study, chain=chain)


STAGES: tuple[Stage, ...] = (
    first_look,
    delay_of_the_output,
    static_laws,
    elongation_of_the_tendon,
    law_of_the_chain,
)
"""In this order; each takes what those before it found."""


def _answer(study: Study) -> Identification[Scenario]:
    """The law that explains the files best, what it states, and the scenario that goes on with it."""
    scenario, records, chain = study.scenario, study.records, study.chain
    laws = compared(study.stage, chain, records)
    law: DynamicFit | StaticFit | None = chain
    if study.stage is not None and not any(law.chosen and law.stage == "dynamic" for law in laws):
        law = study.stage.reported(scenario.transmission.friction.adhesion_N, study.gains)
    if law is None:
        raise InputError("; ".join(("no law could be fitted to these files", *study.warnings)))
    chain = law if isinstance(law, DynamicFit) else None
    outcome = outcome_of(law, records, study.judges)
    by_file: tuple[ByFile, ...] = ()
    if chain is not None:
        by_file, differences = between_files(chain.files, chain.values, records)
        study = study.noted(*differences)
    study = study.noted(messages.about_moments(outcome))
    sliding, failure = sliding_ratios(records), _failure(outcome)
    estimates, names, correlation = estimates_of(
        scenario, law, summarise_excitation(records), described=not failure, static_only=study.asked.static_only
    )
    estimates = (*estimates, *of_gains(study.gains))
    fitted = Fitted(scenario=scenario)
    if failure:
        study = study.noted(messages.about_no_law(laws, failure, sliding, records))
    else:
        study.pace.begin("simulation of the fitted scenario")
        fitted = carried_on(study, law)
        uneven = messages.about_uneven_path(chain, scenario.transmission.path.total_angle_rad)
        noise = correlation if chain is None else chain.noise
        known = with_spread(fitted.scenario, estimates, names, correlation, noise)
        other = None if chain is None else chain.with_other_friction(scenario.transmission)
        fitted = replace(fitted, scenario=with_other_law(known, other))
        study = study.noted(
            *messages.about_fitted(fitted, records, outcome.fit_percent),
            uneven,
            messages.about_other_law(chain, records),
            "" if chain is None else chain.caution,
        )
    of_drive = drive_estimates(scenario, study.raw)
    if of_drive:
        estimates = (*estimates, *of_drive)
        fitted = replace(fitted, scenario=with_drive(fitted.scenario, of_drive))
    return Identification(
        asked=study.asked.scenario,
        how=study.asked.how,
        scenario=fitted.scenario,
        explain=law.explain,
        law=next(each.name for each in laws if each.chosen),
        described=not failure,
        estimates=estimates,
        correlation_names=names,
        correlation=correlation,
        laws=laws,
        files=outcome.files,
        fit_percent=outcome.fit_percent,
        replay_percent=fitted.percent,
        replay_validation_percent=fitted.judged_percent,
        validation_percent=outcome.validation_percent,
        channels=outcome.channels,
        sliding=sliding,
        warnings=study.warnings,
        inputs=study.asked.every,
        by_file=by_file,
        sections=friction_by_section(
            study.asked.files,
            scenario.measurement,
            scenario.transmission.path.total_angle_rad,
            fitted.scenario.transmission.friction.adhesion_N,
        ),
        output_delay_s=None if study.delay is None else study.delay.seconds,
        suggests=not _foreign(scenario, records),
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
        raise InputError("the capstan law needs the output tension; without it leave --static out")
    if not all(r.has_input_position for r in records):
        raise InputError(
            "without the output tension the position of the near end is needed; name it with --input-position-column"
        )
    return True


def _check_common_friction(scenario: Scenario, records: Sequence[Record]) -> None:
    """Refuse a path on which the coefficients that are looked for act nowhere."""
    if not all(line.angle_rad > 0 for line in exponent_lines(scenario.transmission, mean_pose(records))):
        raise InputError(
            "every section that touches has friction of its own, so that [friction] mu_dynamic acts nowhere; leave "
            "mu_dynamic out of the sections whose friction is to be found"
        )


def _with_bearings_free(scenario: Scenario) -> tuple[Scenario, str]:
    """A path on pulleys alone with the friction of their bearings to be found, and a message; else as it is.

    A bearing acts as an arc of the same angle, so all are fitted by one coefficient.
    """
    t = scenario.transmission
    touching = [part for part in t.path.sections if part.angle_rad > 0 or part.joint is not None]
    if not touching or any(part.bearing_exponent is None for part in touching):
        return scenario, ""
    bearings = math.fsum(part.bearing_exponent or 0.0 for part in touching)
    mu = bearings / math.fsum(part.angle_rad for part in touching)
    sections = tuple(replace(part, kind=SectionKind.ARC, bearing_exponent=None) for part in t.path.sections)
    friction = replace(t.friction, mu_dynamic=mu, mu_static=mu, mu_dynamic_release=None, mu_static_release=None)
    changed = replace(t, path=replace(t.path, sections=sections), friction=friction)
    return replace(scenario, transmission=changed), (
        "the path has pulleys alone: their bearings are fitted as one coefficient mu_dynamic, and fitted.toml has arcs "
        "of the same angles; bearing_exponent of a pulley is mu_dynamic times its angle_rad"
    )


def _check_rest(records: Sequence[Record]) -> None:
    """Refuse, for the capstan law, a path that joints move, or that differs from file to file."""
    for record in records:
        for name, angle in joints_of([record]).items():
            low, high = np.percentile(angle, [1, 99])
            if high - low > STILL_RAD:
                raise InputError(
                    f"{record.name}: {name} moves by {high - low:.2g} rad, the capstan law holds for a path at rest; "
                    "leave --static out, or log with the joints at rest"
                )
    poses = [mean_pose([record]) for record in records]
    for name in poses[0]:
        apart = max(pose[name] for pose in poses) - min(pose[name] for pose in poses)
        if apart > STILL_RAD:
            raise InputError(
                f"{name} stands {apart:.2g} rad apart in these files, the capstan law has one mu theta for all; "
                "leave --static out, or fit the files of each angle by themselves"
            )


def _positions_of(records: Sequence[Record]) -> list[str]:
    """Which positions were read in every file."""
    ends = (("input_position", "input_m"), ("output_position", "output_m"))
    return [key for key, name in ends if all(getattr(r.pieces[0], name) is not None for r in records)]


def _foreign(scenario: Scenario, records: Sequence[Record]) -> str:
    """Message where the measured tensions are far from those of the scenario; empty where they are not."""
    names = ("input_N", "output_N") if all(r.has_output for r in records) else ("input_N",)
    largest = max(float(np.abs(r.joined(name)).max()) for r in records for name in names)
    return magnitude_warning(largest, scenario.transmission.actuator.force_max_N)


def _start(study: Study) -> dict[Parameter, float]:
    """Results of the static stage."""
    if study.stage is None:
        return {}
    values = study.stage.fit.values
    pull, release = exponent_lines(study.scenario.transmission, mean_pose(study.records))
    return {
        D.MU: max(pull.mu(values[P.PULL]), 1e-4),
        D.MU_RELEASE: max(release.mu(values[P.RELEASE]), 1e-4),
        D.ADHESION: values[P.ADHESION],
    }


def _biased(stage: StaticSelection, records: Sequence[Record]) -> bool:
    """The capstan law wants a bias of the input cell beyond its doubt."""
    name = str(P.INPUT_BIAS)
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
    widest = max(e.span for e in outcome.errors)
    poor = [e for e in outcome.errors if e.percent > TUNED.poor_percent and e.rms > TUNED.small_share * widest]
    if poor:
        worst = max(poor, key=lambda e: e.percent)
        return (
            f"an RMS error of {worst.percent:.3g} % of its own range on {worst.name} (more than "
            f"{TUNED.poor_percent:g} %; {len(poor)} of {len(outcome.files)} files)"
        )
    return ""
