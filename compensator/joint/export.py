"""`tendonff export-c` of driven joints: one copy of the code, a record for each joint."""

import ctypes
import json
import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.stream import RE_ENTRY_S
from tendonff.compensator.export.golden import to_and_fro
from tendonff.compensator.export.modules import check_prefix
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.writing import atomic_directory, write_text
from tendonff.compensator.joint.compensators import inverse_of, linear_motor_rad
from tendonff.compensator.joint.drive import commanded, known_by_ratio
from tendonff.compensator.joint.plant import REFINEMENT, JointPlant, verifying_masses
from tendonff.compensator.joint.reference import JointQuantity
from tendonff.compensator.joint.scenario import JointScenario, SampledJoint, sample_joint
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.path import JointMotion
from tendonff.ocp.codegen.compiler import find_compiler, run_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.joint.invert import JointInversion, JointStatus, invert_joint
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.start import joint_problem
from tendonff.ocp.joint.target import MOVES, joint_code, other_joints

_TEMPLATES = environment("tendonff.compensator.export", "templates/joint")
_FILES = ("self_test.c", "example_main.c", "Makefile", "CMakeLists.txt", "README.md")
_FLAGS = ("-std=c99", "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno")
_ROWS = 1000
_REVERSAL_ROWS = 240
_SLACK_BIT, _SPEED_BIT, _TORQUE_BIT = 32, 4, 2
_PUSH_N = -1e-6
"""Tensions of a loop that count as pushing: those of rounding do not."""

_DOUBLE_RAD, _DOUBLE_N = 1e-9, 1e-5
_UNMEASURED_RAD, _UNMEASURED_N = 2e-4, 0.05
"""Largest differences from the model that pass: in double, and in float where it was not measured."""

_MARGIN = 0.25
"""Angles beyond the reference that are accepted, as a share of its range."""

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
        out[6 * k] = self.motor_rad[0];
        out[(6 * k) + 1] = self.motor_rad[1];
        out[(6 * k) + 2] = self.command_rad[0];
        out[(6 * k) + 3] = self.command_rad[1];
        out[(6 * k) + 4] = self.tension_N[0];
        out[(6 * k) + 5] = self.tension_N[1];
    }}
    return good;
}}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Course:
    """Inputs of one joint, exact in the real type of the export, and what the model answers, a row a sample."""

    angle_rad: FloatArray
    contact_N_m: FloatArray
    other_rad: FloatArray  # shape (rows, others)
    inversion: JointInversion
    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class _Answers:
    """Output of exported code on a sequence."""

    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedJoint:
    """Errors of the exported commands of a joint.

    Attributes
    ----------
    name : str
        Of the joint.
    rms, plain_rms : float
        RMS error of the exported inverse and of the ratio alone, on the verifying mechanism [rad or N m].
    range : float
        Of the reference [rad or N m].
    is_angle : bool
    fault : str
        Why it should not run on the rig; empty where nothing speaks against it.
    """

    name: str
    rms: float
    plain_rms: float
    range: float
    is_angle: bool
    fault: str

    def text(self, value: float) -> str:
        """An error in degrees or N m."""
        return f"{math.degrees(value):.2g} deg" if self.is_angle else f"{value:.2g} N m"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedJoints:
    """Content of an export, before it is written.

    Attributes
    ----------
    files : dict of str to str
        Text by file name.
    judged : tuple of JudgedJoint
    loss_rad : float or None
        Largest departure of the compiled code from the model; None without a compiler.
    warnings : tuple of str
    """

    files: dict[str, str]
    judged: tuple[JudgedJoint, ...]
    loss_rad: float | None
    warnings: tuple[str, ...]

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write every file, all or nothing; makes the folder."""
        with atomic_directory(folder) as partial:
            for name, text in self.files.items():
                write_text(partial / name, text)


def export_joints(
    scenarios: Sequence[JointScenario],
    *,
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    force_export: bool = False,
) -> ExportedJoints:
    """Print the whole folder.

    Parameters
    ----------
    scenarios : sequence of JointScenario
        One for each joint, with the same step.
    precision : Precision, optional
    prefix : str, optional
        Prefix of every C name and file.
    force_export : bool, optional
        Export joints all the same whose commands are worse than the ratio alone.

    Raises
    ------
    InputError
        If names or steps of the scenarios do not go together.
    SolveError
        If a joint's inverse fails, or is worse than the ratio alone.
    """
    check_prefix(prefix)
    _check_together(scenarios)
    sampled = [sample_joint(scenario) for scenario in scenarios]
    problems = [_problem(scenario, each) for scenario, each in zip(scenarios, sampled, strict=True)]
    others = other_joints(problems)
    sources, context = _sources(scenarios, sampled, problems, precision, prefix)
    courses = [_golden(*each, others, precision) for each in zip(scenarios, sampled, problems, strict=True)]
    runs = [_follow(*each, others, precision) for each in zip(scenarios, sampled, problems, strict=True)]
    joints: list[dict[str, object]] = context["joints"]
    found = _run_on_host(sources, prefix, precision, [*courses, *runs], list(range(len(scenarios))) * 2)
    judged = []
    for k, (scenario, each, problem) in enumerate(zip(scenarios, sampled, problems, strict=True)):
        told = runs[k].command_rad
        if found is not None and not scenario.reference.periodic:
            told = found[len(scenarios) + k].command_rad
        judged.append(_judge(scenario, each, told))
        joints[k] |= {
            "golden": _golden_context(scenario, problem, courses[k], None if found is None else found[k], precision),
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
    loss = None if found is None else _loss(courses, found)
    context |= {
        "loss": f"{loss:.2g}" if loss is not None and precision is Precision.FLOAT else "",
        "verifying": f"{max(verifying_masses(s.mechanism) for s in scenarios)} masses a tendon at step/{REFINEMENT}",
    }
    files = sources | {name: _render(f"{name}.j2", context) for name in _FILES}
    files["design.json"] = _design_json(scenarios, problems, judged, precision, prefix, loss)
    kept = tuple(f"{fault}; exported because of --force-export" for fault in faults)
    return ExportedJoints(
        files=files, judged=tuple(judged), loss_rad=loss, warnings=(*_warnings(runs, scenarios), *kept)
    )


def joint_sources(
    scenarios: Sequence[JointScenario], *, precision: Precision = Precision.DOUBLE, prefix: str = "tff"
) -> dict[str, str]:
    """Header and source of the module alone, by file name; arguments as of `export_joints`."""
    sampled = [sample_joint(scenario) for scenario in scenarios]
    problems = [_problem(scenario, each) for scenario, each in zip(scenarios, sampled, strict=True)]
    return _sources(scenarios, sampled, problems, precision, prefix)[0]


def _sources(
    scenarios: Sequence[JointScenario],
    sampled: Sequence[SampledJoint],
    problems: Sequence[JointProblem],
    precision: Precision,
    prefix: str,
) -> tuple[dict[str, str], dict[str, Any]]:
    """The same, and the values for the templates."""
    others = other_joints(problems)
    code = joint_code(problems, scenarios[0].run.step_s, f"{prefix}_joint", precision, others)
    context = _context(scenarios, problems, code.masses, precision, prefix, others)
    context |= {"core": code.core, "data": code.data, "rest_torque": _rest_torque(code.core, prefix, precision)}
    context["joints"] = [
        _described(*each, precision) for each in zip(scenarios, sampled, problems, code.others, strict=True)
    ]
    return {f"{prefix}_joint.{end}": _render(f"joint.{end}.j2", context) for end in ("h", "c")}, context


def _check_together(scenarios: Sequence[JointScenario]) -> None:
    names: dict[str, str] = {}
    for scenario in scenarios:
        name, file = scenario.mechanism.joint.name.upper(), scenario.source.name
        if name in names:
            raise InputError(
                f'{file}: joint "{scenario.mechanism.joint.name}" stands in {names[name]} too; give each joint of one '
                "project a name of its own"
            )
        names[name] = file
        if scenario.run.step_s != scenarios[0].run.step_s:
            raise InputError(
                f"{file} [run]: step_s = {scenario.run.step_s:g} differs from {scenarios[0].run.step_s:g} of "
                f"{scenarios[0].source.name}; joints of one project share their sample time"
            )


def _problem(scenario: JointScenario, sampled: SampledJoint) -> JointProblem:
    try:
        return joint_problem(scenario.mechanism, scenario.run.level, sampled.motion)
    except ParameterError as error:
        raise InputError(f"{scenario.source.name}: {error}") from None


def _golden(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem, others: Sequence[str], precision: Precision
) -> _Course:
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


def _follow(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem, others: Sequence[str], precision: Precision
) -> _Course:
    """The reference itself; of one that repeats, its steady state, which exported code reaches after some cycles."""
    if not scenario.reference.periodic:
        course = _course(scenario, sampled, problem, others, precision, slice(None), np.empty(0))
        if course.inversion.status is JointStatus.FAILED:
            raise SolveError(course.inversion.message)
        return course
    found, _ = inverse_of(scenario, sampled, problem)
    told = commanded(scenario.mechanism.drive, found.motor_rad, scenario.run.step_s)
    course = _course(scenario, sampled, problem, others, precision, slice(None), np.empty(0))
    return replace(course, inversion=found, motor_rad=found.motor_rad, command_rad=told, tension_N=found.tension_N)


def _course(
    scenario: JointScenario,
    sampled: SampledJoint,
    problem: JointProblem,
    others: Sequence[str],
    precision: Precision,
    rows: slice,
    back_rad: FloatArray,
) -> _Course:
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
    return _Course(
        angle_rad=angle,
        contact_N_m=contact,
        other_rad=np.column_stack([still[:, None][:, :0], *(columns.get(name, still) for name in others)]),
        inversion=found,
        motor_rad=found.motor_rad,
        command_rad=commanded(scenario.mechanism.drive, found.motor_rad, step, live=True),
        tension_N=found.tension_N,
    )


def _judge(scenario: JointScenario, sampled: SampledJoint, told_rad: FloatArray) -> JudgedJoint:
    """Simulate commands, and those of the ratio alone, on the mechanism that a design is verified on."""
    mechanism, step = scenario.mechanism, scenario.run.step_s
    plant = JointPlant(
        mechanism=mechanism,
        scenario=scenario,
        sampled=sampled,
        masses=verifying_masses(mechanism),
        refinement=REFINEMENT,
    )
    plain = commanded(known_by_ratio(mechanism.drive), linear_motor_rad(scenario, sampled), step)
    errors = []
    for command in (told_rad, plain):
        error = (plant.reached(plant.respond(command)) - sampled.wanted)[sampled.lead :]
        errors.append(float(np.sqrt(np.mean(error**2))))
    judged = JudgedJoint(
        name=mechanism.joint.name,
        rms=errors[0],
        plain_rms=errors[1],
        range=sampled.range,
        is_angle=scenario.reference.quantity is JointQuantity.ANGLE,
        fault="",
    )
    if errors[0] < errors[1]:
        return judged
    fault = f"RMS error {judged.text(errors[0])}, not better than the ratio alone ({judged.text(errors[1])})"
    return replace(judged, fault=fault)


def _accepted(scenario: JointScenario, sampled: SampledJoint) -> tuple[float, float]:
    """Angles around the reference at which the moment arms keep their signs."""
    mechanism, angle = scenario.mechanism, sampled.angle_rad
    low, high = float(angle.min()), float(angle.max())
    margin = _MARGIN * (high - low)
    start = np.sign(mechanism.arms_at(float(angle[0])))
    for part in (1.0, 0.5, 0.25, 0.1):
        if all(_same_signs(mechanism, q, start) for q in (low - part * margin, high + part * margin)):
            return low - part * margin, high + part * margin
    return low, high


def _same_signs(mechanism: Mechanism, angle_rad: float, signs: FloatArray) -> bool:
    try:
        return bool(np.all(np.sign(mechanism.arms_at(angle_rad)) == signs))
    except ParameterError:
        return False


def _context(
    scenarios: Sequence[JointScenario],
    problems: Sequence[JointProblem],
    masses: int,
    precision: Precision,
    prefix: str,
    others: Sequence[str],
) -> dict[str, Any]:
    step, size = scenarios[0].run.step_s, 4 if precision is Precision.FLOAT else 8
    layout = max((chain.layout for problem in problems for chain in problem.chains), key=lambda each: each.size)
    guard = prefix.upper()
    memory = _memory(problems, masses)
    return {
        "prefix": prefix,
        "guard": guard,
        "real": precision.value,
        "fabs": "fabsf" if precision is Precision.FLOAT else "fabs",
        "num": lambda value: literal(float(value), precision),
        "numbers": lambda values: _wrapped([literal(float(v), precision) for v in values]),
        "exact": lambda values: _wrapped([literal(float(v), Precision.DOUBLE) for v in values]),
        "provenance": "\n".join(f" * {line}" for line in _provenance(scenarios, precision, prefix)),
        "version": __version__,
        "step": step,
        "step_s": repr(step),
        "masses": masses,
        "states": layout.size,
        "memory": memory,
        "state_bytes": 8 * -(-((2 * (2 * layout.size + memory) + 41) * size + 40) // 8),
        "others": others,
        "other_parameter": f", const {prefix}_real other_rad[]" if others else "",
        "re_entry": max(1, round(RE_ENTRY_S / step)),
        "push": _PUSH_N if precision is Precision.DOUBLE else 100 * _PUSH_N,
        "moves": MOVES[precision],
        "example_rows": max(20, min(4000, round(2.0 / step))),
    }


def _memory(problems: Sequence[JointProblem], masses: int) -> int:
    """Numbers that one tendon keeps beside its states: `PREFIX_SIDE_REALS` of the largest."""
    layout = problems[0].chains[0].layout
    contacts = len(problems[0].chains[0].of_masses()) - 1  # wrap angle, mass and friction of each; kept twice
    a, b = layout.offset("end")
    work = (a * masses + b) + 2 * (masses + 1) + len(layout.friction_states) * masses + (masses + 2)
    work += 2 * (masses + 1) + (masses + 2) + masses * (3 + contacts)
    return work + 3 * (3 * masses + 3) + 3 * (masses + 1) + 1


def _provenance(scenarios: Sequence[JointScenario], precision: Precision, prefix: str) -> list[str]:
    named = [f'Scenario "{harmless(s.name)}", hash {s.digest()}, level {s.run.level.value}.' for s in scenarios]
    return [
        *named,
        f"Written by tendonff {__version__} export-c --precision {precision} --prefix {prefix}.",
        "The licence of tendonff does not cover what it writes: this file is yours.",
    ]


def _wrapped(items: Sequence[str]) -> str:
    rows = [", ".join(items[k : k + 5]) for k in range(0, len(items), 5)]
    return ",\n".join(f"    {row}" for row in rows)


def _rest_torque(core: str, prefix: str, precision: Precision) -> str:
    """Call of the joint's law at rest, with the arguments that it takes in this project."""
    law = f"{prefix}_joint_joint_torque"
    head = core[core.index(f"static void {law}(") :]
    names = [each.split()[-1].lstrip("*") for each in head[head.index("(") + 1 : head.index(")")].split(",")]
    zero, one = (literal(v, precision) for v in (0.0, 1.0))
    hinge = f"{prefix}_joint_hinges[self->which]"
    known = {"w": zero, "w_base": zero, "q_base": "angle_rad", "dry_base": zero, "H": one}
    known |= {"torque": "&held", "by_w": "&slope", "dry": "&dry"}
    return f"{law}({', '.join(known.get(name, f'{hinge}.{name}') for name in names)})"


def _described(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem, others: Sequence[str], precision: Precision
) -> dict[str, object]:
    """Values of a joint for the templates; `others` names arrays in C, by tendon, where any path follows one."""
    mechanism, drive, step = scenario.mechanism, scenario.mechanism.drive, scenario.run.step_s
    least, most = _accepted(scenario, sampled)
    loop, count = drive.kind is DriveKind.LOOP, len(mechanism.tendons)
    compliance = [
        1 / (t.tendon.stiffness_N_per_m * radius)
        for t, radius in zip(mechanism.tendons, mechanism.drum_radius_m, strict=True)
    ]
    scale = [winding / drive.gear_ratio for winding in problem.windings_m]
    change = 1e30 if drive.speed_max_rad_per_s is None else drive.speed_max_rad_per_s * step

    def text(value: float) -> str:
        return literal(float(value), precision)

    def both(values: Sequence[float]) -> str:
        return "{ " + ", ".join(text(v) for v in (values if len(values) > 1 else [*values, *values])) + " }"

    numbers = [
        *(str(count), str(int(loop)), text(least), text(most)),
        *(text(drive.pretension_N or 0.0), text(drive.least_tension_N or 0.0), both(compliance), both(scale)),
        *(text(change), text(drive.torque_max_N_m or 1e30), text(drive.servo_time_s / step)),
        *(text(drive.play_rad / 2), text(drive.turning_rad)),
    ]
    if others:
        numbers.append("{ " + ", ".join(others if len(others) > 1 else [*others, *others]) + " }")
    start = float(sampled.angle_rad[0])
    return {
        "name": mechanism.joint.name,
        "symbol": mechanism.joint.name.upper(),
        "kind": drive.kind.value,
        "tendons": [tendon.name for tendon in mechanism.tendons],
        "motors": 1 if loop else count,
        "numbers": numbers,
        "least_rad": least,
        "most_rad": most,
        "start_rad": start,
        "reach_rad": 0.5 * (most - start if most - start > start - least else least - start),
        "scenario_name": harmless(scenario.name),
        "scenario_hash": scenario.digest(),
        "level": scenario.run.level.value,
    }


def _golden_context(
    scenario: JointScenario, problem: JointProblem, course: _Course, found: _Answers | None, precision: Precision
) -> dict[str, object]:
    drive, step = scenario.mechanism.drive, scenario.run.step_s
    rad, told, newton = _DOUBLE_RAD, 4 * _DOUBLE_RAD, _DOUBLE_N
    if precision is Precision.FLOAT:
        # A reversal that rounding tells a sample later crosses the play that much later.
        rad, told, newton = _UNMEASURED_RAD, 4 * _UNMEASURED_RAD + drive.play_rad, _UNMEASURED_N
        if found is not None:
            rad = 1e-5 + 3 * float(np.abs(found.motor_rad - course.motor_rad).max())
            told = 1e-5 + 3 * float(np.abs(found.command_rad - course.command_rad).max())
            newton = 1e-3 + 3 * float(np.abs(found.tension_N - course.tension_N).max())
    seen = 0
    limit = drive.speed_max_rad_per_s
    if limit is not None and np.abs(np.diff(course.motor_rad, axis=0)).max() > 1.05 * limit * step:
        seen |= _SPEED_BIT
    torque = course.inversion.drum_N * np.array(problem.windings_m) / drive.gear_ratio
    torque = torque.sum(axis=1) if problem.loop else torque
    if drive.torque_max_N_m is not None and np.abs(torque).max() > 1.02 * drive.torque_max_N_m:
        seen |= _TORQUE_BIT
    if problem.loop and course.inversion.slack_m.max() > 1e-4:
        seen |= _SLACK_BIT
    still = problem.mechanism.motor_rad(
        np.column_stack([t.path_travel_m(course.angle_rad) for t in problem.mechanism.tendons]), problem.start_rad
    )
    beyond = course.motor_rad - (still - still[:1])[:, : course.motor_rad.shape[1]]
    return {
        "angle_rad": course.angle_rad,
        "contact_N_m": course.contact_N_m,
        "other_rad": course.other_rad,
        "motor_rad": course.motor_rad,
        "command_rad": course.command_rad,
        "tension_N": course.tension_N,
        "tolerance_rad": f"{rad:.3g}",
        "tolerance_command": f"{told:.3g}",
        "tolerance_N": f"{newton:.3g}",
        "change_rad": f"{1e30 if limit is None else limit * step:.9g}",
        "back_rad": f"{1e-3 + 2 * float(np.ptp(beyond)):.3g}",
        "seen": seen,
    }


def _render(template: str, context: dict[str, Any]) -> str:
    return _TEMPLATES.get_template(template).render(context)


def _run_on_host(
    sources: dict[str, str], prefix: str, precision: Precision, courses: Sequence[_Course], which: Sequence[int]
) -> list[_Answers] | None:
    """Answers of the exported code to courses; None where there is no C compiler."""
    compiler = find_compiler()
    if compiler is None:
        return None
    others = courses[0].other_rad.shape[1]
    each = f", &other[k * {others}]" if others else ""
    driver = _DRIVER.format(prefix=prefix, first=", other" if others else "", each=each)
    real = np.float32 if precision is Precision.FLOAT else np.float64
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch)
        for name, text in {**sources, "driver.c": driver}.items():
            (folder / name).write_text(text, encoding="utf-8")
        names = ["driver.c", f"{prefix}_joint.c", "-lm"]
        if complaint := run_compiler(compiler, [*_FLAGS, "-o", "code.so", *names], folder):
            raise CodeError(f"the exported sources: {complaint}")
        code = ctypes.CDLL(str(folder / "code.so"))
    answers = []
    for course, number in zip(courses, which, strict=True):
        arrays = [np.ascontiguousarray(a, dtype=real) for a in (course.angle_rad, course.contact_N_m, course.other_rad)]
        out = np.empty((len(course.angle_rad), 6), dtype=real)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*arrays, out)]
        if code.run(ctypes.c_int(number), ctypes.c_long(len(out)), *pointers) != 1:
            raise CodeError(f"the exported code refuses the start of joint {number}")
        found = out.astype(np.float64)
        motors, tendons = course.motor_rad.shape[1], course.tension_N.shape[1]
        answers.append(
            _Answers(
                motor_rad=found[:, :motors],
                command_rad=found[:, 2 : 2 + motors],
                tension_N=found[:, 4 : 4 + tendons],
            )
        )
    return answers


def _loss(courses: Sequence[_Course], found: Sequence[_Answers]) -> float:
    return max(
        float(np.abs(answer.motor_rad - course.motor_rad).max())
        for course, answer in zip(courses, found[: len(courses)], strict=True)
    )


def _warnings(runs: Sequence[_Course], scenarios: Sequence[JointScenario]) -> tuple[str, ...]:
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
