"""Golden vectors of a finger: what exported C must answer, by the Python model; and what it does answer."""

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.motors.drive import commanded
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.drive import Driven, drive_on_host, host_text
from tendonff.compensator.export.driven.checks import Bounds, DrivenTest, Status
from tendonff.compensator.export.finger.checks import check_finger, tested_finger
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.reading import FloatArray
from tendonff.models.path import JointMotion
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, invert_mechanism

_ROWS, BACK_ROWS = 600, 200
_LOAD = 2.0
"""Of the load at the end of a golden course, in torques that the tendons give at the start: loops then hang loose."""
_BEYOND = 0.05
"""Of the range of the course: how far a drive at random goes beyond it."""
_PAUSE_RAD = 0.02
"""Jump of a command that passes after a pause."""
_DOUBLE_RAD, _DOUBLE_N = 1e-9, 1e-5
_UNMEASURED_RAD, _UNMEASURED_N = 2e-4, 0.05
"""Largest differences from the model that pass: in double, and in float where it was not measured."""

_DRIVER = """#include "{prefix}_finger.h"
int run(int which, long n, int joints, int motors, int tendons, const {prefix}_real *angle, const {prefix}_real *torque,
        {prefix}_real *out)
{{
    static {prefix}_finger self;
    const int width = (2 * motors) + tendons + 1;
    long k;
    int j;
    const int good = (int){prefix}_finger_init_at(&self, which, angle, torque);
    for (k = 0; k < n; k++) {{
        {prefix}_real *const row = &out[width * k];
        (void){prefix}_finger_step(&self, &angle[joints * k], &torque[joints * k]);
        for (j = 0; j < motors; j++) {{
            row[j] = self.motor_rad[j];
            row[motors + j] = self.command_rad[j];
        }}
        for (j = 0; j < tendons; j++) {{
            row[(2 * motors) + j] = self.tension_N[j];
        }}
        row[width - 1] = ({prefix}_real)self.evaluations;
    }}
    return good;
}}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerCourse:
    """Inputs of one finger, exact in the real type of the export, and what the model answers, a row a sample."""

    angle_rad: FloatArray  # shape (rows, joints)
    torque_N_m: FloatArray
    run: MechanismRun
    command_rad: FloatArray  # shape (rows, motors)


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerAnswers:
    """Output of exported code on a course."""

    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray
    evaluations: FloatArray  # shape (rows,)


def golden_course(task: FingerTask, precision: Precision) -> FingerCourse:
    """The beginning of the reference, the way back of its end, and there a load that rises and falls.

    Without the load, the way back or both where these have no answer; SolveError where the reference has none either.
    """
    rows = np.arange(min(_ROWS, len(task.sampled.time_s)))
    back = np.concatenate([rows, rows[::-1][1 : 1 + BACK_ROWS]])
    for course in (back, rows):
        for share in (1.0, 0.0):
            try:
                return _course(task, course, precision, share * _load_N_m(task, len(course)))
            except SolveError as error:
                last = error
    raise last


def _load_N_m(task: FingerTask, rows: int) -> FloatArray:
    """Torques over the last rows, shape (rows, joints), of the size that the tendons give at the start."""
    problem, joints = task.problem(task.finger), len(task.finger.joints)
    place = np.clip(np.arange(rows) - (rows - BACK_ROWS), 0, BACK_ROWS) / BACK_ROWS
    sizes = _LOAD * problem.tension_N.max() * problem.scale_m()[:joints]
    signs = np.where(np.arange(joints) % 2 == 0, 1.0, -1.0)
    sizes[task.scenario.wanted :] = 0.0
    load: FloatArray = np.sin(np.pi * place)[:, None] ** 2 * sizes * signs
    return load


def followed_course(task: FingerTask, precision: Precision) -> FingerCourse:
    """The whole reference; SolveError where there is no answer."""
    every = np.arange(len(task.sampled.time_s))
    return _course(task, every, precision, np.zeros_like(task.sampled.effort_N_m))


def _course(task: FingerTask, rows: np.ndarray, precision: Precision, load_N_m: FloatArray) -> FingerCourse:
    sampled, wanted = task.sampled, task.scenario.wanted
    every = rounded(sampled.angle_rad[rows].ravel(), precision).reshape(len(rows), -1)
    effort = rounded((sampled.effort_N_m[rows] + load_N_m).ravel(), precision).reshape(len(rows), -1)
    time = np.arange(len(rows), dtype=np.float64) * task.step_s
    motion = JointMotion(names=sampled.motion.names, time_s=time, angle_rad=every)
    moved = replace(task, sampled=replace(sampled, time_s=time, angle_rad=every, effort_N_m=effort, motion=motion))
    # Masses are cut for the whole motion, as in the code.
    problem = replace(moved.problem(task.finger), mechanism=task.problem(task.finger).mechanism)
    run = invert_mechanism(problem, every, task.step_s, effort=effort)
    if run.status is MechanismStatus.FAILED:
        raise SolveError(run.message)
    columns = zip(task.finger.motors, run.motor.T, strict=True)
    command = [commanded(motor.drive, column[:, None], task.step_s, live=True)[:, 0] for motor, column in columns]
    return FingerCourse(
        angle_rad=every[:, :wanted],
        torque_N_m=effort[:, :wanted],
        run=run,
        command_rad=np.column_stack(command),
    )


def run_courses(
    sources: Mapping[str, str],
    prefix: str,
    precision: Precision,
    courses: Sequence[FingerCourse],
    which: Sequence[int],
    drive: str = "",
) -> tuple[list[FingerAnswers], Driven | None] | None:
    """Answers of the exported code to courses, each of a finger by its number, and to a drive, its text in C.

    None where there is no C compiler.
    """
    driver = _DRIVER.format(prefix=prefix)
    code = compile_on_host(sources, driver + (host_text(drive, prefix, ["finger"]) if drive else ""), precision)
    if code is None:
        return None
    sizes = (ctypes.c_int, ctypes.c_long, *(ctypes.c_int,) * 3)
    call = code.function("run", *sizes, *(code.reals,) * 3, result=ctypes.c_int)
    answers = []
    for course, number in zip(courses, which, strict=True):
        (rows, joints), motors, tendons = (
            course.angle_rad.shape,
            course.run.motor.shape[1],
            course.run.tension_N.shape[1],
        )
        out = np.empty((rows, 2 * motors + tendons + 1), dtype=code.real)
        given = (code.array(each.ravel()) for each in (course.angle_rad, course.torque_N_m))
        if call(number, rows, joints, motors, tendons, *given, out) != 1:
            raise CodeError(f"the exported code refuses the start of finger {number}")
        motor, command, tension, used = np.split(out.astype(np.float64), np.cumsum([motors, motors, tendons]), axis=1)
        answers.append(FingerAnswers(motor_rad=motor, command_rad=command, tension_N=tension, evaluations=used.ravel()))
    return answers, drive_on_host(code, precision) if drive else None


def drive_context(task: FingerTask, course: FingerCourse) -> dict[str, Any]:
    """Of a finger in a drive at random: sizes, and rows of numbers by joint, those that nothing leads left out."""
    angle, wanted = course.angle_rad, task.scenario.wanted
    beyond = _BEYOND * np.ptp(angle, axis=0)
    problem = task.problem(task.finger)
    load = problem.tension_N.max() * problem.scale_m()[:wanted]
    usual = np.abs(np.diff(angle, axis=0)).max(axis=0)
    rows = (angle.min(axis=0) - beyond, angle.max(axis=0) + beyond, angle[0], usual, load)
    return {
        "joints": wanted,
        "motors": course.run.motor.shape[1],
        "tendons": course.run.tension_N.shape[1],
        "rows": [[literal(float(value), Precision.DOUBLE) for value in row] for row in rows],
    }


def largest_departure(courses: Sequence[FingerCourse], found: Sequence[FingerAnswers]) -> float:
    """Largest departure of the motor angles that compiled code answers from those of the model [rad]."""
    return max(
        float(np.abs(answer.motor_rad - course.run.motor).max()) for course, answer in zip(courses, found, strict=True)
    )


def add_checks(
    script: Script, task: FingerTask, course: FingerCourse, found: FingerAnswers | None, context: Mapping[str, Any],
    place: int,
) -> None:  # fmt: skip
    """Check a finger, number `place` of the exported ones; what float loses is by the compiled code's answers."""
    rad, command, newton = _DOUBLE_RAD, 4 * _DOUBLE_RAD, _DOUBLE_N
    drives = [motor.drive for motor in task.finger.motors]
    single = script.precision is Precision.FLOAT
    if single:
        # A reversal that rounding tells a sample later crosses the play that much later.
        rad, newton = _UNMEASURED_RAD, _UNMEASURED_N
        command = 4 * _UNMEASURED_RAD + max(drive.play_rad for drive in drives)
        if found is not None:
            rad = 1e-5 + 3 * float(np.abs(found.motor_rad - course.run.motor).max())
            command = 1e-5 + 3 * float(np.abs(found.command_rad - course.command_rad).max())
            newton = 1e-3 + 3 * float(np.abs(found.tension_N - course.run.tension_N).max())
    changes = [d.speed_max_rad_per_s * task.step_s if d.speed_max_rad_per_s is not None else 1e30 for d in drives]
    length = task.finger.geometry().length_m(course.run.position)
    names = [tendon.name for tendon in task.finger.tendons]
    first = [(names.index(motor.winds[0]), motor.winding_m[0]) for motor in task.finger.motors]
    by_length = np.column_stack([-(length[:, k] - length[0, k]) / winding for k, winding in first])
    beyond = float(np.ptp(course.run.motor - by_length, axis=0).max())
    own = context["fingers"][place]
    sizes = (len(own["joints"]), len(own["motors"]), len(own["tendons"]))
    test = DrivenTest(
        script=script,
        module=tested_finger(context["prefix"], own["symbol"].lower(), place, *sizes),
        start="init",
        reference="angle",
        load="torque",
        steady=len(course.angle_rad) - BACK_ROWS,
        given={"angle": course.angle_rad, "torque": course.torque_N_m},
        motor_rad=course.run.motor,
        command_rad=course.command_rad,
        tension_N=course.run.tension_N,
        bounds=Bounds(
            motor_rad=rad,
            command_rad=command,
            tension_N=newton,
            torque_N_m=math.inf,
            change_rad=tuple(changes),
            torque_max_N_m=tuple(drive.torque_max_N_m or 1e30 for drive in drives),
            back_rad=1e-3 + 2 * beyond,
            pause_rad=_PAUSE_RAD,
            seen=_seen(task, course, changes),
        ),
        step_s=task.step_s,
        part_s=0.5 * context["steps"][0],
        re_entry=context["re_entry"],
        alike_rad=2e-5 if single else 1e-9,
    )
    check_finger(test, len(context["fingers"]), context["evaluations"], context["bodies"])


def _seen(task: FingerTask, course: FingerCourse, changes: Sequence[float]) -> int:
    """Status bits that the course must set."""
    seen = Status.OK
    if (np.abs(np.diff(course.run.motor, axis=0)).max(axis=0) > 1.05 * np.array(changes)).any():
        seen |= Status.SPEED_LIMITED
    most = np.abs(course.run.effort).max(axis=0)
    limits = [motor.drive.torque_max_N_m or 1e30 for motor in task.finger.motors]
    if (most > 1.02 * np.array(limits)).any():
        seen |= Status.TORQUE_LIMITED
    if course.run.slack_m.max() > 1e-4:
        seen |= Status.SLACK
    return int(seen)
