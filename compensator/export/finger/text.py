"""The text of exported C of fingers: fixed files, printed laws, constant records, and the header."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.stream import RE_ENTRY_S
from tendonff.compensator.export.modules import accepted_steps
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.text.fixed import core_file
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.models.joint.parameters import JointDrive
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.target import MechanismCode, mechanism_code, price
from tendonff.ocp.step.render import core_text

_TEMPLATES = environment("tendonff.compensator.export", "templates/finger", "templates/library")
_LEAST_MARGIN_RAD = 0.01
"""Angles beyond the reference that are accepted at least, whatever its range."""
_NO_LIMIT = 1e30


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerModule:
    """The module of some fingers.

    Attributes
    ----------
    files : dict of str to str
        Text by file name.
    context : dict of str to object
        Values for the templates of the other files; `fingers` has a dict for each.
    """

    files: dict[str, str]
    context: dict[str, Any]


def finger_module(
    tasks: Sequence[FingerTask], problems: Sequence[MechanismProblem], precision: Precision, prefix: str
) -> FingerModule:
    """Header, source, laws, core and data, by file name.

    Parameters
    ----------
    tasks : sequence of FingerTask
        One for each finger.
    problems : sequence of MechanismProblem
        Theirs.
    precision : Precision
    prefix : str
        Prefix of every C name and file.

    Raises
    ------
    InputError
        If a path follows a joint that is not driven.
    """
    for task in tasks:
        if task.scenario.joints:
            raise InputError(
                f"{task.scenario.source.name}: exported C knows driven joints alone, not "
                f'{", ".join(task.scenario.joints)}; give them kind = "driven"'
            )
    step = tasks[0].step_s
    code = mechanism_code(problems, list(map(_pretension, tasks)), step, prefix, precision)
    fingers = [_described(task, problem) for task, problem in zip(tasks, problems, strict=True)]
    records = [
        _record(code, k, *each, precision) for k, each in enumerate(zip(tasks, problems, fingers, strict=True), start=1)
    ]
    code.data.rows("finger_record", "finger_records", records)
    context = _context(tasks, code, precision, prefix) | {"fingers": fingers}
    laws = f"/* Laws of the elements and loops over them.\n *\n{context['provenance']}\n */\n{code.laws}"
    data = f"/* Numbers of the fingers.\n *\n{context['provenance']}\n */\n" + "\n".join(code.data.lines) + "\n"
    return FingerModule(
        files={
            f"{prefix}_finger.h": render("finger.h.j2", context),
            f"{prefix}_finger.c": core_file("finger.c", prefix),
            f"{prefix}_core.h": core_text(prefix),
            f"{prefix}_finger_laws.h": laws,
            f"{prefix}_finger_data.h": data,
        },
        context=context,
    )


def render(template: str, context: dict[str, Any]) -> str:
    """Text of a template of fingers."""
    return _TEMPLATES.get_template(template).render(context)


def _pretension(task: FingerTask) -> FloatArray:
    of_motor = {name: motor.drive.pretension_N or 0.0 for motor in task.finger.motors for name in motor.winds}
    return np.array([of_motor[tendon.name] for tendon in task.finger.tendons])


def _described(task: FingerTask, problem: MechanismProblem) -> dict[str, Any]:
    """Values of a finger for the templates."""
    finger, wanted = task.finger, task.scenario.wanted
    low, high = task.wanted_rad.min(axis=0), task.wanted_rad.max(axis=0)
    accepted = [
        joint.accepted_rad(float(a), float(b)) for joint, a, b in zip(finger.joints[:wanted], low, high, strict=True)
    ]
    least, most = (np.array(each) for each in zip(*accepted, strict=True))
    return {
        "symbol": re.sub(r"\W+", "_", task.scenario.source.stem).upper(),
        "name": harmless(task.scenario.name),
        "hash": task.scenario.digest(),
        "level": task.level.value,
        "joints": finger.names[:wanted],
        "following": finger.names[wanted:],
        "tendons": [tendon.name for tendon in finger.tendons],
        "motors": [motor.name for motor in finger.motors],
        "least": np.minimum(least, low - _LEAST_MARGIN_RAD),
        "most": np.maximum(most, high + _LEAST_MARGIN_RAD),
        "start": problem.start[:wanted],
        "middle": 0.5 * (low + high),
        "reach": 0.5 * (high - low),
    }


def _record(
    code: MechanismCode,
    number: int,
    task: FingerTask,
    problem: MechanismProblem,
    described: dict[str, Any],
    precision: Precision,
) -> list[str]:
    """Fields of a finger's record in C."""
    data, prefix, names = code.data, code.data.prefix, code.names[number - 1]
    step, wanted, sharing = task.step_s, task.scenario.wanted, problem.sharing
    motors = [[data.number(value) for value in _motor(motor.drive, step)] for motor in task.finger.motors]
    motor_rows = data.rows("finger_motor", f"motors_{number}", motors)
    following = problem.start[wanted : problem.known]
    shared = [literal(v, precision) for v in (sharing.least_tension_N, sharing.smooth_N, price(problem, step))]
    shared += [names[each] for each in ("winding", "partner", "shares", "closure", "compliance", "pretension")]
    return [
        *(str(problem.known), str(wanted), str(len(task.finger.tendons)), str(problem.motors)),
        *(f"{prefix}_bodies_{number}", f"{prefix}_tendons_{number}", motor_rows, names["motor_of"], names["scale"]),
        data.array(np.concatenate([described["least"], following])),
        data.array(np.concatenate([described["most"], following])),
        "{ " + ", ".join(shared) + " }",
    ]


def _motor(drive: JointDrive, step_s: float) -> tuple[float, ...]:
    speed, torque = drive.speed_max_rad_per_s, drive.torque_max_N_m
    return (
        *(_NO_LIMIT if speed is None else speed * step_s, _NO_LIMIT if torque is None else torque),
        *(drive.servo.servo_time_s / step_s, drive.play_rad / 2, drive.turning_rad, drive.gives_rad_per_N_m),
    )


def _context(tasks: Sequence[FingerTask], code: MechanismCode, precision: Precision, prefix: str) -> dict[str, Any]:
    step = tasks[0].step_s
    named = [f'Scenario "{harmless(t.scenario.name)}", hash {t.scenario.digest()}, level {t.level}.' for t in tasks]
    written = [
        *named,
        f"Written by tendonff {__version__} export-c --precision {precision} --prefix {prefix}.",
        "The licence of tendonff does not cover what it writes: this file is yours.",
    ]
    return {
        "prefix": prefix,
        "guard": prefix.upper(),
        "real": precision.value,
        "single": precision is Precision.FLOAT,
        "num": lambda value: literal(float(value), precision),
        "numbers": lambda values: _wrapped([literal(float(v), precision) for v in np.ravel(values)]),
        "exact": lambda values: _wrapped([literal(float(v), Precision.DOUBLE) for v in np.ravel(values)]),
        "provenance": "\n".join(f" * {line}" for line in written),
        "version": __version__,
        "step": step,
        "step_s": repr(step),
        "steps": accepted_steps(step),
        "re_entry": max(1, round(RE_ENTRY_S / step)),
        "masses": code.masses,
        "states": code.states,
        "work": code.work,
        "bodies": code.core.bodies,
        "tendons": code.core.tendons,
        "motors": max(len(task.finger.motors) for task in tasks),
        "evaluations": code.core.evaluations,
        "example_rows": max(20, min(4000, round(2.0 / step))),
        "modules": ["finger"],
        "headers": [f"{prefix}_finger.h", f"{prefix}_finger_laws.h", f"{prefix}_core.h", f"{prefix}_finger_data.h"],
    }


def _wrapped(items: Sequence[str]) -> str:
    rows = [", ".join(items[k : k + 5]) for k in range(0, len(items), 5)]
    return ",\n".join(f"    {row}" for row in rows)
