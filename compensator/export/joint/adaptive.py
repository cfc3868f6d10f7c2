"""Values for the templates of joints that tune themselves."""

from collections.abc import Sequence
from dataclasses import asdict

from tendonff.compensator.compensators.motors.adaptation import TunedJoint
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.ocp.adaptation.joint import STILL, between_law, tuning_law
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.step.render import law_calls

_SAMPLE = {"angle": "angle_rad", "moved": "moved_rad", "samples": "samples", "taught": "taught"}
_SAMPLE |= {"commanded": "commanded_rad"} | {f"v{k}": f"motor_rad[{k}]" for k in range(3)}


def adaptive_context(
    scenarios: Sequence[JointScenario], tuned: Sequence[TunedJoint | None], prefix: str, precision: Precision
) -> dict[str, object]:
    """Values of the module of self-tuning joints; `adaptive` is empty where there are none."""
    known = [(k, one) for k, one in enumerate(tuned) if one is not None]
    if not known:
        return {"adaptive": []}
    printer = PartialEvaluator(prefix=f"{prefix}_joint", precision=precision, parameters={})
    laws = {law.name: printer.fold(law) for law in (between_law(), tuning_law())}
    start = known[0][1].tuning.start()
    numbers = [_own(name) for name in asdict(known[0][1].tuning) if name != "delay_samples"]
    call = law_calls(laws)
    every = {name: f"t->{name}" for name in numbers}
    state = {name: f"self->{name}" for name in start}
    found = {f"{name}_new": f"&self->{name}" for name in start} | {"bound": "&bound", "doubt": "&doubt"}
    sample = {name: f"s->{place}" for name, place in _SAMPLE.items()} | {"measured": "measured"}
    between = {"f": "self->used", "value": "&value"} | {f"v{k}": f"v[{k}]" for k in range(3)}
    adaptive = []
    for place, (k, one) in enumerate(known):
        settings = scenarios[k].adaptation
        own = {_own(name): value for name, value in asdict(one.tuning).items()}
        drive, step = scenarios[k].mechanism.drive, scenarios[k].run.step_s
        change = 1e30 if drive.speed_max_rad_per_s is None else drive.speed_max_rad_per_s * step
        adaptive.append(
            {
                "name": scenarios[k].mechanism.joint.name,
                "symbol": scenarios[k].mechanism.joint.name.upper(),
                "lost_rad": (one.tuning.still - 4 * (settings.noise if settings else 0.0)) / STILL,
                "delay": one.tuning.delay_samples,
                "nodes": (len(scenarios) + 2 * place, k, len(scenarios) + 2 * place + 1),
                "numbers": [literal(float(v), precision) for v in (change, *(own[name] for name in numbers))],
            }
        )
    words = {"mu": "friction", "pretension": "pre-tension"}
    named = dict.fromkeys(words[p] for s in scenarios if s.adaptation for p in s.adaptation.parameters)
    return {
        "adaptive": adaptive,
        "tuned_words": " and ".join(named),
        "tuned_rad": 1e-9 if precision is Precision.DOUBLE else 2e-5,  # rounding of the parabola
        "past": 1 + max(one.tuning.delay_samples for _, one in known),
        "state": tuple(start),
        "start": [(name, literal(value, precision)) for name, value in start.items()],
        "numbers_of_tuning": numbers,
        "laws": "\n".join(law.code for law in laws.values()),
        "between_call": call("tuned_between", every, between),
        "tuning_call": call("joint_tuning", every, state, sample, found),
    }


def _own(name: str) -> str:
    """Name in C of a number of the recursion; the state has a mean that is called slow."""
    return "slow_share" if name == "slow" else name
