"""A mechanism cut into chains, and the state at rest that every run begins with."""

import math

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.balance import JointLaw
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.path import JointMotion
from tendonff.models.turns import in_turn
from tendonff.ocp.joint.protocol import Array, JointMemory, JointProblem


@in_turn
def joint_problem(
    mechanism: Mechanism, level: Level, motion: JointMotion, *, segments: int | None = None
) -> JointProblem:
    """Cut a mechanism into chains.

    Parameters
    ----------
    mechanism : Mechanism
    level : Level
    motion : JointMotion
        Of the driven joint, from where it starts over its whole range, and of all others that sections name.
    segments : int, optional
        Number of masses of each tendon; default: each path's own.

    Raises
    ------
    ParameterError
        If a section names a joint without motion, a tendon has no moment arm at the start, or two pull the same way.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.path import JointMotion
    >>> mechanism = tf.load_scenario("examples/hand_joint.toml").mechanism
    >>> range_rad = JointMotion(names=("knuckle",), time_s=np.arange(2.0), angle_rad=np.array([[0.0], [0.4]]))
    >>> problem = tf.system_of(mechanism, tf.Level.PRESLIDING, range_rad)
    >>> len(problem.chains)
    2
    """
    joint = mechanism.joint
    if joint.name not in motion.names:
        raise ParameterError(f'the driven joint "{joint.name}" needs a motion, got those of {", ".join(motion.names)}')
    column = motion.angle_rad[:, motion.names.index(joint.name)]
    start = float(motion.at(np.zeros(1))[0, motion.names.index(joint.name)])
    arms = mechanism.arms_at(start)
    for angle in (float(column.min()), float(column.max())):
        if any(a * b <= 0 for a, b in zip(arms, mechanism.arms_at(angle), strict=True)):
            raise ParameterError(
                f"a moment arm changes its sign between {start:g} and {angle:g} rad; keep the joint where it does not"
            )
    first = mechanism.tendons[0]
    return JointProblem(
        mechanism=mechanism,
        chains=mechanism.chains(level, motion, segments),
        law=JointLaw.of(joint, first.friction, level, arms[0]),
        start_rad=start,
        scale_m=min(abs(arm) for arm in arms),
    )


def start_tensions(mechanism: Mechanism, start_rad: float, contact_N_m: float = 0.0) -> tuple[Array, float]:
    """Tensions at rest at the start, uniform along each tendon, and what is slack there as an angle of the drum [rad].

    Of a loop, tensioned to `pretension_N` where the joint carries nothing; then what the joint holds stretches one
    tendon as much as it lets go of the other. Of a pair, the looser one keeps `least_tension_N`.
    """
    drive, arms = mechanism.drive, mechanism.arms_at(start_rad)
    held = float(mechanism.joint.static_torque_N_m(np.array(start_rad))) + contact_N_m
    if len(arms) == 1:
        tension = held / arms[0]
        if not tension > 0:
            raise ParameterError(
                f"the one tendon would have to push at the start: it holds {held:g} N m with a moment arm of "
                f"{arms[0]:g} m; move rest_rad so that the spring pulls against it"
            )
        return np.array([tension]), 0.0
    if drive.kind is not DriveKind.LOOP:
        least = drive.least_tension_N or 0.0
        tight = 0 if (held > least * math.fsum(arms)) == (arms[0] > 0) else 1
        tensions = np.full(2, least)
        tensions[tight] = (held - arms[1 - tight] * least) / arms[tight]
        return tensions, 0.0
    before = drive.pretension_N or 0.0
    compliance = [
        1 / (tendon.tendon.stiffness_N_per_m * radius)
        for tendon, radius in zip(mechanism.tendons, mechanism.drum_radius_m, strict=True)
    ]
    total = before * math.fsum(compliance)
    # T1 c1 + T2 c2 = total, r1 T1 + r2 T2 = held
    tensions = np.linalg.solve(np.array([compliance, arms]), np.array([total, held]))
    if (tensions >= 0).all():
        return tensions, 0.0
    tight = int(np.argmax(tensions))
    tensions = np.zeros(2)
    tensions[tight] = held / arms[tight]
    return tensions, float(tensions[tight] * compliance[tight] - total)


def start_memory(problem: JointProblem, contact_N_m: float = 0.0, *, hanging: bool = False) -> JointMemory:
    """At rest at the start.

    With `hanging`, what is slack hangs in the loose tendon, as forward simulation wants it; else that tendon is just
    taut, and the memory says by how much.
    """
    tensions, slack_rad = start_tensions(problem.mechanism, problem.start_rad, contact_N_m)
    states = []
    for tension, chain, tendon, winding in zip(
        tensions, problem.chains, problem.mechanism.tendons, problem.windings_m, strict=True
    ):
        far = float(tendon.arm.travel_m(np.array(problem.start_rad)))
        state = chain.rest_state(float(tension), far)
        if hanging and slack_rad > 0 and tension == 0:
            state = state.hanging(slack_rad * abs(winding))
        states.append(state)
    z = np.array([0.0, problem.start_rad, 0.0])
    return JointMemory(
        x=[state.vector() for state in states],
        x_old=[state.vector() for state in states],
        z=z,
        z_old=z.copy(),
        time_s=0.0,
        fresh=True,
        start_m=np.array([state.near_position_m for state in states]),
        tension_N=tensions,
        rest_N=tensions.copy(),
        closure_rad=slack_rad,
    )
