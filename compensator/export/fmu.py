"""`tendonff export-fmu`: the exported C as a co-simulation unit for FMI 2.0 and 3.0, sources included."""

from tendonff._version import __version__
from tendonff.compensator.compensators.base import CModule, Problem
from tendonff.compensator.compensators.table import BuiltTable, accepted_range, table_of
from tendonff.compensator.compensators.tuning import check_tuning
from tendonff.compensator.export.feedback import FEEDBACK_SOURCES, feedback_sources
from tendonff.compensator.export.feedback_module import tension_module
from tendonff.compensator.export.judgement import Judged, chosen, judge, profiles_of, score_lines
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.modules import ADAPTIVE, OBSERVER, PLANT, c_modules, check_prefix
from tendonff.compensator.export.observer import ObserverDesign
from tendonff.compensator.export.text.c_text import c_sources, harmless, shared_sources, table_context
from tendonff.compensator.export.text.parameters import parameters_of
from tendonff.compensator.export.unit import Fmu, Variable, pack
from tendonff.compensator.feedback.tension import tension_task
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.joints import Joints


@in_turn
def build_fmu(
    scenario: Scenario,
    kind: Kind = Kind.INVERSE,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> Fmu:
    """Wrap the exported C of a scenario; arguments and errors as of `tendonff.export_fmu`."""
    check_prefix(prefix)
    if kind is Kind.ADAPTIVE and scenario.adaptation is None:
        raise InputError(f"{scenario.source.name}: table [adaptation] is missing; --kind adaptive needs its sensor")
    if kind is Kind.FEEDBACK and scenario.feedback is None:
        raise InputError(f"{scenario.source.name}: table [feedback] is missing; --kind feedback needs its sensor")
    check_tuning(scenario)
    problem = Problem.of(scenario, level=level)
    fed = scenario.feedback if kind is Kind.FEEDBACK else None
    wanted = Kind.INVERSE if fed else kind
    module = next((module for module in c_modules(scenario) if module.name == wanted.value), None)
    if module is None:
        raise InputError(f"{scenario.source.name}: no {kind} serves this drive and path; use --kind inverse")
    identifier = f"{prefix}_{kind}"
    names = (module.name, *(FEEDBACK_SOURCES if fed else ()))
    compiled = [f"{prefix}_{name}.c" for name in (*shared_sources(problem, names), *names)]
    built = table_of(problem) if kind is Kind.TABLE else None
    judged, warnings = _judged(problem, built, module, force_export=force_export)
    further = {} if built is None else table_context(built, Precision.DOUBLE)
    sources = c_sources(scenario, problem, (module,), Precision.DOUBLE, prefix, further)
    if fed:
        sources |= feedback_sources(tension_module(tension_task(problem, fed, scenario.source.name)), prefix)
    context = _context(scenario, problem, kind, prefix, identifier, compiled)
    return pack(sources, context, fmi, everywhere=everywhere, lines=score_lines(judged), warnings=warnings)


def _judged(
    problem: Problem, built: BuiltTable | None, module: CModule, *, force_export: bool
) -> tuple[tuple[Judged, ...], tuple[str, ...]]:
    """Error of the unit, as judged by `export-c`; the adaptive one counts as the inverse that it tunes."""
    if module in (PLANT, OBSERVER):
        return (), ()
    name = "inverse" if module == ADAPTIVE else module.name
    judged = judge(problem, profiles_of(problem, built, names=(name,)))
    return judged, chosen(judged, (module,), force_export=force_export)[1]


def _context(
    scenario: Scenario, problem: Problem, kind: Kind, prefix: str, identifier: str, compiled: list[str]
) -> dict[str, object]:
    reference, level = problem.reference, problem.level
    rest = problem.chain.rest_state(reference.initial_tension_N)
    initial = repr(reference.initial_tension_N)
    low, high = accepted_range(problem)
    parameters = {parameter.name: parameter for parameter in parameters_of(problem)}
    given = Variable(name="reference", text="reference tension", unit="N", start=initial, low=low, high=high)
    force = Variable(name="force", text="force of the actuator, within its limits", unit="N", start=initial)
    servo = scenario.transmission.actuator.drive is Drive.POSITION
    if servo:
        force = Variable(name="command", text="position of the servo relative to the start", unit="m", start="0.0")
    extras, outputs = list[Variable](), [force]
    mu = repr(scenario.transmission.friction.mu_dynamic)
    if kind is Kind.ADAPTIVE and scenario.adaptation is not None:
        outputs.append(Variable(name="mu", text="present estimate of mu_dynamic", unit="", start=mu))
        sensor = scenario.adaptation.sensor
        first = initial if sensor is Sensor.OUTPUT_TENSION else "0.0"
        words = f"last measurement: {sensor.words}"
        extras.append(Variable(name="measured", text=words, unit=sensor.unit, start=first))
    elif kind is Kind.FEEDBACK:
        text = "last measurement of the output tension"
        extras.append(Variable(name="measured", text=text, unit="N", start=initial))
    elif kind is Kind.INVERSE:
        extras.append(
            Variable(
                name="mu",
                text="mu_dynamic",
                unit="",
                start=mu,
                is_parameter=True,
                low=parameters["mu_pull"].low,
                high=parameters["mu_pull"].high,
            )
        )
    elif kind is Kind.OBSERVER:
        most = ObserverDesign(problem=problem).input_max_N
        text = "tension at the near end"
        given = Variable(name="input_tension", text=text, unit="N", start=initial, low=0.0, high=most)
        text = "position of the near end relative to the start, positive towards the actuator"
        extras.append(Variable(name="input_position", text=text, unit="m", start="0.0"))
        text = "whether the position is measured: 0 or 1"
        extras.append(Variable(name="has_position", text=text, unit="", start="0.0", low=0.0, high=1.0))
        outputs = [
            Variable(name="tension", text="output tension", unit="N", start=initial),
            Variable(name="low", text="lower bound of it", unit="N", start="0.0"),
            Variable(name="high", text="upper bound of it", unit="N", start=initial),
        ]
    elif kind is Kind.PLANT:
        given = force if servo else Variable(name="force", text="force of the actuator", unit="N", start=initial)
        near, far = repr(rest.near_position_m), repr(rest.far_position_m)
        outputs = [
            Variable(name="tension", text="output tension", unit="N", start=initial),
            Variable(name="actuator_position", text="positive towards the actuator", unit="m", start=near),
            Variable(name="load_position", text="positive towards the actuator", unit="m", start=far),
        ]
    joints = [] if problem.chain.motion is None else _joint_inputs(problem.chain)
    name = harmless(scenario.name)
    return {
        "prefix": prefix,
        "guard": prefix.upper(),
        "kind": "control" if kind is Kind.FEEDBACK else kind,
        "identifier": identifier,
        "compiled": compiled,
        "description": f"{kind} of the tendon chain, level {level}: {name}",
        "version": __version__,
        "input": given,
        "outputs": outputs,
        **({"servo": True} if servo else {}),
        "extras": [*extras, *joints],
        "joint_at": len(extras) if joints else -1,
        "taken": " or ".join(v.name for v in (given, *extras, *joints)),
        "initial": initial,
        "first": Variable(
            name="initial_tension",
            text="uniform tension at rest before the start",
            unit="N",
            start=initial,
            low=low,
            high=high,
        ),
        "refusal": f"a communication step must be a whole number of samples of {scenario.run.step_s!r} s",
        "step": repr(scenario.run.step_s),
        "stop": repr(float(reference.time_s[-1])),
        "provenance": f' * Scenario "{name}", hash {scenario_hash(scenario)}, level {level}; tendonff {__version__}.',
    }


def _joint_inputs(chain: Chain) -> list[Variable]:
    joints = Joints.of(chain)
    rows = zip(joints.names, joints.start_rad, joints.least_rad, joints.most_rad, strict=True)
    return [
        Variable(name=f"joint_{name}", text=f"angle of the joint {name}", unit="rad", start=repr(start), low=a, high=b)
        for name, start, a, b in rows
    ]
