"""Golden vectors of a joint: what the exported C must answer, computed by the Python model; and what it does answer."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.motors.drive import commanded
from tendonff.compensator.compensators.motors.joint import inverse_of
from tendonff.compensator.export.drive import Driven, drive_on_host, host_text
from tendonff.compensator.export.driven.checks import Bounds, DrivenTest, Status
from tendonff.compensator.export.golden import to_and_fro
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.joint.checks import Observed, check_joint, tested_joint
from tendonff.compensator.export.joint.observed import STEP_RAD, observed_motor
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.path import JointMotion
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.joint.invert import JointInversion, JointStatus, invert_joint
from tendonff.ocp.joint.protocol import JointProblem

_ROWS = 1000
_REVERSAL_ROWS = 240
_PUSHED = 1.5
"""Largest contact of a drive at random, in torques of the largest tension of the course."""
_PAUSE_RAD = 1e-5
"""Jump of a command that passes after a pause."""

_DOUBLE_RAD, _DOUBLE_N = 1e-9, 1e-5
_ALONE_RAD = 1e-6
_UNMEASURED_RAD, _UNMEASURED_N = 2e-4, 0.05
"""Largest differences from the model that pass: in double, where CasADi stands in for a compiler, whose search for
tensions ends elsewhere, and in float where it was not measured.
"""

_DRIVER = """#include "{prefix}_joint.h"
int run(int which, long n, const {prefix}_real *angle, const {prefix}_real *contact, const {prefix}_real *other,
        {prefix}_real *out)
{{
    static {prefix}_joint self;
    long k;
    int good = {prefix}_joint_init(&self, which, angle[0], contact[0]{first});
    (void)other;
    for (k = 0; k < n; k++) {{
        (void){prefix}_joint_step(&self, angle[k], contact[k]{each});
        out[8 * k] = self.motor_rad[0];
        out[(8 * k) + 1] = self.motor_rad[1];
        out[(8 * k) + 2] = self.command_rad[0];
        out[(8 * k) + 3] = self.command_rad[1];
        out[(8 * k) + 4] = self.tension_N[0];
        out[(8 * k) + 5] = self.tension_N[1];
        out[(8 * k) + 6] = self.motor_torque_N_m[0];
        out[(8 * k) + 7] = self.motor_torque_N_m[1];
    }}
    return good;
}}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCourse:
    """Inputs of one joint, exact in the real type of the export, and what the model answers, a row a sample."""

    angle_rad: FloatArray
    contact_N_m: FloatArray
    other_rad: FloatArray  # shape (rows, others)
    inversion: JointInversion
    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAnswers:
    """Output of exported code on a sequence."""

    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray
    motor_torque_N_m: FloatArray


def golden_course(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem, others: Sequence[str], precision: Precision
) -> JointCourse:
    """The reference, thinned to fit, and a way to and fro; where that fails, the beginning of the reference."""
    stride = max(1, -(-len(sampled.time_s) // _ROWS))
    for rows in (slice(None, None, stride), slice(0, _ROWS)):
        angle = sampled.angle_rad[rows]
        usual = float(np.abs(np.diff(angle)).max())
        back = to_and_fro(angle, step_N=usual, rows=_REVERSAL_ROWS)
        course = _course(scenario, sampled, problem, others, precision, rows, back)
        if course.inversion.status is not JointStatus.FAILED:
            return course
    raise SolveError(course.inversion.message)


def followed_course(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem, others: Sequence[str], precision: Precision
) -> JointCourse:
    """The reference itself; of one that repeats, its steady state, which exported code reaches after some cycles."""
    if not scenario.reference.periodic:
        course = _course(scenario, sampled, problem, others, precision, slice(None), np.empty(0))
        if course.inversion.status is JointStatus.FAILED:
            raise SolveError(course.inversion.message)
        return course
    found, _ = inverse_of(scenario, sampled, problem)
    command = commanded(scenario.mechanism.drive, found.motor_rad, scenario.run.step_s)
    course = _course(scenario, sampled, problem, others, precision, slice(None), np.empty(0))
    return replace(course, inversion=found, motor_rad=found.motor_rad, command_rad=command, tension_N=found.tension_N)


def _course(
    scenario: JointScenario,
    sampled: SampledJoint,
    problem: JointProblem,
    others: Sequence[str],
    precision: Precision,
    rows: slice,
    back_rad: FloatArray,
) -> JointCourse:
    joint, step = scenario.mechanism.joint.name, scenario.run.step_s

    def extended(values: FloatArray, more: FloatArray | None = None) -> FloatArray:
        kept = values[rows]
        return rounded(np.concatenate([kept, np.full(len(back_rad), kept[-1]) if more is None else more]), precision)

    angle = extended(sampled.angle_rad, back_rad)
    columns = {name: extended(column) for name, column in sampled.others(joint).items()}
    motion = JointMotion(
        names=(joint, *columns),
        time_s=np.arange(len(angle), dtype=np.float64) * step,
        angle_rad=np.column_stack([angle, *columns.values()]),
    )
    moved = replace(
        problem,
        chains=tuple(replace(chain, motion=motion) for chain in problem.chains),
        start_rad=float(angle[0]),
    )
    contact = extended(sampled.contact_N_m)
    found = invert_joint(moved, angle, step, contact_N_m=contact)
    still = np.zeros(len(angle))
    return JointCourse(
        angle_rad=angle,
        contact_N_m=contact,
        other_rad=np.column_stack([still[:, None][:, :0], *(columns.get(name, still) for name in others)]),
        inversion=found,
        motor_rad=found.motor_rad,
        command_rad=commanded(scenario.mechanism.drive, found.motor_rad, step, live=True),
        tension_N=found.tension_N,
    )


def add_checks(
    script: Script,
    scenario: JointScenario,
    problem: JointProblem,
    course: JointCourse,
    found: JointAnswers | None,
    context: Mapping[str, Any],
    place: int,
) -> DrivenTest:
    """Check a joint, number `place` of the exported ones; what float loses is by the compiled code's answers."""
    drive, step, precision = scenario.mechanism.drive, scenario.run.step_s, script.precision
    windings = np.array(problem.windings_m) / drive.gear_ratio
    asked = np.maximum(course.inversion.drum_N, 0.0) * windings
    asked = asked.sum(axis=1, keepdims=True) if problem.loop else asked
    rad = _ALONE_RAD if resolve_engine(Engine.AUTO) is Engine.CASADI else _DOUBLE_RAD
    command, newton, newton_metre = 4 * rad, _DOUBLE_N, _DOUBLE_N * float(np.abs(windings).max())
    if precision is Precision.FLOAT:
        # A reversal that rounding tells a sample later crosses the play that much later.
        rad, command, newton = _UNMEASURED_RAD, 4 * _UNMEASURED_RAD + drive.play_rad, _UNMEASURED_N
        newton_metre = 4 * newton * float(np.abs(windings).max())
        if found is not None:
            rad = 1e-5 + 3 * float(np.abs(found.motor_rad - course.motor_rad).max())
            command = 1e-5 + 3 * float(np.abs(found.command_rad - course.command_rad).max())
            newton_metre = 1e-6 + 3 * float(np.abs(found.motor_torque_N_m - asked).max())
            newton = 1e-3 + 3 * float(np.abs(found.tension_N - course.tension_N).max())
    limit, motors, single = drive.speed_max_rad_per_s, course.motor_rad.shape[1], precision is Precision.FLOAT
    still = problem.mechanism.motor_rad(
        np.column_stack([t.path_travel_m(course.angle_rad) for t in problem.mechanism.tendons]), problem.start_rad
    )
    beyond = course.motor_rad - (still - still[:1])[:, :motors]
    given = {"angle": course.angle_rad, "contact": course.contact_N_m}
    joint, others = context["joints"][place], course.other_rad.shape[1]
    test = DrivenTest(
        script=script,
        module=tested_joint(context["prefix"], joint["name"], place, motors, course.tension_N.shape[1], others),
        start="init",
        reference="angle",
        load="contact",
        given=given | ({"other": course.other_rad} if others else {}),
        motor_rad=course.motor_rad,
        command_rad=course.command_rad,
        tension_N=course.tension_N,
        bounds=Bounds(
            motor_rad=rad,
            command_rad=command,
            tension_N=newton,
            torque_N_m=newton_metre,
            change_rad=(1e30 if limit is None else limit * step,) * motors,
            torque_max_N_m=(drive.torque_max_N_m or 1e30,) * motors,
            back_rad=1e-3 + 2 * float(np.ptp(beyond)),
            pause_rad=_PAUSE_RAD,
            seen=_seen(problem, course, drive, step),
        ),
        step_s=step,
        part_s=0.5 * context["steps"][0],
        re_entry=context["re_entry"],
        alike_rad=0.0,
    )
    observed = Observed(
        angle_rad=_observed_rad(scenario, course, rad),
        tension_N=(10 if single else 4) * newton,
        drift_rad=STEP_RAD + 0.8 * observed_motor(scenario, course.angle_rad)[1] * step,
        ahead_rad=1e-3 if single else 1e-6,
        least_rad=joint["least_rad"],
        most_rad=joint["most_rad"],
    )
    check_joint(test, observed, asked, len(context["records"]), context["push"])
    return test


def _seen(problem: JointProblem, course: JointCourse, drive: JointDrive, step_s: float) -> int:
    """Bits that the course must set."""
    seen, limit = Status.OK, drive.speed_max_rad_per_s
    if limit is not None and np.abs(np.diff(course.motor_rad, axis=0)).max() > 1.05 * limit * step_s:
        seen |= Status.SPEED_LIMITED
    torque = course.inversion.drum_N * np.array(problem.windings_m) / drive.gear_ratio
    torque = torque.sum(axis=1) if problem.loop else torque
    if drive.torque_max_N_m is not None and np.abs(torque).max() > 1.02 * drive.torque_max_N_m:
        seen |= Status.TORQUE_LIMITED
    if problem.loop and course.inversion.slack_m.max() > 1e-4:
        seen |= Status.SLACK
    return int(seen)


def _observed_rad(scenario: JointScenario, course: JointCourse, rad: float) -> float:
    """Error that an observer may make in the joint's angle by the motors'; 0 where it takes no such motor."""
    step = scenario.run.step_s
    observed, fastest = observed_motor(scenario, course.angle_rad)
    quick = float(np.abs(np.diff(course.motor_rad, axis=0)).max(initial=0.0)) > STEP_RAD + fastest * step
    return 0.0 if quick else 20 * rad * max(1.0, abs(observed)) + 1e-8


def run_courses(
    sources: Mapping[str, str],
    prefix: str,
    precision: Precision,
    courses: Sequence[JointCourse],
    which: Sequence[int],
    drive: str = "",
    modules: Sequence[str] = (),
) -> tuple[list[JointAnswers], Driven | None] | None:
    """Answers of the exported code to courses, each of a joint by its number, and to a drive, its text in C.

    None where there is no C compiler. `modules` are those that the drive calls.
    """
    others = courses[0].other_rad.shape[1]
    each = f", &other[k * {others}]" if others else ""
    driver = _DRIVER.format(prefix=prefix, first=", other" if others else "", each=each)
    code = compile_on_host(sources, driver + (host_text(drive, prefix, modules) if drive else ""), precision)
    if code is None:
        return None
    call = code.function("run", ctypes.c_int, ctypes.c_long, *(code.reals,) * 4, result=ctypes.c_int)
    answers = []
    for course, number in zip(courses, which, strict=True):
        out = np.empty((len(course.angle_rad), 8), dtype=code.real)
        inputs = (code.array(each) for each in (course.angle_rad, course.contact_N_m, course.other_rad))
        if call(number, len(out), *inputs, out) != 1:
            raise CodeError(f"the exported code refuses the start of joint {number}")
        found = out.astype(np.float64)
        motors, tendons = course.motor_rad.shape[1], course.tension_N.shape[1]
        answers.append(
            JointAnswers(
                motor_rad=found[:, :motors],
                command_rad=found[:, 2 : 2 + motors],
                tension_N=found[:, 4 : 4 + tendons],
                motor_torque_N_m=found[:, 6 : 6 + motors],
            )
        )
    return answers, drive_on_host(code, precision) if drive else None


def drive_context(scenario: JointScenario, course: JointCourse, least_rad: float, most_rad: float) -> dict[str, object]:
    """Of a joint in a drive at random: sizes; limits, start and usual change of its angle, contact, motor."""
    mechanism = scenario.mechanism
    start, usual = float(course.angle_rad[0]), float(np.abs(np.diff(course.angle_rad)).max(initial=0.0))
    arm = max(abs(each) for each in mechanism.arms_at(start))
    fastest = STEP_RAD + observed_motor(scenario, course.angle_rad)[1] * scenario.run.step_s
    numbers = (least_rad, most_rad, start, usual, _PUSHED * arm * float(course.tension_N.max()), fastest)
    return {
        "motors": course.motor_rad.shape[1],
        "tendons": course.tension_N.shape[1],
        "numbers": [literal(float(value), Precision.DOUBLE) for value in numbers],
    }


def largest_departure(courses: Sequence[JointCourse], found: Sequence[JointAnswers]) -> float:
    """Largest departure of the motor angles that compiled code answers from those of the model [rad]."""
    return max(
        float(np.abs(answer.motor_rad - course.motor_rad).max())
        for course, answer in zip(courses, found[: len(courses)], strict=True)
    )
