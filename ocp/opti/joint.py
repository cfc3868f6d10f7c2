"""The optimal motion of a joint's motors as `casadi.Opti`, for users to extend: a payload, a bound, another cost.

Variables are the angles of the motors at the ends of the intervals, linear between them, and the states of joint and
tendons: position drives lead the near ends. What the joint touches is a torque that the user's equations may decide.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.mechanism.equations import MechanismEquations, equations_of
from tendonff.ocp.integrate.joint import cut_joint, led_places, page_state
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.start import start_memory
from tendonff.ocp.opti.collocation import History, collocate
from tendonff.ocp.opti.tendon import Collocation, Formulation, ipopt_options

_STEADY = 1e-4
"""Cost of the squared steps of the motors beside the squared error: of two motors only one follows from the joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFormulation(Formulation):
    """Motor angles whose joint angle is wanted.

    Attributes
    ----------
    equations : MechanismEquations
        Of joint and tendons.
    wanted_rad : ndarray, shape (n,)
        Reference of the joint.
    motor_rad : ca.MX, shape (motors, n)
        Since the start.
    angle_rad, speed_rad_per_s : ca.MX, shape (n, 1)
        Of the joint.
    contact_N_m : ca.MX, shape (n, 1)
        Torque that the joint gives to what it touches: the reference's or, with `payload`, a variable.
    """

    equations: MechanismEquations
    wanted_rad: Array
    motor_rad: ca.MX
    angle_rad: ca.MX
    speed_rad_per_s: ca.MX
    contact_N_m: ca.MX


def formulate_joint(
    problem: JointProblem,
    wanted_rad: Array,
    guess_rad: Array,
    contact_N_m: Array,
    step_s: float,
    collocation: Collocation,
    *,
    payload: bool = False,
) -> JointFormulation:
    """Pose the problem of a joint that shall follow a reference.

    Parameters
    ----------
    problem : JointProblem
    wanted_rad : ndarray, shape (n,)
        Reference of the joint.
    guess_rad : ndarray, shape (n, motors)
        Motor angles since the start to begin with, such as the exact inverse.
    contact_N_m : ndarray, shape (n,)
        What the joint gives to what it touches.
    step_s : float
        Between rows [s].
    collocation : Collocation
    payload : bool, optional
        The contact torque is a variable, but for its first row, and the user's equations decide it.
    """
    if problem.loop and len(problem.chains) != 2:
        raise ParameterError(f"a loop has two tendons, got {len(problem.chains)}")
    rows = step_s * np.arange(len(wanted_rad))
    intervals = max(round(float(rows[-1]) / collocation.interval_s), 1)
    time_s, step = np.linspace(0.0, rows[-1], intervals + 1), float(rows[-1]) / intervals
    wanted, given = np.interp(time_s, rows, wanted_rad), np.interp(time_s, rows, contact_N_m)
    guess = np.column_stack([np.interp(time_s, rows, column) for column in guess_rad.T])
    cut = cut_joint(problem)
    page, motors = equations_of(cut), guess.shape[1]
    joint = problem.mechanism.joint.name

    # variables: the motors' angles, and the torque of a payload
    opti = ca.Opti()
    motor = opti.variable(motors, intervals + 1)
    opti.set_initial(motor, guess.T)
    contact = ca.MX(ca.DM(given))
    if payload:
        contact = opti.variable(intervals + 1)
        opti.set_initial(contact, given)

    # dynamics: joint and tendons, whose near ends the motors lead
    places = led_places(problem, cut, 0.0, step, guess)
    led = {body.name: ca.MX(ca.DM(column[None])) for body, column in zip(cut.led, places.T, strict=True)}
    led |= dict(zip([body.name for body in cut.led][:motors], ca.vertsplit(motor), strict=True))
    start = page_state(problem, start_memory(problem, float(given[0]), hanging=True))
    trajectory = collocate(
        opti,
        page,
        step,
        start,
        History(inputs=-contact.T, places=ca.vertcat(*(led[body.name] for body in cut.led))),
        (-given[:, None], places),
        degree=collocation.degree,
        smoothing=collocation.smoothing,
    )
    states = trajectory.states
    angle, speed = (states[row, :].T for row in page.rows(f"{joint}_rad", f"{joint}_rad_per_s"))

    # objective: squared error, and motors that move no more than they must
    steps = ca.diff(motor, 1, 1)
    cost = ca.sumsqr(angle - ca.DM(wanted)) / (intervals + 1) + _STEADY * ca.sumsqr(steps) / intervals

    # path: limits of the motors
    drive = problem.mechanism.drive
    if drive.speed_max_rad_per_s is not None:
        most = drive.speed_max_rad_per_s * step
        opti.subject_to(opti.bounded(-most, ca.vec(steps), most))
    if drive.torque_max_N_m is not None:
        bodies = [body.name for body in cut.bodies]
        on_drum = trajectory.along(page.effort[[bodies.index(body.name) for body in cut.led[:motors]]])
        torque = drive.inertia_kg_m2 * ca.diff(steps, 1, 1) / step**2 - on_drum[:, 1:-1]
        most = drive.torque_max_N_m - drive.coulomb_N_m
        opti.subject_to(opti.bounded(-most, ca.vec(torque), most))

    # boundary: the motors stand where they are, and so does the mechanism
    opti.subject_to(motor[:, 0] == ca.DM(guess[0]))
    if payload:
        opti.subject_to(contact[0] == given[0])

    opti.minimize(cost / max(float(np.ptp(wanted)) ** 2 * 1e-4, 1e-12))
    opti.solver("ipopt", *ipopt_options())
    return JointFormulation(
        opti=opti,
        equations=page,
        time_s=time_s,
        wanted_rad=wanted,
        motor_rad=motor,
        angle_rad=angle,
        speed_rad_per_s=speed,
        contact_N_m=contact,
        tension_N=trajectory.along(page.tension_N),
        states=states,
        cost=cost,
        plants=(trajectory,),
    )
