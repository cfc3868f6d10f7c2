"""`tf.opti`: what a scenario asks for, as a `casadi.Opti` with the scenario's reference, limits and weights."""

from typing import overload

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.optimal import posed
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.joint.compensators import JointTask
from tendonff.compensator.joint.scenario.reference import JointQuantity
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.opti.joint import JointFormulation, formulate_joint
from tendonff.ocp.opti.tendon import Collocation, Formulation, formulate
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.track import first_guess


@overload
def opti(
    scenario: Scenario,
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    options: TrackOptions | None = None,
) -> Formulation: ...
@overload
def opti(
    scenario: JointScenario,
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    payload: bool = False,
) -> JointFormulation: ...
@in_turn
def opti(
    scenario: Scenario | JointScenario | FingerScenario,
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    options: TrackOptions | None = None,
    payload: bool = False,
) -> Formulation | JointFormulation:
    """Pose the optimal-control problem of a scenario by direct collocation, to be extended and solved by IPOPT.

    Parameters
    ----------
    scenario : Scenario or JointScenario
        The tension of one tendon, or the angle of one driven joint.
    level : Level, optional
        Of the model; default: the scenario's.
    interval_s : float, optional
        Length of an interval, over which force and motors are linear [s], > 0. Default 0.005.
    degree : int, optional
        Of the states' polynomials, 1 to 9; 1, the default, is implicit Euler.
    smoothing : float, optional
        Friction switches over this share of the largest sliding speed of the first guess [-], > 0: abs(v) becomes
        sqrt(v^2 + w^2). Default 3e-4.
    options : TrackOptions, optional
        Weights and bounds of a tendon's problem; default: the scenario's table [optimal].
    payload : bool, optional
        Of a joint: the torque on what it touches is a variable that your equations decide.

    Raises
    ------
    InputError
        If the scenario is none that this can pose.
    SolveError
        If the first guess cannot be simulated.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger_fast.toml")
    >>> short = replace(scenario.reference, duration_s=0.1)
    >>> problem = tf.opti(replace(scenario, reference=short))
    >>> problem.opti.subject_to(problem.tension_N[3, 1:] <= 60.0)  # at the middle of the path
    >>> answer = problem.solve()
    >>> answer.value(problem.force_N).shape
    (21,)
    """
    collocation = Collocation(interval_s=interval_s, degree=degree, smoothing=smoothing)
    if isinstance(scenario, FingerScenario):
        raise InputError(
            f"{scenario.source.name}: opti takes one tendon or one driven joint, this scenario has several; take "
            "mechanism_equations for a problem of your own"
        )
    if scenario.reference.periodic:
        raise InputError(
            f"{scenario.source.name}: opti starts at rest, and this reference is periodic; leave out periodic = true"
        )
    if isinstance(scenario, JointScenario):
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
            collocation,
            payload=payload,
        )
    problem = Problem.of(scenario, level=level, options=options)
    tracking = posed(problem)
    return formulate(tracking, first_guess(tracking, problem.inversion), collocation)
