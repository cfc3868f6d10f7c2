"""The inverse of a joint without a compiler: each tendon's own recursion from the joint to its drum.

The joint's motion gives the torque of the tendons. Of a pair the looser one keeps its least tension, and the other
takes the rest; of a loop that tension of the looser one is looked for at which both reach from the joint to one drum.
Both are roots of functions that rise. Tensions go on below zero where a tendon would have to push, as in compiled code.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from tendonff.ocp.joint.compiled import joint_places, per_radian
from tendonff.ocp.joint.protocol import Array, JointInverseRows, JointMemory, JointProblem
from tendonff.ocp.step.casadi_engine import path_moves
from tendonff.ocp.step.casadi_inverse import InverseStep, inverse_step
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT

_TOLERANCE, _FINE = 1e-10, 1e-13
"""Last move of a tension, relative; finer where another search takes the answer for a function."""

_MOVES = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reached:
    """End of a step of one tendon under a tension at the joint, and its slopes over that tension."""

    state: Array
    tension_N: Array  # of every link, the drum's first
    drum_by: float
    # torque on the joint [N m], travel at the drum since the start [m]
    torque: tuple[float, float]
    travel: tuple[float, float]


class _Side:
    """Recursion of one tendon over a run of steps, with the path that the joint's motion gives it."""

    def __init__(self, problem: JointProblem, which: int, step_s: float) -> None:
        tendon, joint = problem.mechanism.tendons[which], problem.mechanism.joint.name
        chain = problem.chains[which]
        self._chain, self._arm, self._step_s, self._joint = chain, tendon.arm, step_s, joint
        self._per_rad = per_radian(chain, joint, 0.0)
        led = replace(chain, far_joint=(joint, 0.0))  # its speed is in the moves
        steps = [(step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY)]
        inverse = [inverse_step(led, *each, cut_off=False) for each in steps]
        self._rows = [
            each.function(each.end, each.tension, *ca.vertsplit(_slope(each), [0, chain.count + 1, chain.count + 2]))
            for each in inverse
        ]
        self._size = chain.layout.size

    def prepare(self, memory: JointMemory, which: int, angle_rad: Array) -> None:
        """Take over a state; the angles are those one step before it, at it, and of all steps."""
        n = self._chain.count
        self.x, self._x_old, self._start_m = memory.x[which], memory.x_old[which], float(memory.start_m[which])
        times = memory.time_s + self._step_s * np.arange(-1.0, len(angle_rad) - 1)
        rows = joint_places(self._chain, self._joint, times) + angle_rad[:, None] * self._per_rad
        rows[:, :n] = np.maximum(rows[:, :n], 0.0)
        rows[:, n : 2 * n + 1] = 1 / rows[:, n : 2 * n + 1]
        rows[:, -1] = self._arm.travel_m(angle_rad)
        self._moves = path_moves(self._chain, rows, self._step_s, fresh=memory.fresh)
        self._weights = np.tile(-self._per_rad[2 * n + 1 : -1], (len(angle_rad) - 2, 1))
        self._weights[:, -1] += self._arm.arm_at(angle_rad[2:])

    def arm_m(self, row: int) -> float:
        """Moment arm of a tension that is the same along the path."""
        return float(self._weights[row].sum())

    def reach(self, row: int, scheme: int, tension_N: float) -> _Reached:
        """The end of a step under a tension at the joint."""
        pair = np.concatenate([self.x, self._x_old])
        found = self._rows[scheme](pair, tension_N, self._moves[:, row])
        end, tension, by, travel_by = (np.asarray(each).ravel() for each in found)
        weight = self._weights[row]
        return _Reached(
            state=end,
            tension_N=tension,
            drum_by=float(by[0]),
            torque=(float(weight @ tension), float(weight @ by)),
            travel=(float(end[-2]) - self._start_m, float(travel_by[0])),
        )

    def advance(self, reached: _Reached) -> None:
        """Go on from there."""
        self.x, self._x_old = reached.state, self.x

    def give_back(self, memory: JointMemory, which: int) -> None:
        """Hand a state over."""
        memory.x[which], memory.x_old[which] = self.x.copy(), self._x_old.copy()


class JointRecursion:
    """Invert one mechanism; see `protocol.JointEngine.invert`."""

    def __init__(self, problem: JointProblem, step_s: float) -> None:
        self._problem, self._step_s = problem, step_s
        self._sides = [_Side(problem, k, step_s) for k in range(len(problem.chains))]
        q, w, acceleration, base, H = inputs = [ca.SX.sym(name) for name in ("q", "w", "acceleration", "base", "H")]
        dry = problem.law.dry_friction(w, base, H)
        self._balance = ca.Function("balance", inputs, [problem.law.torque(q, w, acceleration, dry), dry])

    def invert(
        self, memory: JointMemory, angle_rad: Array, contact_N_m: Array, least_tension_N: float
    ) -> JointInverseRows:
        """See `protocol.JointEngine`."""
        rows, sides, windings = len(angle_rad) - 1, self._sides, np.array(self._problem.windings_m)
        for k, side in enumerate(sides):
            side.prepare(memory, k, np.concatenate([memory.z_old[1:2], angle_rad]))
        travel, tension, drum = (np.empty((rows, len(sides))) for _ in range(3))
        slack, lowest, evaluations, done = np.zeros(rows), np.empty(rows), 0, 0
        last, past = memory.tension_N, memory.tension_N
        for row in range(rows):
            scheme = 0 if memory.fresh and row == 0 else 1
            joint, torque = self._moved(memory, scheme, float(angle_rad[row + 1]))
            at = _Step(sides=sides, row=row, scheme=scheme, torque_N_m=torque + float(contact_N_m[row + 1]))
            if self._problem.loop:
                found = at.of_loop(np.abs(windings).tolist(), memory.closure_rad, 2 * last - past, last)
            else:
                found = at.of_pair(least_tension_N, last)
            evaluations += at.evaluations
            if found is None:
                break
            reached, slack[row], tight = found
            for side, each in zip(sides, reached, strict=True):
                side.advance(each)
            travel[row] = [each.travel[0] for each in reached]
            if self._problem.loop:  # the drum turns as the tight tendon says; the other may hang
                travel[row] = travel[row, tight] / windings[tight] * windings
            drum[row], tension[row] = ([each.tension_N[end] for each in reached] for end in (0, -1))
            lowest[row] = min(float(each.tension_N.min()) for each in reached)
            memory.z_old, memory.z = memory.z, joint
            past, last, done = last, tension[row].copy(), row + 1
        if done:
            for k, side in enumerate(sides):
                side.give_back(memory, k)
            memory.time_s, memory.fresh, memory.tension_N = memory.time_s + done * self._step_s, False, last
        return JointInverseRows(
            travel_m=travel[:done],
            tension_N=tension[:done],
            drum_N=drum[:done],
            slack_m=slack[:done],
            lowest_N=lowest[:done],
            evaluations=evaluations,
        )

    def _moved(self, memory: JointMemory, scheme: int, angle_rad: float) -> tuple[Array, float]:
        """Find the joint's state at the end of a step, and the torque of the tendons there."""
        carry, H = ((0.0, self._step_s), (BDF2_CARRY, BDF2_WEIGHT * self._step_s))[scheme]
        speed, angle, dry = memory.z + carry * (memory.z - memory.z_old)
        w = (angle_rad - angle) / H
        torque, rubbing = self._balance(angle_rad, w, (w - speed) / H, dry, H)
        return np.array([w, angle_rad, float(rubbing)]), float(torque)


Value = tuple[float, float]
"""Value of a function, and its slope."""

_Found = tuple[list[_Reached], float, int]
"""End of a step of both tendons, the length that hangs loose, and which of them is tight."""


@dataclass(slots=True, kw_only=True)
class _Step:
    """Search of one step of the inverse."""

    sides: list[_Side]
    row: int
    scheme: int
    torque_N_m: float
    evaluations: int = 0

    def of_pair(self, least_N: float, guess_N: Array) -> _Found | None:
        """Give the looser tendon its least tension; one tendon alone carries all."""
        if len(self.sides) == 1:
            only = self._carrying(0, self.torque_N_m, float(guess_N[0]))
            return None if only is None else ([only], 0.0, 0)
        least = [self._reach(k, least_N) for k in range(2)]
        more = self.torque_N_m > least[0].torque[0] + least[1].torque[0]
        tight = 0 if more == (self.sides[0].arm_m(self.row) > 0) else 1
        loose = least[1 - tight]
        pulls = self._carrying(tight, self.torque_N_m - loose.torque[0], float(guess_N[tight]))
        return None if pulls is None else ([pulls, loose] if tight == 0 else [loose, pulls], 0.0, tight)

    def of_loop(self, radius_m: list[float], closure_rad: float, guess_N: Array, last_N: Array) -> _Found | None:
        """Find the looser tendon's tension at which both reach one drum; where there is none it hangs loose."""
        tight = 0 if (self.torque_N_m > 0) == (self.sides[0].arm_m(self.row) > 0) else 1
        pull, both = float(last_N[tight]), dict[float, list[_Reached] | None]()

        def at(loose_N: float) -> list[_Reached] | None:
            nonlocal pull
            if loose_N not in both:
                loose = self._reach(1 - tight, loose_N)
                pulls = self._carrying(tight, self.torque_N_m - loose.torque[0], pull)
                pull = pull if pulls is None else float(pulls.tension_N[-1])
                both[loose_N] = None if pulls is None else [pulls, loose] if tight == 0 else [loose, pulls]
            return both[loose_N]

        def over_rad(loose_N: float) -> Value:
            """Excess of what is wound on over the tendon that there is, as an angle of the drum."""
            if (found := at(loose_N)) is None:
                return np.nan, np.nan
            pulls, loose = found[tight], found[1 - tight]
            other = pulls.travel[1] * loose.torque[1] / pulls.torque[1]
            slope = loose.travel[1] / radius_m[1 - tight] - other / radius_m[tight]
            return closure_rad + sum(each.travel[0] / r for each, r in zip(found, radius_m, strict=True)), slope

        def held_N(loose_N: float) -> Value:
            loose = self._reach(1 - tight, loose_N)
            return float(loose.tension_N[0]), loose.drum_by

        tension = _rising_root(over_rad, max(float(guess_N[1 - tight]), 0.0), least=0.0)
        hanging = tension == 0.0
        if tension is not None and held_N(tension)[0] < 0:  # friction without load holds the joint's end alone
            tension, hanging = _rising_root(held_N, tension), True
        found = None if tension is None else at(tension)
        if tension is None or found is None:
            return None
        slack = max(over_rad(tension)[0], 0.0) * radius_m[1 - tight] if hanging else 0.0
        return found, slack, tight

    def _carrying(self, which: int, torque_N_m: float, guess_N: float) -> _Reached | None:
        """A tendon under the tension that gives the joint a torque."""
        way = 1.0 if self.sides[which].arm_m(self.row) > 0 else -1.0
        known = dict[float, _Reached]()

        def more(tension_N: float) -> Value:
            known[tension_N] = self._reach(which, tension_N)
            torque, slope = known[tension_N].torque
            return way * (torque - torque_N_m), way * slope

        tension = _rising_root(more, guess_N, tolerance=_FINE)
        return None if tension is None else known[tension]

    def _reach(self, which: int, tension_N: float) -> _Reached:
        self.evaluations += 1
        return self.sides[which].reach(self.row, self.scheme, tension_N)


def _slope(step: InverseStep) -> ca.SX:
    """Slopes of all tensions and of the near end's place over the far tension."""
    return ca.densify(ca.jacobian(ca.vertcat(step.tension, step.end[-2]), step.reference))


def _rising_root(
    function: Callable[[float], Value], guess: float, *, least: float = -np.inf, tolerance: float = _TOLERANCE
) -> float | None:
    """Zero of a function that rises: Newton's moves, a bisection where one leaves what is known or is no shorter.

    `least` where the function is above zero there; None where there is no zero, or no number.
    """
    low, high, x, before = -np.inf, np.inf, guess, np.inf
    for _ in range(_MOVES):
        value, slope = function(x)
        if not np.isfinite(value):
            return None
        move = -value / max(abs(slope), 1e-300)  # below zero tension a loop's closure may fall
        size = 1 + abs(x)
        if abs(move) <= tolerance * size or high - low <= _FINE * size or (value > 0 and x == least):
            return x
        low, high = (x, high) if value < 0 else (low, x)
        x, bounded = max(x + move, least), np.isfinite(high - low)
        if not low < x < high or (bounded and abs(move) > before / 2):
            x = (low + high) / 2
        before = abs(move) if bounded else np.inf
    return None
