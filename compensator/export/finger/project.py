"""`tendonff export-c` of fingers: one copy of the code, a record for each finger."""

import json
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.drive import test_text
from tendonff.compensator.export.driven.module import Designed
from tendonff.compensator.export.driven.modules import modules_beside
from tendonff.compensator.export.finger.golden import (
    FingerCourse,
    add_checks,
    drive_context,
    followed_course,
    golden_course,
    largest_departure,
    run_courses,
)
from tendonff.compensator.export.finger.text import finger_module, render
from tendonff.compensator.export.modules import FOLDER_FILES, check_prefix
from tendonff.compensator.export.motors import ExportedMotors, JudgedJoint, judge, live_headline
from tendonff.compensator.export.script import Script
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError
from tendonff.ocp.mechanism.response import MechanismStatus

DRIVEN = {"episodes": 8, "episode_rows": 60}
"""Of the drive at random in the self test."""


@in_turn
def export_fingers(
    scenario: FingerScenario,
    *,
    further: Sequence[FingerScenario] = (),
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    force_export: bool = False,
) -> ExportedMotors:
    """Print the whole folder; arguments and errors as of `tendonff.export_c`."""
    check_prefix(prefix)
    every = (scenario, *further)
    _check_together(every)
    tasks = [FingerTask.of(each, level) for each in every]
    for task in tasks:
        task.check_reach()
    module = finger_module(tasks, [task.problem(task.finger) for task in tasks], precision, prefix)
    courses = [golden_course(task, precision) for task in tasks]
    runs = [followed_course(task, precision) for task in tasks]
    sizes = [drive_context(*each) for each in zip(tasks, courses, strict=True)]
    drive = render("drive.c.j2", module.context | {"drives": sizes} | DRIVEN)
    ran = run_courses(module.files, prefix, precision, [*courses, *runs], [*range(len(tasks))] * 2, drive)
    found, driven = (None, None) if ran is None else ran
    judged = []
    for k, (task, each) in enumerate(zip(tasks, module.context["fingers"], strict=True)):
        command = runs[k].command_rad if found is None else found[len(tasks) + k].command_rad
        judged.append(judge(task, each["symbol"].lower(), command))
        each |= {
            "plain": judged[k].text(judged[k].plain_rms),
            "score": judged[k].text(judged[k].rms),
            "fault": judged[k].fault,
            "headline": live_headline(task, task.scenario.source),
        }
    faults = [f"{each.name}: {each.fault}" for each in judged if each.fault]
    if faults and not force_export:
        raise SolveError(
            f"nothing to export: {'; '.join(faults)}. Let the reference move more slowly, or export all the same with "
            "--force-export"
        )
    loss = None if found is None else largest_departure([*courses, *runs], found)
    context = module.context | {
        "tested": [],
        "loss": f"{loss:.2g}" if loss is not None and precision is Precision.FLOAT else "",
        "verifying": f"{max(task.masses for task in tasks)} masses a tendon at step/{FingerTask.refinement}",
        "usual": "" if found is None else f"{max(float(each.evaluations.mean()) for each in found):.1f}",
    }
    script = Script(precision=precision, prefix=prefix)
    for k, (task, course) in enumerate(zip(tasks, courses, strict=True)):
        add_checks(script, task, course, None if found is None else found[k], context, k)
    beside = modules_beside(
        [Designed(task=task, motor_rad=run.run.motor) for task, run in zip(tasks, runs, strict=True)],
        judged,
        prefix=prefix,
        script=script,
        include=f"{prefix}_finger.h",
        provenance=context["provenance"],
    )
    context = beside.into(context)
    tested = test_text(drive, prefix, driven)
    test = script.text([f"{prefix}_{m}.h" for m in context["modules"]], context["provenance"], drive=tested)
    files = module.files | test | beside.files | {name: render(f"{name}.j2", context) for name in FOLDER_FILES}
    files["design.json"] = _design_json(tasks, judged, precision, prefix, loss)
    kept = [f"{fault}; exported because of --force-export" for fault in faults]
    return ExportedMotors(
        files=files,
        judged=tuple(judged),
        loss_rad=loss,
        headlines=tuple(each["headline"] for each in context["fingers"]),
        warnings=(*_warnings(runs), *beside.warnings, *kept),
    )


def _check_together(scenarios: Sequence[FingerScenario]) -> None:
    names: set[str] = set()
    for scenario in scenarios:
        file = scenario.source.name
        if scenario.source.stem in names:
            raise InputError(f"{file}: two fingers of one project come from files of this name; rename one")
        names.add(scenario.source.stem)
        if scenario.run.step_s != scenarios[0].run.step_s:
            raise InputError(
                f"{file} [run]: step_s = {scenario.run.step_s:g} differs from {scenarios[0].run.step_s:g} of "
                f"{scenarios[0].source.name}; fingers of one project share their sample time"
            )


def _warnings(runs: Sequence[FingerCourse]) -> tuple[str, ...]:
    return tuple(each.run.message for each in runs if each.run.status is not MechanismStatus.DONE)


def _design_json(
    tasks: Sequence[FingerTask], judged: Sequence[JudgedJoint], precision: Precision, prefix: str, loss: float | None
) -> str:
    content = {
        "schema": 1,
        "tendonff": __version__,
        "precision": precision,
        "prefix": prefix,
        "step_s": tasks[0].step_s,
        "largest_departure_rad": loss,
        "fingers": [
            {
                "name": each.name,
                "scenario": task.scenario.name,
                "scenario_hash": task.scenario.digest(),
                "level": task.level,
                "joints": task.finger.names[: task.scenario.wanted],
                "motors": [motor.name for motor in task.finger.motors],
                "tendons": [tendon.name for tendon in task.finger.tendons],
                "mechanism": asdict(task.finger),
                "scores": {
                    kind: {"rmse_rad": value, "rmse_percent_of_range": 100 * value / each.range}
                    for kind, value in (("linear", each.plain_rms), ("inverse", each.rms))
                },
                "fault": each.fault,
            }
            for task, each in zip(tasks, judged, strict=True)
        ],
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False, default=_plain) + "\n"


def _plain(value: object) -> object:
    """A list for what JSON does not know."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
