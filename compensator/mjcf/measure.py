"""Lengths and bends of a model's tendons where its joints stand, from MuJoCo's own points on every site and geom."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.mjcf.model import Hand, Route, mujoco_package

_TINY = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A tendon at poses.

    Attributes
    ----------
    length_m : ndarray, shape (rows, intervals)
    turn_rad : ndarray, shape (rows, intervals)
        Bend on the geom of each interval; negative: by how much the tendon would have to turn to touch it. Of a helix
        on a cylinder the integral of its curvature, which is what friction grows with. 0 without a geom.
    bend_rad : ndarray, shape (rows, intervals - 1)
        Bend at the sites between intervals.
    whole_m : ndarray, shape (rows,)
        MuJoCo's length of the tendon.
    arm_m : ndarray, shape (rows, joints)
        MuJoCo's moment arms, -d(length)/dq; zeros where they were not asked for.
    """

    length_m: FloatArray
    turn_rad: FloatArray
    bend_rad: FloatArray
    whole_m: FloatArray
    arm_m: FloatArray

    @property
    def wrap_rad(self) -> FloatArray:
        """Sum of all bends, shape (rows,)."""
        wrap: FloatArray = np.maximum(self.turn_rad, 0.0).sum(axis=1) + self.bend_rad.sum(axis=1)
        return wrap


def tendon_jacobian(model: Any, data: Any, tendon: int) -> FloatArray:
    """Length of a tendon over the degrees of freedom, shape (nv,): sparse rows in newer MuJoCo, dense in older."""
    if data.ten_J.ndim == 2 and data.ten_J.shape == (model.ntendon, model.nv):
        return np.array(data.ten_J[tendon])
    home = model if hasattr(model, "ten_J_rowadr") else data
    begin, count = int(home.ten_J_rowadr[tendon]), int(home.ten_J_rownnz[tendon])
    dense = np.zeros(model.nv)
    dense[np.ravel(home.ten_J_colind)[begin : begin + count]] = np.ravel(data.ten_J)[begin : begin + count]
    return dense


def measure(
    hand: Hand, poses: FloatArray, routes: Sequence[Route] | None = None, *, arms: bool = True
) -> list[Measured]:
    """Measure tendons at poses, shape (rows, joints) [rad]; all of the hand by default."""
    mujoco, model, routes = mujoco_package(), hand.model, hand.routes if routes is None else routes
    data = mujoco.MjData(model)
    address, dofs = [j.address for j in hand.joints], [j.dof for j in hand.joints]
    rows = len(poses)
    intervals = [interval for route in routes for interval in route.intervals]
    used = np.unique([site for each in intervals for site in (each.first, each.last)]).astype(int)
    bent = np.unique([each.geom for each in intervals if each.geom >= 0]).astype(int)
    sites, centres = np.empty((rows, len(used), 3)), np.empty((rows, len(bent), 3))
    frames = np.empty((rows, len(bent), 9))
    lengths, arm_m = np.empty((rows, len(routes))), np.zeros((rows, len(routes), len(dofs)))
    touching = [np.full((rows, len(route.intervals), 2, 3), np.nan) for route in routes]
    data.qpos[:] = model.qpos0
    place, site, centre, frame = data.qpos, data.site_xpos, data.geom_xpos, data.geom_xmat  # views, once for all poses
    length, begins, points, objects = data.ten_length, data.ten_wrapadr, data.wrap_xpos, data.wrap_obj
    points, objects = points.reshape(-1, 3), objects.reshape(-1)
    for row, pose in enumerate(poses):
        place[address] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        site.take(used, axis=0, out=sites[row])
        centre.take(bent, axis=0, out=centres[row])
        frame.take(bent, axis=0, out=frames[row])
        for k, route in enumerate(routes):
            lengths[row, k] = length[route.index]
            if arms:
                arm_m[row, k] = -tendon_jacobian(model, data, route.index)[dofs]
            _touch(route, int(begins[route.index]), points, objects, touching[k][row])
    at = {each: sites[:, k] for k, each in enumerate(used.tolist())}
    centre_of = {each: centres[:, k] for k, each in enumerate(bent.tolist())}
    frame_of = {each: frames[:, k] for k, each in enumerate(bent.tolist())}
    return [
        _measured(model, route, at, centre_of, frame_of, touching[k], lengths[:, k], arm_m[:, k])
        for k, route in enumerate(routes)
    ]


def _touch(route: Route, begin: int, points: FloatArray, objects: NDArray[np.int32], out: FloatArray) -> None:
    """First and last point on the geom of each interval that the tendon touches there."""
    at, order = begin, range(len(route.intervals))
    for k in reversed(order) if route.reverse else order:
        geom = route.intervals[k].geom
        if geom >= 0 and objects[at + 1] == geom:
            out[k] = points[at + 1 : at + 3][:: -1 if route.reverse else 1]
            at += 2
        at += 1


def _measured(
    model: Any,
    route: Route,
    sites: Mapping[int, FloatArray],
    centres: Mapping[int, FloatArray],
    frames: Mapping[int, FloatArray],
    touching: FloatArray,
    whole: FloatArray,
    arms: FloatArray,
) -> Measured:
    rows, count = len(whole), len(route.intervals)
    length, turn = np.zeros((rows, count)), np.zeros((rows, count))
    leaving, arriving = np.empty((rows, count, 3)), np.empty((rows, count, 3))
    for k, interval in enumerate(route.intervals):
        a, b = sites[interval.first], sites[interval.last]
        on = ~np.isnan(touching[:, k, 0, 0])
        p1, p2 = (np.where(on[:, None], touching[:, k, end], other) for end, other in ((0, b), (1, a)))
        leaving[:, k], arriving[:, k] = _unit(p1 - a), _unit(b - p2)
        length[:, k] = np.linalg.norm(b - a, axis=1)
        if interval.geom >= 0:
            axis = frames[interval.geom].reshape(-1, 3, 3)[:, :, 2]
            cylinder = int(model.geom_type[interval.geom]) == int(mujoco_package().mjtGeom.mjGEOM_CYLINDER)
            local = [each - centres[interval.geom] for each in (a, b, p1, p2)]
            radius = float(model.geom_size[interval.geom, 0])
            length[:, k], turn[:, k] = _past(local, axis if cylinder else None, radius, on, length[:, k])
    bend = _angle(arriving[:, :-1], leaving[:, 1:])
    return Measured(length_m=length, turn_rad=turn, bend_rad=bend, whole_m=whole, arm_m=arms)


def _past(
    local: Sequence[FloatArray], axis: FloatArray | None, radius: float, on: NDArray[np.bool_], straight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Length and bend past a sphere, or a cylinder along `axis`, about whose middle all points are given."""
    a, b, p1, p2 = local
    flat = [each if axis is None else each - np.sum(each * axis, axis=1)[:, None] * axis for each in local]
    rise = np.zeros(len(a)) if axis is None else np.sum((b - a) * axis, axis=1)
    fa, fb, f1, f2 = flat
    # off: how much is missing until it touches
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = sum(np.arccos(np.clip(radius / np.linalg.norm(each, axis=1), -1.0, 1.0)) for each in (fa, fb))
    missing = _angle(fa, fb) - reach
    # on: the arc from the first point the way the tendon comes
    coming, going = f1 - fa, fb - f2
    comes = np.linalg.norm(coming, axis=1) > _TINY
    way = np.where(comes[:, None], np.cross(f1, coming), np.cross(f2, going))
    normal = _unit(way)
    across = np.cross(normal, _unit(f1))
    arc = np.mod(np.arctan2(np.sum(f2 * across, axis=1), np.sum(f2 * _unit(f1), axis=1)), 2 * np.pi)
    arc = np.where(arc > 2 * np.pi - 1e-6, 0.0, arc)
    inside = np.linalg.norm(f2 - f1, axis=1) < _TINY * max(radius, 1.0)  # a point that it is pulled against from inside
    plane = np.where(
        on,
        np.linalg.norm(coming, axis=1) + radius * arc + np.linalg.norm(going, axis=1),
        np.linalg.norm(fb - fa, axis=1),
    )
    length = np.where(on, np.hypot(plane, rise), straight)
    cosine = plane / np.maximum(length, _TINY)
    kinked = _angle(p1 - a, b - p2)
    turn = np.where(on, np.where(inside, kinked, arc * cosine), np.minimum(missing, 0.0) * cosine)
    return length, turn


def _unit(v: FloatArray) -> FloatArray:
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    found: FloatArray = v / np.maximum(size, 1e-300)
    return found


def _angle(u: FloatArray, v: FloatArray) -> FloatArray:
    """Angle between vectors [rad], exact for small ones too."""
    u, v = _unit(u), _unit(v)
    found: FloatArray = 2 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1))
    return found
