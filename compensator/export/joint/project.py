"""`tendonff export-c` of driven joints: one copy of the code, a record for each joint."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.task import verifying_masses
from tendonff.compensator.export.drive import test_text
from tendonff.compensator.export.driven.module import Designed
from tendonff.compensator.export.driven.modules import modules_beside
from tendonff.compensator.export.feedback import FEEDBACK_SOURCES, feedback_files
from tendonff.compensator.export.feedback_module import joint_module
from tendonff.compensator.export.joint.checks import check_adaptive, tested_adaptive
from tendonff.compensator.export.joint.golden import (
    JointAnswers,
    JointCourse,
    add_checks,
    drive_context,
    followed_course,
    golden_course,
    largest_departure,
    run_courses,
)
from tendonff.compensator.export.joint.text import module_text, problem_of, render, transmission_files
from tendonff.compensator.export.modules import FOLDER_FILES, check_prefix
from tendonff.compensator.export.motors import ExportedMotors, JudgedJoint, judge, live_headline
from tendonff.compensator.export.script import Script
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, on_level, sample_joint
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError
from tendonff.ocp.joint.invert import JointStatus
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.target import other_joints

DRIVEN = {"episodes": 12, "episode_rows": 100, "tuner_rows": 4000}
"""Of the drive at random in the self test."""


@in_turn
def export_joints(
    scenario: JointScenario,
    *,
    further: Sequence[JointScenario] = (),
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    force_export: bool = False,
) -> ExportedMotors:
    """Print the whole folder; arguments and errors as of `tendonff.export_c`."""
    check_prefix(prefix)
    scenarios = [on_level(one, level) for one in (scenario, *further)]
    _check_together(scenarios)
    sampled = [sample_joint(scenario) for scenario in scenarios]
    problems = [problem_of(scenario, each) for scenario, each in zip(scenarios, sampled, strict=True)]
    others = other_joints(problems)
    sources, context = module_text(scenarios, sampled, problems, precision, prefix)
    courses = [golden_course(*each, others, precision) for each in zip(scenarios, sampled, problems, strict=True)]
    runs = [followed_course(*each, others, precision) for each in zip(scenarios, sampled, problems, strict=True)]
    joints: list[dict[str, Any]] = context["joints"]
    sizes = [
        drive_context(scenario, course, joint["least_rad"], joint["most_rad"])
        for scenario, course, joint in zip(scenarios, courses, joints, strict=True)
    ]
    drive = render("drive.c.j2", context | {"drives": sizes} | DRIVEN)
    numbers = list(range(len(scenarios))) * 2
    ran = run_courses(sources, prefix, precision, [*courses, *runs], numbers, drive, context["modules"])
    found, driven = (None, None) if ran is None else ran
    judged, headlines, tasks = list[JudgedJoint](), list[str](), list[JointTask]()
    for k, (own, each) in enumerate(zip(scenarios, sampled, strict=True)):
        command = runs[k].command_rad
        if found is not None and not own.reference.periodic:
            command = found[len(scenarios) + k].command_rad
        task = JointTask(scenario=own, sampled=each, mechanism=own.mechanism, level=own.run.level)
        tasks.append(task)
        judged.append(judge(task, own.mechanism.joint.name, command))
        headlines.append(live_headline(JointTask.of(own), own.source))
        joints[k] |= {
            "headline": headlines[k],
            "plain": judged[k].text(judged[k].plain_rms),
            "score": judged[k].text(judged[k].rms),
            "fault": judged[k].fault,
        }
    faults = [f"{each.name}: {each.fault}" for each in judged if each.fault]
    if faults and not force_export:
        raise SolveError(
            f"nothing to export: {'; '.join(faults)}. Let the reference move more slowly, or export all the same with "
            "--force-export"
        )
    loss = None if found is None else largest_departure(courses, found)
    masses = max(verifying_masses(scenario.mechanism) for scenario in scenarios)
    context |= {
        "transmission": bool(transmission_files(context, others)),
        "loss": f"{loss:.2g}" if loss is not None and precision is Precision.FLOAT else "",
        "verifying": f"{masses} masses a tendon at step/{JointTask.refinement}",
    }
    fed, unfed = _feedback(scenarios, precision, prefix, context["provenance"])
    context["feedback"] = bool(fed)
    if fed:
        context["modules"] = [*context["modules"], *FEEDBACK_SOURCES]
        context["headers"] = [*context["headers"], *(f"{prefix}_{name}.h" for name in FEEDBACK_SOURCES)]
    context["tested"] = ["feedback"] if fed else []
    script = _checks(scenarios, problems, courses, found, context, precision)
    beside = modules_beside(
        [Designed(task=task, motor_rad=run.motor_rad) for task, run in zip(tasks, runs, strict=True)],
        judged,
        prefix=prefix,
        script=script,
        include=f"{prefix}_joint.h",
        provenance=context["provenance"],
    )
    context = beside.into(context)
    headers = [f"{prefix}_{name}.h" for name in context["modules"]]
    test = script.text(headers, context["provenance"], drive=test_text(drive, prefix, driven))
    files = sources | fed | test | beside.files | {name: render(f"{name}.j2", context) for name in FOLDER_FILES}
    files |= transmission_files(context, others)
    files["design.json"] = _design_json(scenarios, problems, judged, precision, prefix, loss)
    kept = [note for each in sampled for note in each.warnings]
    kept += [*unfed, *beside.warnings]
    kept += [f"{fault}; exported because of --force-export" for fault in faults]
    return ExportedMotors(
        files=files,
        judged=tuple(judged),
        loss_rad=loss,
        headlines=tuple(headlines),
        warnings=(*_warnings(runs, scenarios), *kept),
    )


def _checks(
    scenarios: Sequence[JointScenario],
    problems: Sequence[JointProblem],
    courses: Sequence[JointCourse],
    found: Sequence[JointAnswers] | None,
    context: Mapping[str, Any],
    precision: Precision,
) -> Script:
    """Checks of the joints and of those that tune themselves."""
    prefix, others = context["prefix"], len(context["others"])
    script = Script(precision=precision, prefix=prefix)
    tests = [
        add_checks(script, own, problem, courses[k], None if found is None else found[k], context, k)
        for k, (own, problem) in enumerate(zip(scenarios, problems, strict=True))
    ]
    for k, each in enumerate(context["adaptive"]):
        module = tested_adaptive(prefix, each["name"], k, others)
        check_adaptive(tests[each["nodes"][1]], module, each["delay"], context["tuned_rad"])
    return script


def _feedback(
    scenarios: Sequence[JointScenario], precision: Precision, prefix: str, provenance: str
) -> tuple[dict[str, str], list[str]]:
    """Files of the feedback where the one scenario asks for it, and a warning where several do."""
    settings = [scenario.feedback for scenario in scenarios]
    if settings[0] is None or len(scenarios) > 1:
        several = any(each is not None for each in settings)
        text = "the feedback module is left out of a project of several joints; export each joint with [feedback] alone"
        return {}, [text] if several else []
    module = joint_module(JointFeedbackTask.of(JointTask.of(scenarios[0]), settings[0]))
    return feedback_files(module, prefix=prefix, precision=precision, provenance=provenance), []


def _check_together(scenarios: Sequence[JointScenario]) -> None:
    names: dict[str, str] = {}
    for scenario in scenarios:
        name, file = scenario.mechanism.joint.name.upper(), scenario.source.name
        if name in names:
            raise InputError(
                f'{file}: joint "{scenario.mechanism.joint.name}" stands in {names[name]} too; give each joint of one '
                "project a name of its own; [joints] and [[tendons]] of a file replace those of its base"
            )
        names[name] = file
        if scenario.run.step_s != scenarios[0].run.step_s:
            raise InputError(
                f"{file} [run]: step_s = {scenario.run.step_s:g} differs from {scenarios[0].run.step_s:g} of "
                f"{scenarios[0].source.name}; joints of one project share their sample time"
            )


def _warnings(runs: Sequence[JointCourse], scenarios: Sequence[JointScenario]) -> tuple[str, ...]:
    return tuple(
        f"{scenario.mechanism.joint.name}: {run.inversion.message}"
        for run, scenario in zip(runs, scenarios, strict=True)
        if run.inversion.status is not JointStatus.EXACT
    )


def _design_json(
    scenarios: Sequence[JointScenario],
    problems: Sequence[JointProblem],
    judged: Sequence[JudgedJoint],
    precision: Precision,
    prefix: str,
    loss: float | None,
) -> str:
    content = {
        "schema": 1,
        "tendonff": __version__,
        "precision": precision,
        "prefix": prefix,
        "step_s": scenarios[0].run.step_s,
        "largest_departure_rad": loss,
        "joints": [
            {
                "name": each.name,
                "scenario": scenario.name,
                "scenario_hash": scenario.digest(),
                "level": scenario.run.level,
                "masses": [chain.count for chain in problem.chains],
                "mechanism": asdict(scenario.mechanism),
                "scores": {
                    kind: {f"rmse_{scenario.reference.unit}": value, "rmse_percent_of_range": 100 * value / each.range}
                    for kind, value in (("linear", each.plain_rms), ("inverse", each.rms))
                },
                "fault": each.fault,
            }
            for scenario, problem, each in zip(scenarios, problems, judged, strict=True)
        ],
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False, default=_plain) + "\n"


def _plain(value: object) -> object:
    """A number or list for what JSON does not know."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
