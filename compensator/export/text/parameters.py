"""Parameters that a controller may change while it runs: friction both ways, load-independent friction, limits."""

from dataclasses import asdict, dataclass

import casadi as ca

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.stream import followed_range
from tendonff.compensator.compensators.table import accepted_range
from tendonff.models.layout import fields_of
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.elements import whole_of
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law, literal
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.target import SETTABLE, SchemeCode
from tendonff.ocp.step.target_joints import contact_code

_MU_MAX = 2.0
_EXPONENT_MAX = 20.0  # mu theta beyond which no tension gets through
_ADHESION_MAX_N = 1e3
_RATE_MAX = 1e30


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """Member of the record."""

    name: str  # C identifier
    unit: str  # as ASAP2 wants it; empty for a ratio
    text: str  # one line for the description file
    # value, low, high: of the scenario, and the range that is accepted
    value: float
    low: float
    high: float


def parameters_of(problem: Problem) -> tuple[Parameter, ...]:
    """Members of the record in their order; the limits of the scenario are the widest that are accepted."""
    friction, actuator = problem.transmission.friction, problem.transmission.actuator
    low, high = actuator.force_min_N, min(actuator.force_max_N, _RATE_MAX)
    rate = min(actuator.force_rate_max_N_per_s, _RATE_MAX * min(1.0, problem.reference.step_s))
    mu, back, adhesion = friction.mu_dynamic, friction.release_dynamic, friction.adhesion_N
    most = max(min(_MU_MAX, _EXPONENT_MAX / max(problem.transmission.path.total_angle_rad, 1.0)), mu, back)
    most_adhesion = max(_ADHESION_MAX_N, adhesion)
    accepted, followed = accepted_range(problem), followed_range(problem)
    rows = (
        ("mu_pull", "", "mu_dynamic, tendon moving towards the actuator", mu, 0.0, most),
        ("mu_release", "", "mu_dynamic, tendon moving towards the load", back, 0.0, most),
        ("adhesion", "N", "tension-independent part of the normal force", adhesion, 0.0, most_adhesion),
        ("force_min", "N", "least force of the actuator", low, low, high),
        ("force_max", "N", "largest force of the actuator", high, low, high),
        ("force_rate_max", "N/s", "largest change of the force per second", rate, 0.0, rate),
        ("reference_min", "N", "least reference that is followed live", followed[0], *accepted),
        ("reference_max", "N", "largest reference that is followed live", followed[1], *accepted),
    )
    return tuple(
        Parameter(name=name, unit=unit, text=text, value=value, low=least, high=largest)
        for name, unit, text, value, least, largest in rows
    )


def settable_inverse(problem: Problem, code: SchemeCode, precision: Precision, prefix: str) -> dict[str, object]:
    """The exact inverse whose friction the controller may change: what its templates need."""
    settable = tuple(name for name in code.free if name in SETTABLE)
    retune: dict[str, object] = {"retune": ""}
    if not problem.chain.moving:  # else every bend has numbers of its own
        law = _settable_law(problem, settable)
        printed = PartialEvaluator(prefix=f"{prefix}_inverse", precision=precision, parameters={}).fold(law)
        retune = {"retune": printed.code, "retune_inputs": printed.inputs}
    numbers, friction = problem.chain.numbers(), problem.transmission.friction
    mu = friction.mu_dynamic
    return {
        **asdict(code),
        **retune,
        "free": settable,
        "free_values": {name: _floored(name, numbers[name]) for name in settable},
        "passed": [f"self->own.{n}" if n in settable else literal(float(numbers[n]), precision) for n in code.free],
        "release_share": friction.release_dynamic / mu if mu > 0 else 1.0,
    }


def settable_numbers(problem: Problem) -> tuple[str, ...]:
    """Members of the inverse that hold the numbers of its masses."""
    if problem.chain.moving:
        joints = Joints.of(problem.chain)
        own = contact_code(problem.chain, joints, "tff_inverse", Precision.DOUBLE, settable=True).own
        contact = (f"chain.contact[{k}].{name}" for k in range(len(joints.bends)) for name in own)
        return ("own.piece_adhesion_N", "pull", "release", *contact)
    alike = {f"friction_{name}" for name in problem.chain.friction.aliases()}
    return tuple(f"own.{name}" for name in SETTABLE if name not in alike)


def _settable_law(problem: Problem, names: tuple[str, ...]) -> Law:
    """Numbers of one mass over what the record holds; static coefficients keep their ratio to dynamic ones."""
    mu_pull, mu_release, adhesion = given = tuple(ca.SX.sym(name) for name in ("mu_pull", "mu_release", "adhesion"))
    whole = whole_of(problem.transmission, problem.level)
    changed = {"adhesion_N": adhesion}
    for way, mu in (("pull", mu_pull), ("release", mu_release)):
        dynamic, static = whole.value(f"mu_dynamic_{way}"), whole.value(f"mu_static_{way}")
        changed |= {
            f"mu_dynamic_{way}": mu,
            f"mu_static_{way}": mu * (static / dynamic) if dynamic > 0 else ca.fmax(mu, static),
        }
    elements = whole.changed(changed).divided(problem.chain.count)
    records = (("piece_", elements.piece), ("friction_", elements.friction))
    found = {name: value for prefix, record in records for name, value in fields_of(record, prefix).items()}
    return Law(
        name="settable_numbers",
        comment="Numbers of one mass over what can be set, eqs. (8), (9).",
        inputs=given,
        outputs={name: _floored(name, ca.SX(found[name])) for name in names},
    )


def _floored(name: str, value: ca.SX) -> ca.SX:
    """Coefficients as the laws of the inverse want them: never zero."""
    return at_least(value, COEFFICIENT_FLOOR) if name.startswith("friction_") else value


def parameter_context(problem: Problem) -> dict[str, object]:
    """Values of the record for every template."""
    parameters = parameters_of(problem)
    angle = problem.transmission.path.total_angle_rad
    return {"parameters": {p.name: p for p in parameters}, "angle_rad": angle}
