"""`tendonff export-c`: a folder of C99 that needs nothing but a compiler."""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.base import CModule, Problem, with_motion
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.live import expect_live, live_headline
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import StreamChoice, choose_stream
from tendonff.compensator.compensators.table import BuiltTable, table_of
from tendonff.compensator.compensators.tuning import certified, check_tuning, learnt, tuning_of
from tendonff.compensator.export.adaptive import NUDGES, AdaptiveGolden, adaptive_golden, adaptive_test
from tendonff.compensator.export.drive import drive_on_host, host_text, test_text
from tendonff.compensator.export.feedback import FEEDBACK_SOURCES, feedback_files
from tendonff.compensator.export.feedback_module import tension_module
from tendonff.compensator.export.golden import Golden, golden_vectors
from tendonff.compensator.export.host import compile_on_host, run_on_host
from tendonff.compensator.export.judgement import Judged, chosen, judge, judge_stream, profiles_of, score_lines
from tendonff.compensator.export.modules import ADAPTIVE, BOUNDS, OBSERVER, c_modules, check_prefix
from tendonff.compensator.export.observer import ObserverDesign, ObserverGolden, observer_golden
from tendonff.compensator.export.repeat import FLOAT_SHARE, InFloat
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.self_test import (
    FloatLoss,
    check_tension,
    float_losses,
    loss_warnings,
    observer_test,
    tension_test,
)
from tendonff.compensator.export.tension.estimating import ObserverTest
from tendonff.compensator.export.tension.modules import record_helper
from tendonff.compensator.export.tension.subject import TensionTest
from tendonff.compensator.export.text.c_text import (
    c_sources,
    drive_text,
    folder_files,
    measured,
    provenance_of,
    table_bytes,
    table_context,
)
from tendonff.compensator.export.text.parameters import parameters_of
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.feedback.tension import tension_task
from tendonff.compensator.files.writing import write_folder
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.compensator.scenario.settings import Adaptation, Stream
from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.joints import Joints


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """Content of an export, before it is written.

    Attributes
    ----------
    files : dict of str to str
        Text by file name.
    built : BuiltTable or None
        None on a path that joints move: no table holds it.
    profile_N : ndarray
        Shape (n,); the exported profile [N].
    judged : tuple of Judged
        Error of each module on the scenario's reference, no compensation first.
    warnings : tuple of str
        What the user should know.
    expectation : Expectation
        Of the exact inverse with a reference that arrives live, over what is uncertain.
    headline : str
        The same in a sentence.
    notes : tuple of str
        What the tuner can identify along the reference, and what it cannot; empty without one.
    """

    files: dict[str, str] = field(repr=False)
    built: BuiltTable | None = field(repr=False)
    profile_N: FloatArray = field(repr=False)
    judged: tuple[Judged, ...]
    warnings: tuple[str, ...]
    expectation: Expectation = field(repr=False)
    headline: str
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.files)} files; {self.headline}>"

    @property
    def lines(self) -> tuple[str, ...]:
        """The judgement as a table for the terminal, and what to expect on a rig."""
        return (*score_lines(self.judged), self.headline)

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write every file, all or nothing; makes the folder."""
        write_folder(self.files, folder)


@in_turn
def export_project(
    scenario: Scenario,
    *,
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    profile_N: FloatArray | None = None,
    force_export: bool = False,
) -> Exported:
    """Print the whole folder; arguments and errors as of `tendonff.export_c`."""
    check_prefix(prefix)
    check_tuning(scenario)
    problem = Problem.of(scenario, level=level)
    drive = scenario.transmission.actuator.drive
    warnings, tension = problem.reference.warnings, problem.reference.tension_N
    if profile_N is None:
        optimal = with_motion(problem, "optimal", compensator("optimal").profile(problem).require())
        profile_N, warnings = optimal.setpoint(drive), (*warnings, *optimal.warnings)
    built = None if scenario.joints else table_of(problem)
    table = None if built is None else built.table
    profiles = profiles_of(problem, built, Profile.of_setpoint(rounded(profile_N, precision), drive))
    if problem.reference.periodic:
        profile_N = profile_N[:-1]  # its last row is the first of the next period
    numbers: dict[str, object] = {
        **({} if built is None else table_context(built, precision)),
        "table_bytes": 0 if table is None else table_bytes(table, precision),
        "profile": profile_N,
        "profile_loops": problem.reference.periodic,
        "profile_bytes": (4 if precision is Precision.FLOAT else 8) * len(profile_N),
    }
    choice = choose_stream(problem, scenario.stream or Stream())
    stream = None if choice is None else choice.picked.design
    golden = golden_vectors(problem, table, precision, stream=stream)
    observed = ObserverDesign(problem=problem)
    seen = observer_golden(observed, golden.course.chain, golden.course.reference_N, precision)
    settings = scenario.adaptation
    bounds = None if settings is None or problem.chain.motion is not None else certified(problem)
    tuned = None if settings is None else adaptive_golden(problem, settings, golden.course, precision, bounds)
    numbers |= {"stream": stream, "bounds": bounds, "observed": observed}
    losses: tuple[FloatLoss, ...] = ()
    found: tuple[InFloat, ...] = ()
    if precision is Precision.FLOAT:
        found = _run_in_float(scenario, problem, golden, seen, tuned, prefix, numbers)
        if found:
            expected = golden.course.columns | {OBSERVER.name: seen.output_N}
            of_tuner = {} if tuned is None else {ADAPTIVE.name: tuned.force_N}
            in_float = {**found[0].course, **dict(zip(of_tuner, found[0].tuner, strict=False))}
            losses = float_losses(replace(golden.course, columns=expected | of_tuner), in_float, problem)
            rows = len(tension)
            last = {module: answer[-rows:] for module, answer in found[0].reference.items()}
            profiles |= {m: problem.applied(m, Profile.of_setpoint(answer, drive)) for m, answer in last.items()}
    judged = judge(problem, profiles)
    judged = (*judged, judge_stream(judged, choice, problem))
    modules, faults = chosen(judged, c_modules(scenario, stream is not None), force_export=force_export)
    expectation = expect_live(problem)
    names, script = [module.name for module in modules], Script(precision=precision, prefix=prefix)
    test = tension_test(problem, table, profile_N, golden, stream, script, names, found)
    own = observer_test(seen, FLOAT_SHARE * scale_of(tension), precision, found)
    checked, notes = _checked(test, own, settings, tuned, found)
    further: dict[str, object] = {
        **numbers,
        **checked,
        "headline": live_headline(expectation, scenario),
        "measured": measured(precision),
        "judged": judged,
        "choice": choice,
        "losses": losses,
    }
    texts = _texts(scenario, problem, modules, precision, prefix, further, script)
    texts["design.json"] = _design_json(
        scenario,
        problem,
        precision,
        prefix,
        built=built,
        profile=profile_N,
        judged=judged,
        losses=losses,
        choice=choice,
        modules=modules,
    )
    warnings = (*warnings, *faults, *loss_warnings(losses), *_late(problem))
    return Exported(
        files=texts,
        built=built,
        profile_N=profile_N,
        judged=judged,
        warnings=warnings,
        expectation=expectation,
        headline=live_headline(expectation, scenario),
        notes=notes,
    )


def _checked(
    test: TensionTest,
    observer: ObserverTest,
    settings: Adaptation | None,
    tuned: AdaptiveGolden | None,
    found: Sequence[InFloat],
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Make all checks; values for the templates, and what the tuner can identify."""
    notes, own = tuple[str, ...](), None
    if settings is not None and tuned is not None:
        problem, answers = test.problem, [answer for run in found for answer in run.tuner]
        notes = learnt(problem, tuning_of(problem, settings)).sentences()
        if ADAPTIVE.name in test.names:  # not where the inverse that it tunes is left out
            own = adaptive_test(problem, settings, test.golden.course, test.script.precision, tuned, answers)
    return {"adaptive": own, "fewer": check_tension(test, observer, own)}, notes


def _texts(
    scenario: Scenario,
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, object],
    script: Script,
) -> dict[str, str]:
    """Every file but design.json, by name; without a C compiler the self test does not call modules at random."""
    fed = _feedback(scenario, problem, modules, precision, prefix)
    further = {**further, "tested": ["feedback"], "beside": FEEDBACK_SOURCES} if fed else further
    sources = c_sources(scenario, problem, modules, precision, prefix, further)
    drive = drive_text(scenario, problem, modules, precision, prefix, further)
    code = compile_on_host(sources, host_text(drive, prefix, [module.name for module in modules]), precision)
    tested = test_text(drive, prefix, None if code is None else drive_on_host(code, precision))
    headers = [f"{prefix}_{module.name}.h" for module in modules]
    headers += [f"{prefix}_table_data.h"] if "table" in {module.name for module in modules} else []
    test = script.text(
        headers,
        provenance_of(scenario, problem.level, precision, prefix),
        helpers=record_helper(prefix, [parameter.name for parameter in parameters_of(problem)]),
        drive=tested,
    )
    return sources | fed | test | folder_files(scenario, problem, modules, precision, prefix, further)


def _feedback(
    scenario: Scenario, problem: Problem, modules: Sequence[CModule], precision: Precision, prefix: str
) -> dict[str, str]:
    """Files of the feedback where the scenario asks for it, beside the inverse that it corrects."""
    if scenario.feedback is None or "inverse" not in {module.name for module in modules}:
        return {}
    module = tension_module(tension_task(problem, scenario.feedback, scenario.source.name))
    provenance = provenance_of(scenario, problem.level, precision, prefix)
    return feedback_files(module, prefix=prefix, precision=precision, provenance=provenance)


def _late(problem: Problem) -> tuple[str, ...]:
    """The time by which the output stays late, since exported modules but the profile do not know the drive."""
    late = problem.transmission.actuator.servo.lag_s(problem.reference.step_s)
    if late == 0:
        return ()
    text = f"the drive is late by {1e3 * late:.3g} ms (lag, delay and hold), and the output of modules that read a "
    return (text + "reference live with it; the module profile runs ahead of it",)


def _run_in_float(
    scenario: Scenario,
    problem: Problem,
    golden: Golden,
    seen: ObserverGolden,
    tuned: AdaptiveGolden | None,
    prefix: str,
    numbers: Mapping[str, object],
) -> tuple[InFloat, ...]:
    """Answers of the modules in single precision, without and with contracted products; none without a C compiler."""
    with_stream = numbers["stream"] is not None
    modules = tuple(m for m in c_modules(scenario, with_stream) if m is not BOUNDS)
    every = c_sources(scenario, problem, modules, Precision.FLOAT, prefix, numbers)
    tension = problem.reference.tension_N
    course = np.concatenate([tension[:-1], tension[:-1], tension]) if problem.reference.periodic else tension
    followed = dict.fromkeys(golden.jumps.columns, course)
    other = golden.other
    live = ({}, np.empty(0)) if golden.live is None else (golden.live.inputs_N, golden.live.joint_rad)
    first = golden.course.inputs_N | {OBSERVER.name: seen.given(without_position=True)}
    far = {OBSERVER.name: seen.given()} if len(seen.position_m) else {}
    inputs = [first, golden.jumps.inputs_N, live[0], {} if other is None else other.course.inputs_N, far, followed]
    angles = [golden.course.joint_rad, golden.jumps.joint_rad, live[1], np.empty(0), golden.course.joint_rad]
    friction = {} if other is None else {3: (other.mu_release, other.adhesion_N)}
    if (motion := problem.chain.motion) is not None:
        angles.append(motion.at(np.arange(len(course), dtype=np.float64) * problem.reference.step_s))
    if tuned is not None:
        inputs += [{ADAPTIVE.name: tuned.given(golden.course.reference_N, nudge)} for nudge in range(NUDGES)]
        angles += [tuned.joint_rad] * NUDGES
    joints = angles if scenario.joints else ()
    runs = (
        run_on_host(every, prefix, Precision.FLOAT, inputs, joints, friction, contracted=contracted)
        for contracted in (False, True)
    )
    return tuple(_in_float(*run) for run in runs if run is not None)


def _in_float(
    course: Mapping[str, FloatArray],
    jumps: Mapping[str, FloatArray],
    live: Mapping[str, FloatArray],
    other: Mapping[str, FloatArray],
    far: Mapping[str, FloatArray],
    reference: Mapping[str, FloatArray],
    *tuner: Mapping[str, FloatArray],
) -> InFloat:
    """The runs in the order of their inputs."""
    return InFloat(
        course=course,
        jumps=jumps,
        live=live,
        other=other,
        far=far,
        reference=reference,
        tuner=[answer[ADAPTIVE.name] for answer in tuner],
    )


def _design_json(
    scenario: Scenario,
    problem: Problem,
    precision: Precision,
    prefix: str,
    *,
    built: BuiltTable | None,
    profile: FloatArray,
    judged: Sequence[Judged],
    losses: Sequence[FloatLoss],
    choice: StreamChoice | None,
    modules: Sequence[CModule],
) -> str:
    transmission = scenario.transmission
    joints = Joints.of(problem.chain) if scenario.joints else None
    law = CapstanLaw.of(transmission)
    capstan = {
        "pull_ratio": math.exp(law.pull_exponent),
        "release_ratio": math.exp(-law.release_exponent),
        "adhesion_N": law.adhesion_N,
    }
    content = {
        "schema": 1,
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        "tendonff": __version__,
        "level": problem.level,
        "precision": precision,
        "prefix": prefix,
        "step_s": scenario.run.step_s,
        "parameters": asdict(transmission),
        **({} if joints is None else {"joints": _described(joints)}),
        "capstan": capstan if joints is None else None,
        "table": None
        if built is None
        else {
            "nodes": built.table.nodes,
            "bound_N": built.bound_N,
            "interpolation_error_N": built.error_N,
            "rate_N_per_s": built.rate_N_per_s,
        },
        "profile": {"samples": len(profile), "least_N": float(np.min(profile)), "most_N": float(np.max(profile))},
        "stream": None
        if choice is None
        else {
            "lag_s": choice.picked.design.filter.lag_s,
            "taps": choice.picked.design.filter.taps.tolist(),
            "dead_band_N": choice.picked.design.band_N,
            "noise_dB": choice.picked.noise_dB,
            "resolution_N": choice.resolution_N,
        },
        "float_loss": {loss.module: asdict(loss) for loss in losses},
        "scores": {each.module: each.as_dict() for each in judged},
        "files": {f"{prefix}_{module.name}": module.content for module in modules},
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _described(joints: Joints) -> list[dict[str, object]]:
    """Joints in the order of the arguments, with the range that the exported code accepts."""
    rows = zip(joints.names, joints.least_rad, joints.most_rad, joints.start_rad, strict=True)
    return [{"name": name, "least_rad": a, "most_rad": b, "start_rad": start} for name, a, b, start in rows]
