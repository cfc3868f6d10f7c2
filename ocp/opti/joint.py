"""The optimal motion of the motors of driven joints as `casadi.Opti`, for users to extend: a payload, a bound, a cost.

Variables are the angles of the motors at the ends of the intervals, linear between them, and the states of joints and
tendons: position drives lead the near ends. What the joints touch are torques that the user's equations may decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.layout import Array
from tendonff.models.mechanism.equations import MechanismEquations, equations_of
from tendonff.models.mechanism.mechanism import CutMechanism
from tendonff.models.path import JointMotion
from tendonff.ocp.joint.integrated import cut_joint, led_places, page_state
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.start import start_memory
from tendonff.ocp.mechanism.integrated import cut_problem
from tendonff.ocp.mechanism.integrated import page_state as mechanism_state
from tendonff.ocp.mechanism.problem import MechanismProblem, rest
from tendonff.ocp.opti.choices import Collocation
from tendonff.ocp.opti.collocation import History, collocate
from tendonff.ocp.opti.tendon import Formulation, ipopt_options

_STEADY = 1e-4
"""Cost of the squared steps of the motors beside the squared error: not all of them follow from the joints."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFormulation(Formulation):
    """Motor angles whose joint angles are wanted.

    Attributes
    ----------
    equations : MechanismEquations
        Of joints and tendons.
    wanted_rad : ndarray, shape (n, wanted)
        Reference of the joints that have one, which come first.
    motor_rad : ca.MX, shape (motors, n)
        Since the start.
    angle_rad, speed_rad_per_s : ca.MX, shape (n, joints)
        Of the joints.
    contact_N_m : ca.MX, shape (n, joints)
        Torques that the joints give to what they touch: the reference's or, with `payload`, variables.
    """

    equations: MechanismEquations
    wanted_rad: Array
    motor_rad: ca.MX
    angle_rad: ca.MX
    speed_rad_per_s: ca.MX
    contact_N_m: ca.MX


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pursuit:
    """Reference of driven joints and the guess of their motors, rows `step_s` apart.

    Attributes
    ----------
    wanted_rad : ndarray, shape (n, wanted)
    motor_rad : ndarray, shape (n, motors)
        Since the start, to begin with, such as the exact inverse.
    contact_N_m : ndarray, shape (n, joints)
        What the joints give to what they touch.
    step_s : float
    """

    wanted_rad: Array
    motor_rad: Array
    contact_N_m: Array
    step_s: float

    def at(self, collocation: Collocation) -> tuple["Pursuit", Array]:
        """The same at the ends of the intervals, and their instants."""
        rows = self.step_s * np.arange(len(self.wanted_rad))
        intervals = max(round(float(rows[-1]) / collocation.interval_s), 1)
        time_s = np.linspace(0.0, rows[-1], intervals + 1)
        columns = [
            np.column_stack([np.interp(time_s, rows, column) for column in each.T])
            for each in (self.wanted_rad, self.motor_rad, self.contact_N_m)
        ]
        step = float(rows[-1]) / intervals
        return Pursuit(wanted_rad=columns[0], motor_rad=columns[1], contact_N_m=columns[2], step_s=step), time_s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Driven:
    """A mechanism as the problem sees it."""

    cut: CutMechanism
    start: Array  # of the page's states
    places: Array  # shape (n, led), of the guess
    joints: Sequence[str]
    motors: Sequence[str]
    drives: Sequence[JointDrive]


def formulate_joint(
    problem: JointProblem, pursuit: Pursuit, collocation: Collocation, *, payload: bool = False
) -> JointFormulation:
    """Pose the problem of a joint that shall follow a reference.

    Parameters
    ----------
    problem : JointProblem
    pursuit : Pursuit
    collocation : Collocation
    payload : bool, optional
        The contact torque is a variable, but for its first row, and the user's equations decide it.
    """
    if problem.loop and len(problem.chains) != 2:
        raise ParameterError(f"a loop has two tendons, got {len(problem.chains)}")
    coarse, time_s = pursuit.at(collocation)
    cut, motors = cut_joint(problem), coarse.motor_rad.shape[1]
    driven = _Driven(
        cut=cut,
        start=page_state(problem, start_memory(problem, float(coarse.contact_N_m[0, 0]), hanging=True)),
        places=led_places(problem, cut, 0.0, coarse.step_s, coarse.motor_rad),
        joints=[problem.mechanism.joint.name],
        motors=[body.name for body in cut.led[:motors]],
        drives=[problem.mechanism.drive] * motors,
    )
    return _formulate(driven, coarse, time_s, collocation, payload=payload)


def formulate_mechanism(
    problem: MechanismProblem,
    drives: Sequence[JointDrive],
    motion: JointMotion,
    pursuit: Pursuit,
    collocation: Collocation,
    *,
    payload: bool = False,
) -> JointFormulation:
    """Pose the problem of several joints that shall follow a reference.

    Parameters
    ----------
    problem : MechanismProblem
    drives : sequence of JointDrive
        Of each motor.
    motion : JointMotion
        Of the joints that no tendon drives, by name.
    pursuit : Pursuit
    collocation : Collocation
    payload : bool, optional
        The contact torques are variables, but for their first row, and the user's equations decide them.
    """
    coarse, time_s = pursuit.at(collocation)
    led = np.arange(problem.bodies) >= problem.driven
    cut, motors = cut_problem(problem, led), problem.names[problem.known :]
    known = dict(zip(motion.names, motion.at(time_s).T, strict=True)) | dict(
        zip(motors, coarse.motor_rad.T, strict=True)
    )
    driven = _Driven(
        cut=cut,
        start=mechanism_state(cut, rest(problem), led),
        places=np.column_stack([known[body.name] for body in cut.led]),
        joints=problem.names[: problem.driven],
        motors=motors,
        drives=drives,
    )
    return _formulate(driven, coarse, time_s, collocation, payload=payload)


def _formulate(
    driven: _Driven, given: Pursuit, time_s: Array, collocation: Collocation, *, payload: bool
) -> JointFormulation:
    page, n, step = equations_of(driven.cut), len(time_s), given.step_s
    guess, wanted = given.motor_rad, given.wanted_rad

    # variables: the motors' angles, and the torques of a payload
    opti = ca.Opti()
    motor = opti.variable(guess.shape[1], n)
    opti.set_initial(motor, guess.T)
    contact = ca.MX(ca.DM(given.contact_N_m))
    if payload:
        contact = opti.variable(*given.contact_N_m.shape)
        opti.set_initial(contact, given.contact_N_m)

    # dynamics: joints and tendons, whose near ends the motors lead
    names = [body.name for body in driven.cut.led]
    led = {name: ca.MX(ca.DM(column[None])) for name, column in zip(names, driven.places.T, strict=True)}
    led |= dict(zip(driven.motors, ca.vertsplit(motor), strict=True))
    trajectory = collocate(
        opti,
        page,
        step,
        driven.start,
        History(inputs=-contact.T, places=ca.vertcat(*(led[name] for name in names))),
        (-given.contact_N_m, driven.places),
        degree=collocation.degree,
        smoothing=collocation.smoothing,
    )
    states = trajectory.states
    angle, speed = (
        states[page.rows(*(f"{joint}_{unit}" for joint in driven.joints)), :].T for unit in ("rad", "rad_per_s")
    )

    # objective: squared error, and motors that move no more than they must
    steps, follow = ca.diff(motor, 1, 1), wanted.shape[1]
    off = angle[:, :follow] - ca.DM(wanted)
    cost = ca.sumsqr(off) / (n * follow) + _STEADY * ca.sumsqr(steps) / (n - 1)

    # path: limits of the motors
    bodies = [body.name for body in driven.cut.bodies]
    on_drum = trajectory.along(page.effort[[bodies.index(name) for name in driven.motors]])
    held, inertia = -on_drum[:, 1:-1], ca.DM([drive.inertia_kg_m2 for drive in driven.drives])
    torque = ca.mtimes(ca.diag(inertia), ca.diff(steps, 1, 1)) / step**2 + held
    lost = ca.mtimes(ca.diag(ca.DM([1 - drive.gear_efficiency for drive in driven.drives])), held)
    most_rad = [drive.speed_max_rad_per_s and drive.speed_max_rad_per_s * step for drive in driven.drives]
    most_N_m = [drive.torque_max_N_m and drive.torque_max_N_m - drive.coulomb_N_m for drive in driven.drives]
    # |torque| + |lost| without their corners: the gear's loss both ways
    bounded = [(steps, most_rad), (torque + lost, most_N_m)]
    if any(drive.gear_efficiency < 1 for drive in driven.drives):
        bounded.append((torque - lost, most_N_m))
    for given_rows, limits in bounded:
        rows = [k for k, most in enumerate(limits) if most is not None]
        if rows:
            bound = ca.vec(ca.repmat(ca.DM([limits[k] for k in rows]), 1, given_rows.size2()))
            opti.subject_to(opti.bounded(-bound, ca.vec(given_rows[rows, :]), bound))

    # boundary: the motors stand where they are, and so does the mechanism
    opti.subject_to(motor[:, 0] == ca.DM(guess[0]))
    if payload:
        opti.subject_to(ca.DM(given.contact_N_m[0]) == contact[0, :].T)

    opti.minimize(cost / max(float(np.ptp(wanted, axis=0).max()) ** 2 * 1e-4, 1e-12))
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
