"""Sections of a route as tables over the joints that each follows, on grids that are refined until they fit.

An interval between two sites becomes, from the motor on: a bend at the first site, a span, a bend on the geom, a
span, a bend at the last site. A wrap grows at its edge, where the bone moves that changes it: what a joint between the
first site and the geom changes is length of the span before the geom, all else of the span behind it. So each joint
acts with the tension next to it, and the tendon does not creep along a wrap that grows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.mjcf.measure import Measured, measure
from tendonff.compensator.mjcf.model import Hand, Joint, Route, sweep_poses
from tendonff.compensator.scenario.driven.paths import Measures
from tendonff.models.path_table import MOST_AXES, PathTable

_FIRST_NODES = {1: 33, 2: 17, 3: 9}  # on each axis; those that err most are halved
_MOST_NODES = {1: 1100, 2: 40_000, 3: 80_000}  # of a table
_FITS_M, _FITS_RAD, _RMS_RAD = 1e-6, 1e-3, 2e-4  # aims of a table at poses between its nodes
_SLOPE_M = 3e-5  # and of the moment arms of a length
_NUDGE = 1e-5
_AT_SITE, _AT_GEOM, _BESIDE_GEOM = 0.2, 0.4, 0.1  # shares of an interval's least length that parts of it have
_NO_BEND_RAD = 1e-3  # a bend that is never larger rubs no section
_STILL = 1e-9
_JUMP_M = 1e-4  # change of a moment arm that is none of a smooth path
_PROBES = 64
_TESTS = 1024  # so many that some lie where a wrap begins
_BASES, _ALONG = 4, 65

_Where = tuple[str, int, float, float | PathTable]
"""Quantity, interval, a constant and a table that are taken off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A section of a route.

    Attributes
    ----------
    name : str
    guide : str
        Site or geom on which it bends; empty for a span.
    measures : Measures
    """

    name: str
    guide: str
    measures: Measures


def tabulate(hand: Hand, route: Route) -> tuple[Part, ...]:
    """Sections of a spatial tendon from the motor on.

    Raises
    ------
    InputError
        If a wrap flips its side within the range, or a bend follows more than three joints.
    """
    _check_flips(hand, route)
    fit, count = _Fit(hand, route), len(route.intervals)
    taken: set[str] = set()
    parts: list[Part] = []
    for k, interval in enumerate(route.intervals):
        shortest = fit.shortest_m[k]
        ends = sum(_AT_SITE * shortest for end in (0, count - 1) if k != end)
        if interval.geom < 0 or not fit.bends("turn_rad", k):
            length = fit.table("length_m", k, interval.joints, ends)
            parts.append(Part(name=f"span_{k + 1}", guide="", measures=Measures(angle_rad=0.0, length_m=length)))
        else:
            parts += _past_geom(hand, fit, k, ends, taken)
        if k < count - 1:
            site = hand.name_of("site", interval.last)
            joints = tuple(dict.fromkeys((*interval.joints, *route.intervals[k + 1].joints)))
            angle = fit.table("bend_rad", k, joints, 0.0) if fit.bends("bend_rad", k) else 0.0
            own = _AT_SITE * (shortest + fit.shortest_m[k + 1])
            parts.append(
                Part(name=_unique(f"at_{site}", taken), guide=site, measures=Measures(angle_rad=angle, length_m=own))
            )
    return tuple(parts)


def _past_geom(hand: Hand, fit: "_Fit", k: int, ends_m: float, taken: set[str]) -> list[Part]:
    """Spans before and behind a geom, and the bend on it."""
    interval = fit.route.intervals[k]
    own, beside = _AT_GEOM * fit.shortest_m[k], _BESIDE_GEOM * fit.shortest_m[k]
    before: float | PathTable
    after: float | PathTable
    if interval.before and interval.after:  # what joints before the geom change is length before it
        before = fit.table("length_m", k, interval.before, fit.split_m(k, ends_m + own))
        after = fit.table("length_m", k, interval.joints, ends_m + own, besides=before)
    else:
        moved = fit.table("length_m", k, interval.joints, ends_m + own + beside)
        before, after = (moved, beside) if interval.before else (beside, moved)
    guide = hand.name_of("geom", interval.geom)
    angle = fit.table("turn_rad", k, interval.joints, 0.0)
    return [
        Part(name=f"span_{k + 1}_before", guide="", measures=Measures(angle_rad=0.0, length_m=before)),
        Part(name=_unique(f"on_{guide}", taken), guide=guide, measures=Measures(angle_rad=angle, length_m=own)),
        Part(name=f"span_{k + 1}", guide="", measures=Measures(angle_rad=0.0, length_m=after)),
    ]


def _unique(name: str, taken: set[str]) -> str:
    found, k = name, 2
    while found in taken:
        found, k = f"{name}_{k}", k + 1
    taken.add(found)
    return found


class _Fit:
    """Tables of one tendon; poses that several tables need are measured once."""

    def __init__(self, hand: Hand, route: Route) -> None:
        self.hand, self.route = hand, route
        self._middle = np.array([0.5 * (joint.low_rad + joint.high_rad) for joint in hand.joints])
        self._known: dict[tuple[object, ...], tuple[FloatArray, Measured]] = {}
        self._probe = self._measured("probe", sweep_poses(hand, 4 * _PROBES, seed=1))[1]
        self.shortest_m = self._probe.length_m.min(axis=0).tolist()

    def bends(self, quantity: str, k: int) -> bool:
        """Whether a bend is ever worth a mass."""
        return bool(getattr(self._probe, quantity)[:, k].max() > _NO_BEND_RAD)

    def split_m(self, k: int, rest_m: float) -> float:
        """Length that the span before a geom lacks of the interval, so that both spans keep some of it anywhere."""
        poses = sweep_poses(self.hand, 4 * _PROBES, seed=1)
        before = self.route.intervals[k].before
        half = np.where([name in before for name in self.hand.names], poses, self._middle)
        with_before = self._measured(f"half {k}", half)[1].length_m[:, k]
        still = float(self._measured("middle", self._middle[None, :])[1].length_m[0, k])
        least_before = float(with_before.min()) - still
        least_after = float((self._probe.length_m[:, k] - with_before).min())
        return still + least_before - 0.5 * (still + least_before + least_after - rest_m)

    def table(
        self, quantity: str, k: int, joints: Sequence[str], less: float, besides: float | PathTable = 0.0
    ) -> float | PathTable:
        """A table over those joints that change a quantity, less a constant and what another has; a number for none."""
        where = (quantity, k, less, besides)
        axes = [joint for joint in self.hand.joints if joint.name in joints and self._matters(joint, where)]
        if not axes:
            return float(self._values(where, self._measured("middle", self._middle[None, :]))[0])
        if len(axes) > MOST_AXES:
            raise InputError(
                f'{self.hand.path.name}: a bend or a length of tendon "{self.route.name}" follows {len(axes)} joints '
                f"({', '.join(axis.name for axis in axes)}), more than {MOST_AXES}; add a site on the bones between, "
                "or name fewer joints by --joint"
            )
        return self._refined(where, axes)

    def _refined(self, where: _Where, axes: Sequence[Joint]) -> PathTable:
        """The table on a grid whose axes are halved, those that err most first, until it fits."""
        names = tuple(axis.name for axis in axes)
        places = [self.hand.names.index(name) for name in names]
        tests = np.tile(self._middle, (_TESTS, 1))
        tests[:, places] = sweep_poses(self.hand, _TESTS, seed=2)[:, places]
        wanted = self._values(where, self._measured((names, "tests"), tests))
        slopes = []
        for place in places:
            nudged = self._measured((names, place), tests + _NUDGE * (np.arange(len(self._middle)) == place))
            slopes.append((self._values(where, nudged) - wanted) / _NUDGE)
        at = dict(zip(self.hand.names, tests.T, strict=True))
        touching = slice(None) if where[0] != "turn_rad" else wanted > 0
        nodes = [_FIRST_NODES[len(axes)]] * len(axes)
        while True:
            table = self._table(where, axes, nodes)
            found = table.slopes_at(at)
            steep = [
                float(np.abs(found[name] - slope)[touching].max(initial=0.0))
                for name, slope in zip(names, slopes, strict=True)
            ]
            if where[0] == "length_m":
                fits = np.abs(table.at(at) - wanted).max() < _FITS_M and max(steep) < _SLOPE_M
            else:
                off = np.abs(np.maximum(table.at(at), 0.0) - np.maximum(wanted, 0.0))
                fits = off.max() < _FITS_RAD and np.sqrt(np.mean(off**2)) < _RMS_RAD
            costs = np.array(steep) * table.step_rad
            finer = [2 * n - 1 if cost >= 0.5 * costs.max() else n for n, cost in zip(nodes, costs, strict=True)]
            if fits:
                return table
            if math.prod(finer) > _MOST_NODES[len(axes)]:
                if where[0] == "length_m" and max(steep) > 10 * _JUMP_M:
                    worst = int(np.argmax(steep))
                    off = np.abs(found[names[worst]] - slopes[worst])
                    raise self._jump(axes[worst], float(off.max()), tests[int(off.argmax())])
                return table
            nodes = finer

    def _jump(self, axis: Joint, off_m: float, pose: FloatArray) -> InputError:
        """Error of a path that jumps where several joints meet, so that no table fits it."""
        at = float(pose[self.hand.names.index(axis.name)])
        return InputError(
            f'{self.hand.path.name}: a wrap of tendon "{self.route.name}" flips its side near "{axis.name}" = {at:.3g} '
            f"rad, in some poses of the other joints: no smooth table is nearer to its moment arm than "
            f"{1e3 * off_m:.2g} mm; give the geom a sidesite in the model (in front of the middle of the wrap), or "
            f"keep out of there: {_beside(self.hand, axis, at)}"
        )

    def _table(self, where: _Where, axes: Sequence[Joint], nodes: Sequence[int]) -> PathTable:
        names = tuple(axis.name for axis in axes)
        grids = [np.linspace(axis.low_rad, axis.high_rad, n) for axis, n in zip(axes, nodes, strict=True)]
        poses = np.tile(self._middle, (math.prod(nodes), 1))
        places = [self.hand.names.index(name) for name in names]
        poses[:, places] = np.column_stack([each.ravel() for each in np.meshgrid(*grids, indexing="ij")])
        values = self._values(where, self._measured((names, "grid", *nodes), poses))
        return PathTable.through(names, grids, values.reshape(tuple(nodes)))

    def _measured(self, key: object, poses: FloatArray) -> tuple[FloatArray, Measured]:
        if (key,) not in self._known:
            self._known[key,] = poses, measure(self.hand, poses, [self.route], arms=False)[0]
        return self._known[key,]

    def _values(self, where: _Where, known: tuple[FloatArray, Measured]) -> FloatArray:
        quantity, k, less, besides = where
        poses, measured = known
        at = dict(zip(self.hand.names, poses.T, strict=True))
        taken = besides.at(at) if isinstance(besides, PathTable) else besides
        found: FloatArray = getattr(measured, quantity)[:, k] - less - taken
        return found

    def _matters(self, axis: Joint, where: _Where) -> bool:
        """Whether a joint changes a value anywhere along its range, from a few poses."""
        bases = sweep_poses(self.hand, _BASES, seed=3)
        poses = np.repeat(bases, _ALONG, axis=0)
        along = np.linspace(axis.low_rad, axis.high_rad, _ALONG)
        poses[:, self.hand.names.index(axis.name)] = np.tile(along, _BASES)
        values = self._values(where, self._measured(("along", axis.name), poses)).reshape(_BASES, _ALONG)
        return bool(np.ptp(values, axis=1).max() > _STILL)


def _check_flips(hand: Hand, route: Route) -> None:
    """Refuse a tendon one of whose wraps changes its side: there its moment arm jumps."""
    if all(interval.geom < 0 for interval in route.intervals):
        return
    base = sweep_poses(hand, 3, seed=5)
    base[0] = [0.5 * (joint.low_rad + joint.high_rad) for joint in hand.joints]
    for name in route.joints:
        place = hand.names.index(name)
        joint = hand.joints[place]
        for pose in base:
            line = np.tile(pose, (65, 1))
            line[:, place] = np.linspace(joint.low_rad, joint.high_rad, len(line))
            arms = measure(hand, line, [route])[0].arm_m
            jumps = np.abs(np.diff(arms, axis=0)).max(axis=1)
            for worst in np.argsort(jumps)[-2:]:
                if jumps[worst] < 10 * _JUMP_M:
                    continue
                low, high = line[worst], line[worst + 1]
                for _ in range(22):
                    both = np.array([low, 0.5 * (low + high), high])
                    step = np.abs(np.diff(measure(hand, both, [route])[0].arm_m, axis=0)).max(axis=1)
                    low, high = (both[0], both[1]) if step[0] > step[1] else (both[1], both[2])
                if step.max() > _JUMP_M:
                    raise InputError(
                        f'{hand.path.name}: a wrap of tendon "{route.name}" flips its side where "{name}" is at '
                        f"{low[place]:.3g} rad: its moment arm jumps by {1e3 * step.max():.3g} mm; give the geom a "
                        "sidesite in the model (in front of the middle of the wrap), or keep out of there: "
                        f"{_beside(hand, joint, float(low[place]))}"
                    )


def _beside(hand: Hand, joint: Joint, jump_rad: float) -> str:
    """Options that leave a joint the larger part of its range on one side of a jump, and all others theirs."""
    apart = 0.01 * (joint.high_rad - joint.low_rad)
    below = jump_rad - joint.low_rad > joint.high_rad - jump_rad
    low, high = (joint.low_rad, jump_rad - apart) if below else (jump_rad + apart, joint.high_rad)
    others = (f" --joint {other.option}" for other in hand.joints if other.name != joint.name)
    return f"--joint {joint.name}={low:.4g}:{high:.4g}" + "".join(others)
