"""`tf.opti`: what a scenario asks for, as a `casadi.Opti` with the scenario's reference, limits and weights."""

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.drive import require_stiff_gears
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.optimal import posed
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.opti.choices import Collocation
from tendonff.ocp.opti.joint import JointFormulation, Pursuit, formulate_joint, formulate_mechanism
from tendonff.ocp.opti.tendon import TensionFormulation, formulate
from tendonff.ocp.optimal.track import first_guess


@in_turn
def opti_of_tension(
    scenario: Scenario, how: Collocation, *, level: Level | None = None, payload: bool = False
) -> TensionFormulation:
    """Pose the problem of one tendon; see `opti`."""
    _require_once(scenario.source.name, scenario.reference.periodic)
    if payload and scenario.transmission.load.joint is not None:
        raise InputError(
            f"{scenario.source.name}: a joint moves the far end, whatever loads it; payload is for one on its spring"
        )
    problem = Problem.of(scenario, level=level)
    tracking = posed(problem)
    return formulate(tracking, first_guess(tracking, problem.inversion), how, payload=payload)


@in_turn
def opti_of_joint(
    scenario: JointScenario, how: Collocation, *, level: Level | None = None, payload: bool = False
) -> JointFormulation:
    """Pose the problem of a driven joint; see `opti`."""
    _require_once(scenario.source.name, scenario.reference.periodic)
    require_stiff_gears(scenario.source.name, [scenario.mechanism.drive], "opti")
    if scenario.reference.quantity is not JointQuantity.ANGLE:
        raise InputError(
            f"{scenario.source.name}: opti of a joint follows an angle, this reference is a torque; give "
            'quantity = "joint_angle"'
        )
    task = JointTask.of(scenario, level)
    pursuit = Pursuit(
        wanted_rad=task.sampled.angle_rad[:, None],
        motor_rad=task.inversion.motor_rad,
        contact_N_m=task.sampled.contact_N_m[:, None],
        step_s=scenario.run.step_s,
    )
    return formulate_joint(task.problem, pursuit, how, payload=payload)


@in_turn
def opti_of_finger(
    scenario: FingerScenario, how: Collocation, *, level: Level | None = None, payload: bool = False
) -> JointFormulation:
    """Pose the problem of several driven joints; see `opti`."""
    _require_once(scenario.source.name, scenario.periodic)
    require_stiff_gears(scenario.source.name, [motor.drive for motor in scenario.mechanism.motors], "opti")
    task = FingerTask.of(scenario, level)
    pursuit = Pursuit(
        wanted_rad=task.wanted_rad,
        motor_rad=task.inversion.motor_rad,
        contact_N_m=task.sampled.effort_N_m,
        step_s=scenario.run.step_s,
    )
    drives = [motor.drive for motor in scenario.mechanism.motors]
    problem = task.problem(scenario.mechanism)
    return formulate_mechanism(problem, drives, task.sampled.motion, pursuit, how, payload=payload)


def _require_once(file: str, periodic: bool) -> None:
    if periodic:
        raise InputError(f"{file}: opti starts at rest, and this reference is periodic; leave out periodic = true")
