"""Tendons of a MuJoCo model: sites and geoms from the motor on, joints that move them, refusals by name."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
from tendonff.compensator.files.text import require_file

_ASSUMED_RANGE = (-np.pi / 2, np.pi / 2)
"""Range of a joint that the model does not limit [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A hinge that tendons cross.

    Attributes
    ----------
    name : str
        Letters, digits and underscores.
    index, address, dof : int
        In the model: joint, place in qpos, degree of freedom.
    low_rad, high_rad : float
        Its range.
    limited : bool
        The model states that range.
    option : str
        How it is asked for: its name, with the range that the user gave it.
    """

    name: str
    index: int
    address: int
    dof: int
    low_rad: float
    high_rad: float
    limited: bool
    option: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Tendon between two neighbouring sites, past a geom where it is given.

    Attributes
    ----------
    first, last : int
        Sites, from the motor on.
    geom : int
        -1: none.
    before, after : tuple of str
        Joints between the first site and the geom, and between it and the last site; without a geom all are `after`.
    """

    first: int
    last: int
    geom: int
    before: tuple[str, ...]
    after: tuple[str, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it follows."""
        return tuple(dict.fromkeys((*self.before, *self.after)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A tendon from its motor to its far end.

    Attributes
    ----------
    name : str
        Letters, digits and underscores.
    index : int
        In the model.
    reverse : bool
        The model lists it from its far end on.
    intervals : tuple of Interval
        Empty for a fixed tendon.
    arms_m : dict of str to float
        Of a fixed tendon: moment arms, -d(length)/dq.
    motor : str
        Name of the actuator that pulls it, or its own.
    """

    name: str
    index: int
    reverse: bool
    intervals: tuple[Interval, ...]
    arms_m: dict[str, float]
    motor: str

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it crosses."""
        found = (joint for interval in self.intervals for joint in interval.joints)
        return tuple(dict.fromkeys((*found, *self.arms_m)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Hand:
    """Tendons and joints of a model that are imported.

    Attributes
    ----------
    path : Path
    model : mujoco.MjModel
    joints : tuple of Joint
        In the order of the model; all others are held at `qpos0`.
    routes : tuple of Route
    notes : tuple of str
        What the user should know.
    """

    path: Path
    model: Any
    joints: tuple[Joint, ...]
    routes: tuple[Route, ...]
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    def name_of(self, kind: str, index: int) -> str:
        """Name of a site or a geom: letters, digits and underscores."""
        objects = {"site": mujoco_package().mjtObj.mjOBJ_SITE, "geom": mujoco_package().mjtObj.mjOBJ_GEOM}
        return _identifier(mujoco_package().mj_id2name(self.model, objects[kind], index) or f"{kind}{index}")


def mujoco_package() -> ModuleType:
    """The package, or one message on how to get it."""
    try:
        import mujoco
    except ImportError:
        raise InputError('reading MJCF needs the package mujoco: pip install "tendonff[mujoco]"') from None
    return mujoco  # type: ignore[no-any-return]


def read_hand(path: Path, tendons: Sequence[str] = (), joints: Sequence[str] = (), near: Sequence[str] = ()) -> Hand:
    """Read the tendons of a model.

    Parameters
    ----------
    path : Path
        MJCF, or a compiled model (.mjb).
    tendons, joints : sequence of str, optional
        Those to import; default: tendons that an actuator pulls, or all where none is pulled, and hinges that they
        cross. A joint may be given a range: NAME=LOW:HIGH [rad].
    near : sequence of str, optional
        Sites at which tendons come from their motors, where the model does not decide it.

    Raises
    ------
    InputError
        If the model has no such tendons, or one that has no meaning here, with the way round.
    """
    mujoco = mujoco_package()
    require_file(path)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    try:
        load = mujoco.MjModel.from_binary_path if path.suffix == ".mjb" else mujoco.MjModel.from_xml_path
        model = load(str(path))
    except (ValueError, OSError) as error:
        told = " ".join(str(error).split())
        raise InputError(f"{path.name} cannot be read as MJCF, an XML file <mujoco>...</mujoco>: {told}") from None
    return _Reader(mujoco, model, path).read(tendons, joints, near)


class _Reader:
    def __init__(self, mujoco: ModuleType, model: Any, path: Path) -> None:
        self.mujoco, self.model, self.path = mujoco, model, path
        kinds = mujoco.mjtObj
        self.tendons = self._names(kinds.mjOBJ_TENDON, model.ntendon, "tendon")
        self.joints = self._names(kinds.mjOBJ_JOINT, model.njnt, "joint")
        self.sites = self._names(kinds.mjOBJ_SITE, model.nsite, "site")
        self.notes: list[str] = []

    def read(self, tendons: Sequence[str], joints: Sequence[str], near: Sequence[str]) -> Hand:
        model, file = self.model, self.path.name
        if not model.ntendon:
            raise InputError(f"{file}: the model has no tendons; describe a finger by hand: tendonff new --for finger")
        pulled = self._actuators()
        chosen = [self._known(name, self.tendons, "tendon") for name in tendons]
        chosen = chosen or sorted(pulled) or list(range(model.ntendon))
        starts = {self._known(name, self.sites, "site") for name in near}
        crossed = dict.fromkeys(j for t in chosen for j in self._crossed(t))
        ranges = dict(self._asked(each) for each in joints)
        asked = list(ranges)
        hinge = self.mujoco.mjtJoint.mjJNT_HINGE
        for j in asked:
            if model.jnt_type[j] != hinge:
                raise InputError(f'{file}: joint "{self.joints[j]}" is no hinge; only hinges are driven: leave it out')
        held = [self.joints[j] for j in crossed if model.jnt_type[j] != hinge]
        if held:
            self.notes.append(f"held where the model starts, for they are no hinges: {', '.join(held)}")
        own = asked or sorted(j for j in crossed if model.jnt_type[j] == hinge)
        if asked and (still := [self.joints[j] for j in sorted(crossed) if j not in asked]):
            self.notes.append(f"held where the model starts: {', '.join(still)}")
        if not own:
            raise InputError(
                f"{file}: the tendons cross no hinge, so there is nothing to drive; name others by --tendon"
            )
        hinges = tuple(self._joint(j, ranges.get(j)) for j in sorted(own))
        by_index = {joint.index: joint.name for joint in hinges}
        routes = tuple(self._route(t, by_index, starts, pulled.get(t)) for t in chosen)
        for route in routes:
            if not route.joints:
                raise InputError(
                    f'{file}: tendon "{route.name}" crosses none of the joints {", ".join(by_index.values())}; leave '
                    "it out by naming the others with --tendon"
                )
        motors = [route.motor for route in routes]
        if twice := next((name for name in motors if motors.count(name) > 1), None):
            raise InputError(f'{file}: two tendons have the motor "{twice}"; rename one actuator')
        if any(kind == self.mujoco.mjtEq.mjEQ_JOINT for kind in model.eq_type):
            self.notes.append("equality constraints that couple joints are not imported")
        return Hand(path=self.path, model=model, joints=hinges, routes=routes, notes=tuple(self.notes))

    def _names(self, kind: Any, count: int, what: str) -> list[str]:
        found: list[str] = []
        for k in range(count):
            name = _identifier(self.mujoco.mj_id2name(self.model, kind, k) or f"{what}{k}")
            found.append(name if name not in found else f"{name}_{k}")
        return found

    def _known(self, name: str, names: Sequence[str], what: str) -> int:
        if _identifier(name) not in names:
            listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
            raise InputError(
                f'{self.path.name}: no {what} "{name}"{suggestion(name, list(names))}; {what}s: {listed or "none"}'
            )
        return names.index(_identifier(name))

    def _actuators(self) -> dict[int, str]:
        """Name of the first actuator of each tendon that has one."""
        model, kinds = self.model, self.mujoco.mjtTrn
        names = self._names(self.mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu, "motor")
        found: dict[int, str] = {}
        for k in range(model.nu):
            if model.actuator_trntype[k] == kinds.mjTRN_TENDON:
                found.setdefault(int(model.actuator_trnid[k, 0]), names[k])
        return found

    def _asked(self, text: str) -> tuple[int, tuple[float, float] | None]:
        """A joint that the user names, and its range where NAME=LOW:HIGH gives one [rad]."""
        name, _, given = text.partition("=")
        index = self._known(name, self.joints, "joint")
        if not given:
            return index, None
        try:
            low, high = map(float, given.split(":"))
        except ValueError:
            low = high = 0.0
        if not -7 < low < high < 7:
            raise InputError(f'joint "{name}": its range is LOW:HIGH in radians, got "{given}"; such as {name}=0:1.5')
        return index, (low, high)

    def _joint(self, index: int, given: tuple[float, float] | None) -> Joint:
        model = self.model
        limited = bool(model.jnt_limited[index])
        stated = tuple(map(float, model.jnt_range[index])) if limited else _ASSUMED_RANGE
        low, high = stated if given is None else given
        if not limited and given is None:
            self.notes.append(
                f'joint "{self.joints[index]}" has no range in the model: -90 to 90 deg assumed; '
                f"--joint {self.joints[index]}=0:1.5 gives one"
            )
        return Joint(
            name=self.joints[index],
            index=index,
            address=int(model.jnt_qposadr[index]),
            dof=int(model.jnt_dofadr[index]),
            low_rad=low,
            high_rad=high,
            limited=limited or given is not None,
            option=self.joints[index] + ("" if given is None else f"={low:.4g}:{high:.4g}"),
        )

    def _elements(self, tendon: int) -> list[tuple[int, int, float]]:
        """Kind, object and number of each element, as the model lists them."""
        model = self.model
        begin, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
        rows = range(begin, begin + count)
        return [(int(model.wrap_type[k]), int(model.wrap_objid[k]), float(model.wrap_prm[k])) for k in rows]

    def _bodies(self, elements: Iterable[tuple[int, int, float]]) -> list[int]:
        kinds, model = self.mujoco.mjtWrap, self.model
        return [
            int(model.site_bodyid[each] if kind == kinds.mjWRAP_SITE else model.geom_bodyid[each])
            for kind, each, _ in elements
        ]

    def _above(self, body: int) -> set[int]:
        """Joints between the world and a body."""
        model, found = self.model, set[int]()
        while body > 0:
            found |= set(range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]))
            body = int(model.body_parentid[body])
        return found

    def _between(self, one: int, other: int) -> set[int]:
        return self._above(one) ^ self._above(other)

    def _crossed(self, tendon: int) -> list[int]:
        elements, kinds = self._elements(tendon), self.mujoco.mjtWrap
        if elements[0][0] == kinds.mjWRAP_JOINT:
            return sorted(each for _, each, factor in elements if factor)
        self._check(tendon, elements)
        bodies = self._bodies(elements)
        return sorted(set().union(*(self._between(a, b) for a, b in pairwise(bodies))))

    def _check(self, tendon: int, elements: Sequence[tuple[int, int, float]]) -> None:
        name, file = self.tendons[tendon], self.path.name
        if any(kind == self.mujoco.mjtWrap.mjWRAP_PULLEY for kind, _, _ in elements):
            raise InputError(
                f'{file}: tendon "{name}" branches (<pulley>), so no single tension runs along it; write its branches '
                "as <spatial> tendons of their own, or import the others by --tendon"
            )
        if self.model.tendon_stiffness[tendon] > 0:
            raise InputError(
                f'{file}: tendon "{name}" is a spring (stiffness {self.model.tendon_stiffness[tendon]:g} N/m) in the '
                "model, with tension of its own; take stiffness off (elasticity goes into [tendon] of the scenario), "
                "or import the others by --tendon"
            )

    def _route(self, tendon: int, joints: dict[int, str], starts: set[int], motor: str | None) -> Route:
        elements, kinds = self._elements(tendon), self.mujoco.mjtWrap
        name = self.tendons[tendon]
        if elements[0][0] == kinds.mjWRAP_JOINT:
            arms = {joints[each]: -factor for _, each, factor in elements if each in joints and factor}
            return Route(name=name, index=tendon, reverse=False, intervals=(), arms_m=arms, motor=motor or name)
        reverse = self._reversed(name, elements, starts)
        ordered = list(reversed(elements)) if reverse else elements
        bodies = self._bodies(ordered)

        def between(one: int, other: int) -> tuple[str, ...]:
            return tuple(joints[j] for j in sorted(self._between(bodies[one], bodies[other])) if j in joints)

        intervals, at = [], 0
        while at < len(ordered) - 1:
            past = 1 if ordered[at + 1][0] == kinds.mjWRAP_SITE else 2
            geom = -1 if past == 1 else ordered[at + 1][1]
            intervals.append(
                Interval(
                    first=ordered[at][1],
                    last=ordered[at + past][1],
                    geom=geom,
                    before=() if past == 1 else between(at, at + 1),
                    after=between(at + past - 1, at + past),
                )
            )
            at += past
        return Route(
            name=name, index=tendon, reverse=reverse, intervals=tuple(intervals), arms_m={}, motor=motor or name
        )

    def _reversed(self, name: str, elements: Sequence[tuple[int, int, float]], starts: set[int]) -> bool:
        """Whether the motor is at the end that the model lists last: named, or that with fewer joints above it."""
        first, last = elements[0][1], elements[-1][1]
        if (first in starts) != (last in starts):
            return last in starts
        above = [len(self._above(body)) for body in self._bodies([elements[0], elements[-1]])]
        if above[0] == above[1]:
            raise InputError(
                f'{self.path.name}: tendon "{name}" may come from its motor at either end; name the site there: '
                f"--near {self.sites[first]} or --near {self.sites[last]}"
            )
        return above[1] < above[0]


def _identifier(name: str) -> str:
    """A name of letters, digits and underscores."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return found if found and not found[0].isdigit() else f"_{found}"


def sweep_poses(hand: Hand, count: int, seed: int = 0) -> FloatArray:
    """Poses at random within the joints' ranges, shape (count, joints) [rad]."""
    low, high = (np.array([getattr(joint, end) for joint in hand.joints]) for end in ("low_rad", "high_rad"))
    poses: FloatArray = np.random.default_rng(seed).uniform(low, high, (count, len(low)))
    return poses
