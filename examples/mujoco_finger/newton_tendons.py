"""Newton's tendons on the bones of any imported model: a plant that shares nothing with the chain of tendonff.

    with NewtonTendons(hand, data, scenario, start_rad, tension_N, motor_rad) as tendons:
        mujoco.mj_step(hand.model, data)

Newton 1.8 or newer (`pip install newton`) has massless tendons with capstan friction. A site becomes a pinhole, a geom
a roller, what is straight between them a spring of its share of EA/L. Each pulls the bones at its ends.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import mujoco
import newton
import numpy as np
import warp as wp
from numpy.typing import NDArray

from examples.mujoco_finger.callback import PassiveForces
from tendonff.compensator.mjcf.measure import measure
from tendonff.compensator.mjcf.model import Hand, Interval, Route
from tendonff.compensator.scenario.driven.finger import FingerScenario

Array = NDArray[np.float64]

SETTLE_TOL = 1e-6
"""Of the tension, at which Newton stops relaxing a tendon in a step; its default is 1e-3."""

_TOUCHING_M, _ASIDE_M = 1e-5, 1e-3


class NewtonTendons(PassiveForces):
    """Tendons of Newton between bones of MuJoCo and motors led by a command, in MuJoCo's callback for passive forces.

    Parameters
    ----------
    hand : Hand
        `read_hand` of the model that the scenario was imported from; its own actuators must do nothing.
    data : mujoco.MjData
        Put where the scenario's reference starts.
    scenario : FingerScenario
        From `tf.import_mjcf`: coefficients of the sections, EA/L, drums. Relaxation, viscous friction, adhesion,
        bristles and the channel before the first site have no counterpart here.
    start_rad : dict of str to float
        Angle of each joint at the start [rad].
    tension_N : dict of str to float
        Of each tendon at the start [N].
    motor_rad : callable
        Angles of the motors since the start, shape (motors,) [rad], at a time [s].

    Raises
    ------
    ValueError
        If a geom is neither cylinder nor sphere, is not touched at the start, or is crossed in a helix: Newton's
        rollers are flat.

    Notes
    -----
    MuJoCo takes the tensions of the last step. Spans that friction holds are stiff on light bones: where joints shiver,
    friction is shaken off, and the timestep is too long (examples/tendon_finger.xml wants 0.1 ms).
    """

    def __init__(
        self,
        hand: Hand,
        data: Any,
        scenario: FingerScenario,
        start_rad: dict[str, float],
        tension_N: dict[str, float],
        motor_rad: Callable[[float], Array],
    ) -> None:
        wp.config.quiet = True
        self._hand, self._model, self.motor_rad = hand, hand.model, motor_rad
        self._scenario, self._step = scenario, float(hand.model.opt.timestep)
        self.address = [joint.address for joint in hand.joints]
        data.time, data.qvel[:], data.qpos[self.address] = 0.0, 0.0, [start_rad[name] for name in hand.names]
        mujoco.mj_forward(hand.model, data)
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, 0.0))
        self._bodies = [self._led(builder, data.xpos[b], data.xquat[b]) for b in range(hand.model.nbody)]
        self._near: list[tuple[int, Array, Array, int, float, int]] = []
        """Of each tendon: body at the motor, its start, the way it is pulled, motor, travel per radian, first piece."""
        self._ends: list[tuple[int, int]] = []
        """Bodies of MuJoCo at both ends of each straight piece; -1: the motor."""
        self._softness: list[tuple[float, float]] = []
        """Of each straight piece: 1/EA [1/N], and what it has of the arcs beside it [m]."""
        for route in hand.routes:
            self._route(builder, data, route, tension_N[route.name])
        with wp.ScopedDevice("cpu"):
            self._newton = builder.finalize()
            self._solver = newton.solvers.SolverXPBD(self._newton, iterations=1, tendon_settle_tol=SETTLE_TOL)
            self._states = [self._newton.state(), self._newton.state()]
            self._control = self._newton.control()
        self._compliance = self._newton.tendon_segment_compliance.numpy().astype(float)
        self._per_m, self._arc_m = np.array(self._softness).T
        self._row, self.torque_N_m = -1, np.zeros(hand.model.nv)
        self.tension_N: Array = np.empty(len(self._ends))
        """Of each straight piece, tendon by tendon from the motor on [N]."""
        self.follow(data)

    @staticmethod
    def _led(builder: Any, place: Array, quaternion: Array) -> int:
        return int(builder.add_body(xform=_pose(place, quaternion), mass=0.0, is_kinematic=True))

    def _route(self, builder: Any, data: Any, route: Route, tension_N: float) -> None:
        """Add a tendon that carries a tension where the data stand."""
        model, finger = self._model, self._scenario.mechanism
        tendon = next(each for each in finger.tendons if each.name == route.name)
        own = {section.name: section.mu_dynamic for section in tendon.path.sections}

        def mu(section: str) -> float:
            found = own.get(section)
            return float(tendon.friction.mu_dynamic if found is None else found)

        first, second = (data.site_xpos[k] for k in (route.intervals[0].first, route.intervals[0].last))
        near = self._led(builder, first, np.array([1.0, 0.0, 0.0, 0.0]))
        motor, winding = next(
            (k, each)
            for k, own_motor in enumerate(finger.motors)
            for name, each in zip(own_motor.winds, own_motor.winding_m, strict=True)
            if name == route.name
        )
        self._near.append((near, first.copy(), _unit(first - second), motor, winding, len(self._ends)))
        kinds, at, length = newton.TendonGuideType, [-1], []
        guides: list[dict[str, Any]] = [{"body": near, "guide_type": kinds.ANCHOR}]
        [measured] = measure(self._hand, np.array([data.qpos[self.address]]), [route], arms=False)
        for interval, whole_m in zip(route.intervals, measured.length_m[0], strict=True):
            last, body = interval is route.intervals[-1], int(model.site_bodyid[interval.last])
            if interval.geom < 0:
                length.append((whole_m, whole_m))
            else:
                roller, pieces = self._roller(data, interval, float(whole_m))
                name = f"on_{self._hand.name_of('geom', interval.geom)}"
                guides.append(roller | {"mu": mu(name), "dynamic": True})
                at.append(int(model.geom_bodyid[interval.geom]))
                length += [(piece, piece + (whole_m - sum(pieces)) / 2) for piece in pieces]
            guides.append(
                {
                    "body": self._bodies[body],
                    "offset": tuple(map(float, model.site_pos[interval.last])),
                    "guide_type": kinds.ANCHOR if last else kinds.PINHOLE,
                    "mu": 0.0 if last else mu(f"at_{self._hand.name_of('site', interval.last)}"),
                }
            )
            at.append(body)
        unstretched = finger.length_m(np.zeros((1, len(finger.names))))[0, finger.tendons.index(tendon)]
        per_m = 1 / (tendon.tendon.stiffness_N_per_m * unstretched)
        for guide, (straight_m, own_m) in zip(guides[1:], length, strict=True):
            soft = own_m * per_m
            guide |= {"compliance": float(soft), "rest_length": float(straight_m - tension_N * soft)}
            self._softness.append((per_m, own_m - straight_m))
        builder.add_tendon([newton.TendonGuide(**guide) for guide in guides])
        self._ends += pairwise(at)

    def _roller(self, data: Any, interval: Interval, whole_m: float) -> tuple[dict[str, Any], tuple[float, float]]:
        """A geom as a roller on the side where MuJoCo's tendon passes it, and the straight pieces at both its sides."""
        model, geom = self._model, interval.geom
        body, name = int(model.geom_bodyid[geom]), self._hand.name_of("geom", geom)
        a, b = data.site_xpos[interval.first], data.site_xpos[interval.last]
        centre, radius = data.geom_xpos[geom], float(model.geom_size[geom, 0])
        kind = int(model.geom_type[geom])
        if kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
            axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
        elif kind == int(mujoco.mjtGeom.mjGEOM_SPHERE):
            axis = _unit(np.cross(a - centre, b - centre))
        else:
            raise ValueError(f'geom "{name}" is no cylinder and no sphere, on which Newton\'s tendons could roll')
        off = {}
        for side in (1, -1):
            p, q = _tangent(a, centre, radius, axis, side), _tangent(b, centre, radius, axis, -side)
            arc = radius * float(np.arccos(np.clip(_unit(p - centre) @ _unit(q - centre), -1.0, 1.0)))
            pieces = float(np.linalg.norm(a - p)), float(np.linalg.norm(b - q))
            off[side] = abs(sum(pieces) + arc - whole_m), pieces
        side = min(off, key=lambda each: off[each][0])
        aside = max(abs(float((point - centre) @ axis)) for point in (a, b))
        if off[side][0] > _TOUCHING_M or aside > _ASIDE_M:
            raise ValueError(
                f'geom "{name}": the length of the tendon differs from MuJoCo\'s by {off[side][0]:.2g} m, and it runs '
                f"{aside:.2g} m beside the middle; start where it touches, and in a plane"
            )
        frame = data.xmat[body].reshape(3, 3)
        return {
            "body": self._bodies[body],
            "guide_type": newton.TendonGuideType.ROLLER,
            "radius": radius,
            "orientation": side,
            "offset": tuple(map(float, frame.T @ (centre - data.xpos[body]))),
            "axis": tuple(map(float, frame.T @ axis)),
        }, off[side][1]

    def follow(self, data: Any) -> None:
        """Step the tendons to the time of the data, where the bones then stand."""
        row = round(data.time / self._step)
        if row <= self._row:
            return
        self._row, model = row, self._model
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        now, after = self._states
        turned = self.motor_rad(data.time)
        with wp.ScopedDevice("cpu"):
            poses = now.body_q.numpy()
            poses[self._bodies, :3], poses[self._bodies, 3:] = data.xpos, data.xquat[:, [1, 2, 3, 0]]
            for body, start, way, motor, winding, _ in self._near:
                poses[body, :3] = start + way * winding * turned[motor]
            now.body_q.assign(poses)
            now.clear_forces()
            self._solver.step(now, after, self._control, None, self._step)
        self._states = [after, now]
        left, right = (
            getattr(self._solver, f"tendon_segment_attachment_{side}").numpy().astype(float) for side in "lr"
        )
        rest = self._solver.tendon_segment_rest_length.numpy().astype(float)
        active = self._solver.tendon_segment_active.numpy().astype(bool)
        way = right - left
        length = np.linalg.norm(way, axis=1)
        own_m = length + self._arc_m
        for _, _, _, motor, winding, piece in self._near:
            own_m[piece] -= winding * turned[motor]  # on the drum
        self._compliance = own_m * self._per_m
        self._newton.tendon_segment_compliance.assign(self._compliance.astype(np.float32))
        self.tension_N = np.where(active, np.maximum(length - rest, 0.0) / self._compliance, 0.0)
        force = way * (self.tension_N / np.maximum(length, 1e-12))[:, None]
        found, none = np.zeros(model.nv), np.zeros(3)
        for (one, other), pull, p, q in zip(self._ends, force, left, right, strict=True):
            if one > 0:
                mujoco.mj_applyFT(model, data, pull, none, p, one, found)
            if other > 0:
                mujoco.mj_applyFT(model, data, -pull, none, q, other, found)
        self.torque_N_m = found

    def add(self, model: Any, data: Any) -> None:  # noqa: ARG002 - MuJoCo's signature
        """Add the joints' torques to MuJoCo's passive forces."""
        data.qfrc_passive[:] += self.torque_N_m


def _unit(v: Array) -> Array:
    found: Array = v / np.linalg.norm(v)
    return found


def _tangent(point: Array, centre: Array, radius: float, axis: Array, side: int) -> Array:
    """Where a straight line from a point touches a circle, on the side that Newton calls so."""
    to = (centre - point) - ((centre - point) @ axis) * axis
    far = float(np.linalg.norm(to))
    if far <= radius:
        return centre - radius * to / far
    turn = -side * (np.pi / 2 + np.arcsin(radius / far))
    found: Array = centre + radius * (np.cos(turn) * to / far + np.sin(turn) * np.cross(axis, to / far))
    return found


def _pose(place: Array, quaternion: Array) -> Any:
    w, x, y, z = map(float, quaternion)
    return wp.transform(p=wp.vec3(*map(float, place)), q=wp.quat(x, y, z, w))
