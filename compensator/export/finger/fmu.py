"""`tendonff export-fmu` of a finger: wanted angles in, angles of the motors and tensions out, or the other way."""

from tendonff._version import __version__
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.finger.golden import followed_course
from tendonff.compensator.export.finger.text import finger_module
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.modules import check_prefix
from tendonff.compensator.export.motors import judge, stated
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.unit import Fmu, Variable, pack
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision


@in_turn
def build_finger_fmu(
    scenario: FingerScenario,
    kind: Kind = Kind.INVERSE,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> Fmu:
    """Wrap the exported C of a finger; arguments and errors as of `tendonff.export_fmu`."""
    check_prefix(prefix)
    task = FingerTask.of(scenario, level)
    if reason := task.without.get(kind.value):
        raise InputError(f"{scenario.source.name}: no unit of the kind {kind}: {reason}; use --kind inverse")
    task.check_reach()
    module = finger_module([task], [task.problem(task.finger)], Precision.DOUBLE, prefix)
    [described] = module.context["fingers"]
    observes = kind in (Kind.PLANT, Kind.OBSERVER)
    lines, warnings = tuple[str, ...](), tuple[str, ...]()
    if not observes:
        command = followed_course(task, Precision.DOUBLE).command_rad
        lines, warnings = stated(judge(task, described["symbol"].lower(), command), force_export=force_export)
    joints, name = described["joints"], harmless(scenario.name)
    columns = (described[key].tolist() for key in ("least", "most", "start"))

    def angle(key: str, text: str, of: tuple[str, float, float, float], *, fixed: bool = False) -> Variable:
        joint, low, high, start = of
        known = {"unit": "rad", "start": repr(start), "low": low, "high": high, "is_parameter": fixed}
        return Variable(name=f"{key}_{joint}", text=f"{text} {joint}", **known)  # type: ignore[arg-type]

    each = list(zip(joints, *columns, strict=True))
    torques = task.sampled.effort_N_m[0, : len(joints)].tolist()
    motors = described["motors"]
    turned = [_motor(name, "present (behind its drive)" if observes else "commanded") for name in motors]
    wanted = [angle("angle", "angle of the joint" if observes else "reference angle of the joint", one) for one in each]
    given, outputs = (turned, wanted) if observes else (wanted, turned)
    if observes:
        outputs = [
            *outputs,
            *(_torque(f"torque_at_{m}", f"torque that the tendons ask of the motor {m}") for m in motors),
        ]
    problem = task.problem(task.finger)
    outputs = [
        *outputs,
        *(
            Variable(name=f"tension_{t}", text=f"tension of {t} at its far end", unit="N", start=repr(tension))
            for t, tension in zip(described["tendons"], problem.tension_N.tolist(), strict=True)
        ),
    ]
    rest = "angle at rest before the start of the joint"
    extras = [
        *given[1:],
        *(_torque(f"torque_{j}", f"torque of {j} on what it touches", x) for j, x in zip(joints, torques, strict=True)),
        *(angle("initial_angle", rest, one, fixed=True) for one in each[1:]),
    ]
    identifier = f"{prefix}_finger" if kind is Kind.INVERSE else f"{prefix}_finger_{kind}"
    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "identifier": identifier,
        "compiled": [f"{prefix}_finger.c"],
        "description": f"{kind} of the finger {described['symbol'].lower()}, level {task.level}: {name}",
        "version": __version__,
        "input": given[0],
        "first": angle("initial_angle", rest, each[0]),
        "outputs": outputs,
        "extras": extras,
        "module": "finger",
        "observes": observes,
        "winders": motors,
        "joints": len(joints),
        "radians": True,
        "joint_at": -1,
        "motors": len(outputs) - len(described["tendons"]),
        "others": (),
        "taken": "an angle or a torque",
        "refusal": "a communication step must be longer than 0 s",
        "step": repr(task.step_s),
        "stop": repr(float(task.sampled.time_s[-1])),
        "provenance": f' * Scenario "{name}", hash {scenario.digest()}, level {task.level}; tendonff {__version__}.',
    }
    return pack(
        module.files,
        context,
        fmi,
        model="model_motors",
        everywhere=everywhere,
        lines=lines,
        warnings=warnings,
    )


def _motor(name: str, which: str) -> Variable:
    return Variable(
        name=f"motor_{name}", text=f"{which} angle of the motor {name} since the start", unit="rad", start="0.0"
    )


def _torque(name: str, text: str, start: float = 0.0) -> Variable:
    return Variable(name=name, text=text, unit="N.m", start=repr(start))
