"""`tendonff export-fmu` of a driven joint: wanted angle in, angle of the motor and tensions out."""

from dataclasses import replace

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.export.joint.golden import followed_course
from tendonff.compensator.export.joint.text import accepted_rad, joint_sources, problem_of
from tendonff.compensator.export.kinds import FmiVersion
from tendonff.compensator.export.modules import check_prefix
from tendonff.compensator.export.motors import judge
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.unit import Fmu, Variable, pack
from tendonff.compensator.scenario.driven.joint import JointScenario, on_level, sample_joint
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError
from tendonff.ocp.joint.start import start_tensions
from tendonff.ocp.joint.target import other_joints


@in_turn
def build_joint_fmu(
    scenario: JointScenario,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> Fmu:
    """Wrap the exported C of a joint; arguments and errors as of `tendonff.export_fmu`."""
    check_prefix(prefix)
    scenario = replace(on_level(scenario, level), adaptation=None)  # a unit has no measured angle
    sampled = sample_joint(scenario)
    problem = problem_of(scenario, sampled)
    others = other_joints((problem,))
    course = followed_course(scenario, sampled, problem, others, Precision.DOUBLE)
    judged = judge(
        JointTask(scenario=scenario, sampled=sampled, mechanism=scenario.mechanism, level=scenario.run.level),
        scenario.mechanism.joint.name,
        course.command_rad,
    )
    if judged.fault and not force_export:
        raise SolveError(
            f"no unit is made: {judged.fault}. Let the reference move more slowly, or make it all the same with "
            "--force-export"
        )
    mechanism, name = scenario.mechanism, harmless(scenario.name)
    start, contact = float(sampled.angle_rad[0]), float(sampled.contact_N_m[0])
    least, most = accepted_rad(scenario, sampled)
    tensions, _ = start_tensions(problem, contact)
    motors = 1 if problem.loop else len(mechanism.tendons)
    winders = [""] if motors == 1 else [f"_{tendon.name}" for tendon in mechanism.tendons]

    def angle(name: str, text: str) -> Variable:
        return Variable(name=name, text=text, unit="rad", start=repr(start), low=least, high=most)

    identifier = f"{prefix}_joint"
    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "identifier": identifier,
        "compiled": [f"{identifier}.c"],
        "description": f"inverse of the joint {mechanism.joint.name}, level {scenario.run.level}: {name}",
        "version": __version__,
        "input": angle("angle", "reference angle of the joint"),
        "first": angle("initial_angle", "angle of the joint at rest before the start"),
        "outputs": [
            *(
                Variable(
                    name=f"motor{end}", text="commanded angle of the motor since the start", unit="rad", start="0.0"
                )
                for end in winders
            ),
            *(
                Variable(
                    name=f"tension_{tendon.name}", text="tension at the joint", unit="N", start=repr(float(tension))
                )
                for tendon, tension in zip(mechanism.tendons, tensions, strict=True)
            ),
        ],
        "extras": [
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
        ],
        "module": "joint",
        "radians": True,
        "joint_at": -1,
        "motors": motors,
        "others": others,
        "taken": "an angle or the contact",
        "refusal": "a communication step must be longer than 0 s",
        "step": repr(scenario.run.step_s),
        "stop": repr(float(sampled.time_s[-1])),
        "provenance": f' * Scenario "{name}", hash {scenario.digest()}, level {scenario.run.level}; '
        f"tendonff {__version__}.",
    }
    sources = joint_sources((scenario,), prefix=prefix)
    warnings = (f"{judged.fault}; made because of --force-export",) if judged.fault else ()
    return pack(
        sources,
        context,
        fmi,
        model="model_motors",
        everywhere=everywhere,
        lines=(judged.line,),
        warnings=warnings,
    )
