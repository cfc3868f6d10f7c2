"""`tf.opti`: what a scenario asks for, as a `casadi.Opti` with the scenario's reference, limits and weights."""

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.optimal import posed
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.opti.joint import JointFormulation, formulate_joint
from tendonff.ocp.opti.tendon import Collocation, TensionFormulation, formulate
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.track import first_guess


@in_turn
def opti_of_tension(
    scenario: Scenario,
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    options: TrackOptions | None = None,
) -> TensionFormulation:
    """Pose the problem of one tendon; see `opti`."""
    if scenario.reference.periodic:
        raise InputError(
            f"{scenario.source.name}: opti starts at rest, and this reference is periodic; leave out periodic = true"
        )
    problem = Problem.of(scenario, level=level, options=options)
    tracking = posed(problem)
    collocation = Collocation(interval_s=interval_s, degree=degree, smoothing=smoothing)
    return formulate(tracking, first_guess(tracking, problem.inversion), collocation)


@in_turn
def opti_of_joint(
    scenario: JointScenario,
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    payload: bool = False,
) -> JointFormulation:
    """Pose the problem of a driven joint; see `opti`."""
    if scenario.reference.periodic:
        raise InputError(
            f"{scenario.source.name}: opti starts at rest, and this reference is periodic; leave out periodic = true"
        )
    if scenario.reference.quantity is not JointQuantity.ANGLE:
        raise InputError(
            f"{scenario.source.name}: opti of a joint follows an angle, this reference is a torque; give "
            'quantity = "joint_angle"'
        )
    task = JointTask.of(scenario, level)
    sampled, inverse = task.sampled, task.inversion
    return formulate_joint(
        task.problem,
        sampled.angle_rad,
        inverse.motor_rad,
        sampled.contact_N_m,
        scenario.run.step_s,
        Collocation(interval_s=interval_s, degree=degree, smoothing=smoothing),
        payload=payload,
    )
