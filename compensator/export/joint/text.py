"""The text of exported C of joints: templates, their values, and the module rendered from them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.adaptation import TunedJoint
from tendonff.compensator.compensators.stream import RE_ENTRY_S
from tendonff.compensator.export.joint import observed
from tendonff.compensator.export.joint.adaptive import adaptive_context
from tendonff.compensator.export.modules import accepted_steps
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint, sample_joint
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.start import joint_problem
from tendonff.ocp.joint.target import MOVES, joint_code, other_joints

_TEMPLATES = environment("tendonff.compensator.export", "templates/joint", "templates/library")
_PACKAGES = environment("tendonff.compensator.export", "templates/transmission")
_PUSH_N = -1e-6
"""Tensions of a loop that count as pushing: those of rounding do not."""


def joint_sources(
    scenarios: Sequence[JointScenario], *, precision: Precision = Precision.DOUBLE, prefix: str = "tff"
) -> dict[str, str]:
    """Header and source of the module alone, by file name; arguments as of `export_joints`."""
    sampled = [sample_joint(scenario) for scenario in scenarios]
    problems = [problem_of(scenario, each) for scenario, each in zip(scenarios, sampled, strict=True)]
    return module_text(scenarios, sampled, problems, precision, prefix)[0]


def module_text(
    scenarios: Sequence[JointScenario],
    sampled: Sequence[SampledJoint],
    problems: Sequence[JointProblem],
    precision: Precision,
    prefix: str,
) -> tuple[dict[str, str], dict[str, Any]]:
    """The same, and the values for the templates."""
    others = other_joints(problems)
    tuned = [
        None if scenario.adaptation is None else TunedJoint.of(scenario, each)
        for scenario, each in zip(scenarios, sampled, strict=True)
    ]
    # Behind the joints themselves what their tuners run: each joint at the bounds of its factor.
    more = [(end, each) for one, each in zip(tuned, sampled, strict=True) if one for end in (one.low, one.high)]
    every = [
        *zip(scenarios, sampled, problems, strict=True),
        *((end, each, problem_of(end, each)) for end, each in more),
    ]
    code = joint_code([each[2] for each in every], scenarios[0].run.step_s, f"{prefix}_joint", precision, others)
    context = _context(scenarios, problems, code.masses, precision, prefix, others)
    context |= {"core": code.core, "data": code.data, "rest_torque": _rest_torque(code.core, prefix, precision)}
    records = [_described(*each, given, precision) for each, given in zip(every, code.others, strict=True)]
    context |= {"records": records, "joints": records[: len(scenarios)]}
    context |= adaptive_context(scenarios, tuned, prefix, precision)
    modules = ["joint", *(["joint_adaptive"] if more else [])]
    context |= {"modules": modules, "headers": [f"{prefix}_{m}.h" for m in modules]}
    return {f"{prefix}_{m}.{end}": render(f"{m}.{end}.j2", context) for m in modules for end in ("h", "c")}, context


def problem_of(scenario: JointScenario, sampled: SampledJoint) -> JointProblem:
    """The joint as its chains; what they refuse is said with the name of the file."""
    try:
        return joint_problem(scenario.mechanism, scenario.run.level, sampled.motion)
    except ParameterError as error:
        raise InputError(f"{scenario.source.name}: {error}") from None


def accepted_rad(scenario: JointScenario, sampled: SampledJoint) -> tuple[float, float]:
    """Angles that a live reference may have; by default as far as the moment arms keep their signs.

    InputError where the range that the scenario states cannot be.
    """
    mechanism, angle, file = scenario.mechanism, sampled.angle_rad, scenario.source.name
    least, most, later = float(angle.min()), float(angle.max()), angle[sampled.lead :]  # behind the homing stroke
    low, high = mechanism.joint.accepted_rad(float(later.min()), float(later.max()))
    low, high = min(low, least), max(high, most)
    signs = np.sign(mechanism.arms_at(float(angle[0])))
    for part in (1.0, 0.5, 0.25, 0.1, 0.0):
        ends = least + part * (low - least), most + part * (high - most)
        if all(_same_signs(mechanism, end, signs) for end in ends):
            return ends
        if mechanism.joint.range_rad is not None:
            break
    raise InputError(
        f"{file}: a moment arm of the joint {mechanism.joint.name} vanishes or changes its sign between {low:g} and "
        f"{high:g} rad; shorten range_rad, or the lengths that give the arm"
    )


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
        "state_bytes": 8 * -(-((2 * (2 * layout.size + memory) + 55) * size + 36) // 8),
        "stack_bytes": max(1600 if precision is Precision.DOUBLE else 1024, 256 + 2 * layout.size * size),
        "others": others,
        "other_parameter": f", const {prefix}_real other_rad[]" if others else "",
        "re_entry": max(1, round(RE_ENTRY_S / step)),
        "steps": accepted_steps(step),
        "observe_moves": observed.MOVES,
        "observe_width_rad": 1e-13 if precision is Precision.DOUBLE else 2e-7,
        "observe_step_rad": observed.STEP_RAD,
        "observe_lost_s": max(observed.LOST_S, 10 * step),
        "observe_speed": f"{observed.SPEED:g}",
        "observe_speed_of_course": f"{observed.SPEED_OF_COURSE:g}",
        "halvings": 45 if precision is Precision.DOUBLE else 22,
        "observe_rad": 1e-11 if precision is Precision.DOUBLE else 2e-6,
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
    least, most = accepted_rad(scenario, sampled)
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
        *(text(change), text(drive.torque_max_N_m or 1e30), text(drive.servo.servo_time_s / step)),
        *(text(scale[0] / mechanism.arms_at(float(sampled.angle_rad[0]))[0]),),
        *(text(observed.observed_motor(scenario, sampled.angle_rad)[1]),),
        *(text(drive.play_rad / 2), text(drive.turning_rad), text(drive.gives_rad_per_N_m)),
        text(observed.stiffness_N_m_per_rad(scenario, sampled.angle_rad)),
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


_TRANSMISSION = {
    "{p}_transmission.hpp": "transmission.hpp.j2",
    "{p}_transmission_loader.cpp": "loader.cpp.j2",
    "{p}_transmission.xml": "plugin.xml.j2",
    "package.xml": "package.xml.j2",
    "CMakeLists.txt": "cmake.txt.j2",
}


def transmission_files(context: dict[str, Any], others: Sequence[str]) -> dict[str, str]:
    """Package of a ros2_control transmission; none for joints with two motors, or whose paths follow other joints."""
    if others or all(joint["motors"] != 1 for joint in context["joints"]):
        return {}
    prefix = context["prefix"]
    folder = f"ros2/{prefix}_transmission"
    texts = {name: _PACKAGES.get_template(template).render(context) for name, template in _TRANSMISSION.items()}
    return {f"{folder}/{name.format(p=prefix)}": text for name, text in texts.items()}


def render(template: str, context: dict[str, Any]) -> str:
    """Text of a template of joints."""
    return _TEMPLATES.get_template(template).render(context)
