"""`tendonff export-fmu` of a driven joint: angle of the joint in and that of its motor out, or the other way."""

from collections.abc import Sequence
from dataclasses import replace

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.export.driven.modules import module_files
from tendonff.compensator.export.driven.table import TABLE, table_content
from tendonff.compensator.export.feedback import FEEDBACK_SOURCES, feedback_sources
from tendonff.compensator.export.feedback_module import joint_module
from tendonff.compensator.export.joint.golden import followed_course
from tendonff.compensator.export.joint.text import accepted_rad, joint_sources, problem_of
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.modules import check_prefix
from tendonff.compensator.export.motors import judge, stated
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.unit import Fmu, Variable, pack
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, on_level, sample_joint
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.joint.start import start_tensions
from tendonff.ocp.joint.target import ConstantData, other_joints

_MODULES = {
    **dict.fromkeys((Kind.INVERSE, Kind.PLANT, Kind.OBSERVER), ("joint",)),
    Kind.TABLE: ("table",),
    Kind.ADAPTIVE: ("joint", "joint_adaptive"),
    Kind.FEEDBACK: ("joint", *FEEDBACK_SOURCES),
}
"""Modules of exported C in each kind of unit; the last is the one that it calls."""


@in_turn
def build_joint_fmu(
    scenario: JointScenario,
    kind: Kind = Kind.INVERSE,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> Fmu:
    """Wrap the exported C of a joint; arguments and errors as of `tendonff.export_fmu`."""
    check_prefix(prefix)
    adaptive, observes = kind is Kind.ADAPTIVE, kind in (Kind.PLANT, Kind.OBSERVER)
    _check_tables(scenario, kind)
    scenario = on_level(scenario, level)
    if not adaptive:
        scenario = replace(scenario, adaptation=None)
    sampled = sample_joint(scenario)
    problem = problem_of(scenario, sampled)
    mechanism, name = scenario.mechanism, harmless(scenario.name)
    task = JointTask(scenario=scenario, sampled=sampled, mechanism=mechanism, level=scenario.run.level)
    if reason := task.without.get(kind.value):
        raise InputError(f"{scenario.source.name}: no unit of the kind {kind}: {reason}; use --kind inverse")
    looks_up = kind is Kind.TABLE
    provenance = f' * Scenario "{name}", hash {scenario.digest()}, level {scenario.run.level}; tendonff {__version__}.'
    sources = _sources(task, kind, prefix, provenance)
    others = other_joints((problem,))
    lines, warnings = tuple[str, ...](), tuple[str, ...]()
    if not observes:
        command = None
        if looks_up:
            data = ConstantData(f"{prefix}_{TABLE.name}", Precision.DOUBLE)
            content = table_content(task, data)
            command = content.reference_rad
            sources |= module_files(TABLE, [content], data, prefix, f"{prefix}_joint.h", provenance)
        if command is None:
            command = followed_course(scenario, sampled, problem, others, Precision.DOUBLE).command_rad
        lines, warnings = stated(judge(task, mechanism.joint.name, command), force_export=force_export)
    start, contact = float(sampled.angle_rad[0]), float(sampled.contact_N_m[0])
    least, most = accepted_rad(scenario, sampled)
    tensions, _ = start_tensions(mechanism, start, contact)
    motors = 1 if problem.loop else len(mechanism.tendons)
    winders = [""] if motors == 1 else [f"_{tendon.name}" for tendon in mechanism.tendons]

    def angle(name: str, text: str) -> Variable:
        return Variable(name=name, text=text, unit="rad", start=repr(start), low=least, high=most)

    def motor(name: str, text: str) -> Variable:
        return Variable(name=name, text=f"{text} angle of the motor since the start", unit="rad", start="0.0")

    strained = [
        Variable(name=f"tension_{tendon.name}", text="tension at the joint", unit="N", start=repr(float(tension)))
        for tendon, tension in zip(mechanism.tendons, tensions, strict=True)
    ]
    given, outputs = (
        angle("angle", "reference angle of the joint"),
        [motor(f"motor{end}", "commanded") for end in winders],
    )
    extras = [
        Variable(name="contact", text="torque of the joint on what it touches", unit="N.m", start=repr(contact)),
        *(
            Variable(
                name=f"joint_{other}",
                text=f"angle of the joint {other}",
                unit="rad",
                start=repr(float(sampled.others(mechanism.joint.name)[other][0])),
            )
            for other in others
        ),
    ]
    if adaptive:
        outputs.append(Variable(name="factor", text="present estimate over the scenario's value", unit="", start="1.0"))
    if adaptive or kind is Kind.FEEDBACK:
        extras.append(angle("measured", "last measurement of the joint's angle"))
    elif observes:
        given, *more = [motor(f"motor{end}", "present (behind its drive)") for end in winders]
        outputs, extras = [angle("angle", "angle of the joint"), *_asked(winders)], [*extras, *more]
    elif looks_up:
        low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
        given, extras, others = replace(given, low=low, high=high), [], ()
    identifier = f"{prefix}_{'joint' if kind is Kind.INVERSE else f'joint_{kind}'}"
    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "identifier": identifier,
        "compiled": [f"{prefix}_{each}.c" for each in _MODULES[kind]],
        "description": f"{kind} of the joint {mechanism.joint.name}, level {scenario.run.level}: {name}",
        "version": __version__,
        "input": given,
        "first": angle("initial_angle", "angle of the joint at rest before the start"),
        "outputs": outputs if adaptive or looks_up else [*outputs, *strained],
        "extras": extras,
        "module": _MODULES[kind][-1],
        "observes": observes,
        "radians": True,
        "joint_at": -1,
        "motors": 1 + motors if observes else motors,
        "winders": winders,
        "others": others,
        "taken": "an angle or the contact",
        "refusal": "a communication step must be longer than 0 s",
        "step": repr(scenario.run.step_s),
        "stop": repr(float(sampled.time_s[-1])),
        "provenance": provenance,
    }
    return pack(
        sources,
        context,
        fmi,
        model="model_motors",
        everywhere=everywhere,
        lines=lines,
        warnings=warnings,
    )


def _asked(winders: Sequence[str]) -> list[Variable]:
    tells = "torque that the tendons ask of the motor"
    return [Variable(name=f"torque{end}", text=tells, unit="N.m", start="0.0") for end in winders]


def _sources(task: JointTask, kind: Kind, prefix: str, provenance: str) -> dict[str, str]:
    """Texts of the joint by file name, and of its feedback where the kind has one."""
    sources, settings = joint_sources((task.scenario,), prefix=prefix), task.scenario.feedback
    if kind is Kind.FEEDBACK and settings is not None:
        sources |= feedback_sources(joint_module(JointFeedbackTask.of(task, settings)), prefix, provenance)
    return sources


def _check_tables(scenario: JointScenario, kind: Kind) -> None:
    """Refuse a kind whose table the scenario has not."""
    tables = {Kind.ADAPTIVE: ("adaptation", scenario.adaptation), Kind.FEEDBACK: ("feedback", scenario.feedback)}
    name, table = tables.get(kind, ("", scenario))
    if table is None:
        raise InputError(f"{scenario.source.name}: table [{name}] is missing; --kind {kind} needs it")
