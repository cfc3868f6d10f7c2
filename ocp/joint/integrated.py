"""A joint between tendons advanced by CasADi's integrators: any mechanism, and no compiler needed."""

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.joint.description import MOTOR, describe
from tendonff.models.mechanism.equations import equations_of
from tendonff.models.mechanism.mechanism import CutMechanism, CutTendon
from tendonff.models.mechanism.parts import Lead
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.integrate.integrator import Integrator, evaluated, gave_up
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.joint.protocol import Array, JointMemory, JointProblem, JointRows


def cut_joint(problem: JointProblem, *, led: bool = False) -> CutMechanism:
    """The mechanism of a joint with the chains of a problem; its joint free, or led."""
    chains, name = problem.chains, problem.mechanism.joint.name
    whole = describe(problem.mechanism, _motion(chains[0]))
    bodies = tuple(body.at(chains[0].level) for body in whole.bodies)
    drives = tuple(Lead(body=name) if led and drive.body == name else drive for drive in whole.drives)
    tendons = tuple(
        CutTendon(name=tendon.name, elements=chain.elements, near=tendon.near, far=tendon.far)
        for tendon, chain in zip(whole.tendons, chains, strict=True)
    )
    return CutMechanism(bodies=bodies, tendons=tendons, drives=drives)


def _motion(chain: Chain) -> JointMotion:
    if chain.motion is None:
        raise ParameterError("a chain of a joint's problem has no motion; make the problem by joint_problem")
    return chain.motion


def page_state(problem: JointProblem, memory: JointMemory, *, led: bool = False) -> Array:
    """State of `equations_of(cut_joint(problem))`, of a memory."""
    dry = memory.z[2:] if problem.mechanism.joint.coulomb_N_m > 0 else np.empty(0)
    own = np.empty(0) if led else np.concatenate([[memory.z[1], memory.z[0]], dry])
    inner = [_of_tendon(x, chain.count) for x, chain in zip(memory.x, problem.chains, strict=True)]
    return np.concatenate([own, *inner])


def led_places(
    problem: JointProblem,
    cut: CutMechanism,
    time_s: float,
    step_s: float,
    motor_rad: Array,
    angle_rad: Array | None = None,
) -> Array:
    """Where the led bodies are, a row an instant from `time_s` on: motors, other joints, the joint where it is led.

    `motor_rad`, shape (rows, motors), since the start; of a loop the first column counts.
    """
    motion = _motion(problem.chains[0])
    names = [MOTOR] if problem.loop else [tendon.name for tendon in problem.mechanism.tendons]
    times = time_s + step_s * np.arange(float(len(motor_rad)))
    known = dict(zip(motion.names, motion.at(times).T, strict=True)) | dict(zip(names, motor_rad.T, strict=False))
    if angle_rad is not None:
        known[problem.mechanism.joint.name] = np.asarray(angle_rad, dtype=np.float64)
    return np.column_stack([known[body.name] for body in cut.led])


class IntegratedJoint:
    """Advance one mechanism by an integrator; see `protocol.JointRunner`."""

    def __init__(self, problem: JointProblem, step_s: float, method: Method, accuracy: Accuracy) -> None:
        self._problem, self._step_s = problem, step_s
        self._method, self._accuracy = method, accuracy

    def run(self, memory: JointMemory, travel_m: Array, contact_N_m: Array, angle_rad: Array | None) -> JointRows:
        """See `protocol.JointRunner`."""
        problem, led = self._problem, angle_rad is not None
        cut = cut_joint(problem, led=led)
        page = equations_of(cut)
        integrator = Integrator(page, self._step_s, self._method, self._accuracy)
        motor = np.asarray(travel_m, dtype=np.float64) * problem.mechanism.drive.gear_ratio / problem.windings_m
        places = led_places(problem, cut, memory.time_s, self._step_s, motor, angle_rad)
        contact = np.zeros((len(travel_m), 0)) if led else -np.asarray(contact_N_m, dtype=np.float64)[:, None]
        start = page_state(problem, memory, led=led)
        own = len(start) - sum(chain.layout.size - 4 for chain in problem.chains)
        states = integrator.advance(start, contact, places)
        done = len(states)
        rates = np.diff(places, axis=0)[:done] / self._step_s
        at = [page.state, page.place, page.place_rate]
        outputs = ca.Function("outputs", at, [page.tension_N, page.effort[0]])
        tensions, torque = evaluated(outputs, states, places[1 : done + 1], rates)
        links = np.cumsum([0, *(chain.count + 1 for chain in problem.chains)])
        tension, drum = (tensions[:, [k + edge for k in ends]] for ends, edge in ((links[1:], -1), (links[:-1], 0)))
        angle = states[:, 0] if angle_rad is None else np.asarray(angle_rad, dtype=np.float64)[1 : done + 1]
        if done:
            speed = float(states[-1, 1]) if not led else float(rates[-1, 0])
            joint = (speed, float(angle[-1]), *states[-1, 2:own].tolist())
            # the compiled step goes on from there as from rest, by implicit Euler
            memory.z = np.array([*joint, 0.0][:3])
            memory.x = chain_states(problem, states[-1, own:], joint[1], joint[0], memory.start_m + travel_m[done])
            memory.x_old, memory.z_old, memory.fresh = [x.copy() for x in memory.x], memory.z.copy(), True
            memory.time_s, memory.tension_N = memory.time_s + done * self._step_s, tension[-1].copy()
        return JointRows(
            angle_rad=angle.copy(),
            torque_N_m=torque.ravel(),
            lowest_N=tensions.min(axis=1) if done else np.empty(0),
            tension_N=tension,
            drum_N=drum,
            iterations=done,
            splits=0,
            residual_N=np.nan,
            reason=None if done == len(travel_m) - 1 else gave_up(self._method),
        )


def chain_states(
    problem: JointProblem, inner: Array, angle_rad: float, speed_rad_per_s: float, near_m: Array
) -> list[Array]:
    """State of each chain, of the page's states behind the joint's own, the joint's motion and the near ends' places.

    The speed of a near end is that of the mass beside it.
    """
    found, first = [], 0
    for k, (chain, tendon) in enumerate(zip(problem.chains, problem.mechanism.tendons, strict=True)):
        n, size = chain.count, chain.layout.size - 4
        own, first = inner[first : first + size], first + size
        far, arm = (float(each(np.array(angle_rad))) for each in (tendon.arm.travel_m, tendon.arm.arm_at))
        found.append(np.concatenate([[own[0]], own[:n], [arm * speed_rad_per_s], own[n:], [near_m[k], far]]))
    return found


def _of_tendon(x: Array, count: int) -> Array:
    """A tendon's own states: those of a chain without its ends."""
    return np.concatenate([x[1 : count + 1], x[count + 2 : -2]])
