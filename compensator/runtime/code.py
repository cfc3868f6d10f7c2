"""The C that a runtime runs: the sources of one exported module, and a driver that hands over plain numbers."""

from dataclasses import dataclass, replace

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.stream import choose_stream, followed_range
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.compensators.tuning import check_tuning
from tendonff.compensator.export.feedback import feedback_sources
from tendonff.compensator.export.feedback_module import joint_module, tension_module
from tendonff.compensator.export.joint.text import accepted_rad, joint_sources, problem_of
from tendonff.compensator.export.modules import ADAPTIVE, STREAM, c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.feedback.tension import tension_task
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.runtime.kinds import RuntimeKind
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.compensator.scenario.settings import Stream
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.joint.target import other_joints
from tendonff.ocp.step.joints import Joints

REFERENCE = "reference"
"""Name of what a step follows, in the ranges of a runtime."""

_TENDON = """#include "tff_{module}.h"
long tff_runtime_size(void) {{ return (long)sizeof(tff_{module}); }}
int tff_runtime_init(void *memory, double start, const double *joints)
{{
    tff_{module} *const self = memory;
    (void)joints;
    tff_{module}_init(self, start);
    return self->output.status == TFF_OK;
}}
unsigned tff_runtime_step(void *memory, double dt, double reference, double measured, const double *joints, double *out)
{{
    tff_{module} *const self = memory;
    (void)measured;
    (void)joints;
    out[0] = tff_{module}_step_dt(self, dt, reference{arguments});
    return self->output.status;
}}
"""
_JOINT = """#include "tff_joint.h"
long tff_runtime_size(void) {{ return (long)sizeof(tff_joint); }}
int tff_runtime_init(void *memory, double start, const double *joints)
{{
    return tff_joint_init(memory, 0, {angle_at_start}, {contact_at_start}{others});
}}
unsigned tff_runtime_step(void *memory, double dt, double reference, double measured, const double *joints, double *out)
{{
    tff_joint *const self = memory;
    const unsigned status = tff_joint_step_dt(self, dt, {angle}, {contact}{others});
    (void)measured;
    (void)joints;
    out[0] = self->command_rad[0];
    out[1] = self->command_rad[1];
    return status;
}}
"""
_FED_JOINT = """#include "tff_control.h"
long tff_runtime_size(void) {{ return (long)sizeof(tff_control); }}
int tff_runtime_init(void *memory, double start, const double *joints)
{{
    (void)joints;
    return tff_control_init(memory, 0, start, 0.0{others});
}}
unsigned tff_runtime_step(void *memory, double dt, double reference, double measured, const double *joints, double *out)
{{
    tff_control *const self = memory;
    const unsigned status = tff_control_step_dt(self, dt, reference, 0.0, measured{others});
    int k;
    (void)joints;
    for (k = 0; k < TFF_FEEDBACK_COMMANDS; k++) {{
        out[k] = self->command_rad[k];
    }}
    return status;
}}
"""
_ADAPTIVE_JOINT = """#include "tff_joint_adaptive.h"
long tff_runtime_size(void) {{ return (long)sizeof(tff_joint_adaptive); }}
int tff_runtime_init(void *memory, double start, const double *joints)
{{
    (void)joints;
    return tff_joint_adaptive_init(memory, 0, start, 0.0{others});
}}
unsigned tff_runtime_step(void *memory, double dt, double reference, double measured, const double *joints, double *out)
{{
    tff_joint_adaptive *const self = memory;
    const unsigned status = tff_joint_adaptive_step_dt(self, dt, reference, 0.0, measured{others});
    (void)joints;
    out[0] = self->command_rad;
    out[1] = self->factor;
    return status;
}}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimeCode:
    """Module of exported C with its driver.

    Attributes
    ----------
    kind : RuntimeKind
    driven : bool
        Of a driven joint, not of one tendon.
    sources : dict of str to str
        Text by file name.
    driver : str
    digest : str
        Of the scenario.
    step_s : float
        Sample time of the scenario [s].
    start : float
        Reference at rest before the first step [N, rad or N m].
    joints : tuple of str
        Joints whose angles a step takes, in order.
    joints_start_rad : tuple of float
        Where they stand at the start.
    outputs : int
        Numbers that are commanded.
    measures : bool
        A step uses what is measured.
    ranges : dict of str to (float, float)
        Values that are accepted, of the reference and of joints by name.
    """

    kind: RuntimeKind
    driven: bool
    sources: dict[str, str]
    driver: str
    digest: str
    step_s: float
    start: float
    joints: tuple[str, ...]
    joints_start_rad: tuple[float, ...]
    outputs: int
    measures: bool
    ranges: dict[str, tuple[float, float]]


def joint_runtime(scenario: JointScenario, kind: RuntimeKind | None) -> RuntimeCode:
    """Code of a driven joint; the default kind is adaptive where the scenario has [adaptation], else the inverse."""
    file, tuned = scenario.source.name, scenario.adaptation is not None
    kind = kind or (RuntimeKind.ADAPTIVE if tuned else RuntimeKind.JOINT)
    if kind not in (RuntimeKind.ADAPTIVE, RuntimeKind.JOINT):
        raise InputError(f'{file}: a driven joint has the kinds "joint" and "adaptive", got "{kind}"')
    if kind is RuntimeKind.ADAPTIVE and not tuned:
        raise InputError(f'{file}: table [adaptation] is missing; sensor = "joint_angle" is all it needs')
    adaptive = kind is RuntimeKind.ADAPTIVE
    scenario = scenario if adaptive else replace(scenario, adaptation=None)
    sampled = sample_joint(scenario)
    problem = problem_of(scenario, sampled)
    torque = scenario.reference.quantity is JointQuantity.TORQUE
    own, names = scenario.mechanism.joint.name, other_joints((problem,))
    columns = sampled.others(own)
    start = [float(columns[name][0]) for name in names]
    others = ", joints" if names else ""
    fed = (
        None
        if adaptive or scenario.feedback is None
        else JointFeedbackTask.of(JointTask.of(scenario), scenario.feedback)
    )
    reference, angle = (sampled.contact_N_m, f"joints[{len(names)}]") if torque else (sampled.angle_rad, "reference")
    sources = joint_sources((scenario,))
    if fed is not None:
        sources |= feedback_sources(joint_module(fed), "tff")
    return RuntimeCode(
        kind=kind,
        driven=True,
        sources=sources,
        driver=(_ADAPTIVE_JOINT if adaptive else _JOINT if fed is None else _FED_JOINT).format(
            others=others,
            angle=angle,
            contact="reference" if torque else "0.0",
            angle_at_start=angle.replace("reference", "start"),
            contact_at_start="start" if torque else "0.0",
        ),
        digest=scenario.digest(),
        step_s=scenario.run.step_s,
        start=float(reference[0]),
        joints=(*names, own) if torque else names,
        joints_start_rad=(*start, float(sampled.angle_rad[0])) if torque else tuple(start),
        outputs=1 if problem.loop else len(scenario.mechanism.tendons),
        measures=adaptive or fed is not None,
        ranges={own if torque else REFERENCE: accepted_rad(scenario, sampled)},
    )


def tendon_runtime(scenario: Scenario, kind: RuntimeKind | None) -> RuntimeCode:
    """Code of one tendon; the default kind is adaptive where the scenario has [adaptation], else the inverse."""
    file, tuned = scenario.source.name, scenario.adaptation is not None
    kind = kind or (RuntimeKind.ADAPTIVE if tuned else RuntimeKind.INVERSE)
    if kind is RuntimeKind.JOINT:
        raise InputError(f'{file}: kind "joint" is for driven joints; use "inverse"')
    if kind is RuntimeKind.ADAPTIVE and not tuned:
        raise InputError(f"{file}: table [adaptation] is missing; the adaptive runtime needs its sensor")
    check_tuning(scenario)
    problem = Problem.of(scenario)
    if kind is RuntimeKind.ADAPTIVE and problem.transmission.actuator.drive is Drive.POSITION:
        raise InputError(f'{file}: a position drive has no adaptive runtime; use kind "inverse"')
    further: dict[str, object] = {}
    if kind is RuntimeKind.STREAM:
        choice = choose_stream(problem, scenario.stream or Stream())
        if choice is None:
            raise InputError(f'{file}: no filter serves this reference; use kind "inverse"')
        further["stream"] = choice.picked.design
    modules = [module for module in c_modules(scenario, True) if module.name == "inverse"]
    modules = [ADAPTIVE] if kind is RuntimeKind.ADAPTIVE else modules
    modules += [STREAM] if kind is RuntimeKind.STREAM else []
    joints = Joints.of(problem.chain) if scenario.joints else None
    names = () if joints is None else joints.names
    arguments = (", measured" if kind is RuntimeKind.ADAPTIVE else "") + (", joints" if names else "")
    sources = c_sources(scenario, problem, modules, Precision.DOUBLE, "tff", further)
    driver, fed = _TENDON.format(module=kind.value, arguments=arguments), False
    if scenario.feedback is not None and kind is RuntimeKind.INVERSE:
        fed = True
        sources |= feedback_sources(tension_module(tension_task(problem, scenario.feedback, file)), "tff")
        driver = _TENDON.format(module="control", arguments=f", measured{arguments}")
    return RuntimeCode(
        kind=kind,
        driven=False,
        sources=sources,
        driver=driver,
        digest=scenario_hash(scenario),
        step_s=problem.reference.step_s,
        start=problem.reference.initial_tension_N,
        joints=tuple(names),
        joints_start_rad=() if joints is None else tuple(float(q) for q in joints.start_rad),
        outputs=1,
        measures=fed or kind is RuntimeKind.ADAPTIVE,
        ranges={
            REFERENCE: followed_range(problem) if kind is RuntimeKind.STREAM else accepted_range(problem),
            **({} if joints is None else joints.ranges),
        },
    )
