"""The path in sections, joints that move it, and its cutting into pieces: who gets how many masses, and which lengths.

A section is cut into equal pieces with a mass in the middle of each; a link joins two neighbouring middles, the first
and the last link are the half pieces at the ends::

    actuator |--o----o----o--|-------|---o-------o---| load        o mass in the middle of its piece
              link 1  2    3       4         5     6               sections: arc, straight, arc

Wrap angles and lengths of the sections are affine in the angle of a joint, or tables over several (`TabulatedSection`);
those of pieces and links are shares of them.
"""

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.path_table import PathTable

FURTHEST_RAD = 7.0
"""No joint turns further, by a good turn."""

MOST_TURNS = 100.0

ANGLE_FLOOR_RAD = 1e-12
"""Below this wrap angle the contact counts as lost."""


COEFFICIENTS = ("mu_dynamic", "mu_static", "mu_dynamic_release", "mu_static_release")
"""Keys of friction that a section may have of its own."""


class SectionKind(StrEnum):
    """Kind of contact of a section."""

    ARC = "arc"  # a curved guide on which the tendon slides; a straight is an arc of angle zero
    PULLEY = "pulley"  # a wheel on a bearing that turns with the tendon


def above_static(dynamic: float, static: float, end: str = "") -> str:
    """Message on a dynamic coefficient above the static one; `end` is that of their names.

    Parameters
    ----------
    dynamic, static : float
        Coefficients of friction [-].
    """
    return (
        f"mu_dynamic{end} = {dynamic:g} is above mu_static{end} = {static:g}: change both, or delete mu_static{end} "
        "for no Stribeck effect"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A stretch of the path, from the actuator to the load.

    Parameters
    ----------
    name : str
        Its name in reports and dotted keys.
    angle_rad : float
        Wrap angle at joint angle zero [rad], >= 0.
    length_m : float, optional
        Length at joint angle zero [m], >= 0; default: in proportion to the angles.
    kind : SectionKind, optional
        What the tendon touches: a guide on which it slides, or a pulley.
    bearing_exponent : float, optional
        For a pulley: ln(T_in/T_out) at which its bearing turns at joint angle zero [-], instead of coefficients.
    mu_dynamic, mu_static, mu_dynamic_release, mu_static_release : float, optional
        Coefficient of friction of this section instead of that of the whole [-].
    joint : str, optional
        The joint that moves this section.
    angle_per_rad : float, optional
        Change of the wrap angle per radian of the joint [rad/rad].
    length_per_rad_m : float, optional
        Change of the length per radian of the joint [m/rad].
    """

    name: str
    angle_rad: float
    length_m: float | None = None
    kind: SectionKind = SectionKind.ARC
    bearing_exponent: float | None = None
    mu_dynamic: float | None = None
    mu_static: float | None = None
    mu_dynamic_release: float | None = None
    mu_static_release: float | None = None
    joint: str | None = None
    angle_per_rad: float = 0.0
    length_per_rad_m: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", SectionKind(self.kind))
        for name in ("angle_rad", "length_m", "bearing_exponent", *COEFFICIENTS):
            value = getattr(self, name)
            if value is not None and not 0 <= value < math.inf:
                raise ParameterError(f'section "{self.name}": {name} must be a finite number >= 0, got {value}')
        for name in ("angle_per_rad", "length_per_rad_m"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ParameterError(f'section "{self.name}": {name} must be finite, got {value}')
            if value != 0 and self.joint is None:
                raise ParameterError(
                    f'section "{self.name}": {name} = {value:g} needs a joint; name it with joint = "..."'
                )
        if (self.kind is SectionKind.PULLEY) != (self.bearing_exponent is not None):
            raise ParameterError(f'section "{self.name}": bearing_exponent belongs to kind = "pulley", and to it alone')
        if self.kind is SectionKind.PULLEY and self.angle_rad == 0:
            raise ParameterError(f'section "{self.name}": a pulley needs angle_rad > 0, got 0')
        own = [f"{name} = {value:g}" for name in COEFFICIENTS if (value := getattr(self, name)) is not None]
        if self.kind is SectionKind.PULLEY and own:
            raise ParameterError(
                f'section "{self.name}": bearing_exponent = {self.bearing_exponent:g} and {own[0]} are two sources of '
                "one friction; leave one of them out"
            )
        self.check_coefficients(None, None)

    def check_coefficients(self, pull: float | None, release: float | None) -> None:
        """Refuse static coefficients below the dynamic ones.

        Parameters
        ----------
        pull, release : float or None
            Dynamic coefficients of the whole path [-], which hold where the section has none; None: not known.
        """
        usual = self.dynamic_coefficients(pull, release)
        for end, static, dynamic in zip(("", "_release"), (self.mu_static, self.mu_static_release), usual, strict=True):
            if static is not None and dynamic is not None and static < dynamic:
                raise ParameterError(f'section "{self.name}": {above_static(dynamic, static, end)}')

    def dynamic_coefficients(self, pull: Any, release: Any) -> tuple[Any, Any]:
        """Dynamic coefficients when pulling and when releasing [-], numbers or symbols: its own, else those given."""
        own_pull, own_release = self.own_dynamic()
        return pull if own_pull is None else own_pull, release if own_release is None else own_release

    def own_dynamic(self) -> tuple[float | None, float | None]:
        """Dynamic coefficients when pulling and when releasing [-]; None where those of the whole hold.

        A bearing carries 2 T sin(phi/2), so the exponent of a pulley goes with its wrap angle to first order, and
        nothing is left of it where the tendon lifts off: the bearing is a coefficient, alike in both directions.
        """
        if self.bearing_exponent is not None:
            bearing = self.bearing_exponent / self.angle_rad
            return bearing, bearing
        return self.mu_dynamic, self.mu_dynamic if self.mu_dynamic_release is None else self.mu_dynamic_release

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it follows."""
        return () if self.joint is None else (self.joint,)

    @property
    def moves(self) -> bool:
        """Whether a joint bends it or changes its length."""
        return bool(self.angle_per_rad or self.length_per_rad_m)

    def angle_at(self, places: Mapping[str, Any]) -> Array:
        """Wrap angle phi(q) for angles by joint [rad], not below 0; a joint that is not named stands at zero."""
        bent: Array = np.maximum(self.angle_rad + self.angle_per_rad * _place(self.joint, places), 0.0)
        return bent

    def gained_at(self, places: Mapping[str, Any]) -> Array:
        """Gain of its length since joint angle zero, for angles by joint [m]."""
        gained: Array = self.length_per_rad_m * _place(self.joint, places)
        return gained

    def gained_slopes_at(self, places: Mapping[str, Any]) -> dict[str, Array]:
        """Slope of its length over each joint that it follows, for angles by joint [m/rad]."""
        return {joint: np.full(_place(joint, places).shape, self.length_per_rad_m) for joint in self.joints}

    def symbolic(self, places: Mapping[str, Any]) -> tuple[Any, Any]:
        """Wrap angle before it is cut off at zero, and gained length, as CasADi scalars or numbers."""
        at = places.get(self.joint or "", 0.0)
        return self.angle_rad + self.angle_per_rad * at, self.length_per_rad_m * at

    def largest_angle_rad(self, motion: "JointMotion | None") -> float:
        """Largest wrap angle over a motion [rad]."""
        if motion is None or not self.joints:
            return self.angle_rad
        return float(self.angle_at(motion.by_joint).max())


def _place(joint: str | None, places: Mapping[str, Any]) -> Array:
    return np.asarray(places.get(joint or "", 0.0), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class TabulatedSection(Section):
    """A section whose wrap angle and length are functions of one to three joints.

    Parameters
    ----------
    angle : PathTable, optional
        Wrap angle [rad]; below zero where the tendon is off, cut off there. Default: constant.
    length : PathTable, optional
        Length [m]. Default: constant.

    Notes
    -----
    `tabulated` sets `angle_rad`, over which the bristles are spread, to the largest angle of the table, for at joint
    angle zero there may be none; `length_m` is the length there, or as near to it as the table's range allows.
    """

    angle: PathTable | None = None
    length: PathTable | None = None

    @classmethod
    def tabulated(cls, section: Section, angle: PathTable | None, length: PathTable | None) -> "TabulatedSection":
        """A section that follows no joint, with tables instead of its constants."""
        if section.joint is not None:
            raise ParameterError(f'section "{section.name}" has a table, so it names no joint; leave joint out')
        given = {field.name: getattr(section, field.name) for field in fields(Section)}
        if angle is not None:
            given["angle_rad"] = max(angle.peak, 0.0)
        if length is not None:
            given["length_m"] = length.home
        return cls(**given, angle=angle, length=length)

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it follows."""
        return tuple(dict.fromkeys(joint for table in self.tables for joint in table.joints))

    @property
    def tables(self) -> tuple[PathTable, ...]:
        """Those that it has."""
        return tuple(table for table in (self.angle, self.length) if table is not None)

    @property
    def moves(self) -> bool:
        """Whether a joint bends it or changes its length."""
        return bool(self.tables)

    def angle_at(self, places: Mapping[str, Any]) -> Array:
        """Wrap angle for angles by joint [rad], not below 0."""
        if self.angle is None:
            return np.array(self.angle_rad)
        bent: Array = np.maximum(self.angle.at(places), 0.0)
        return bent

    def gained_at(self, places: Mapping[str, Any]) -> Array:
        """Gain of its length since joint angle zero [m]."""
        if self.length is None:
            return np.array(0.0)
        return self.length.at(places) - (self.length_m or 0.0)

    def gained_slopes_at(self, places: Mapping[str, Any]) -> dict[str, Array]:
        """Slope of its length over each joint that it follows [m/rad]."""
        slopes = {} if self.length is None else self.length.slopes_at(places)
        return {joint: slopes.get(joint, np.zeros(_place(joint, places).shape)) for joint in self.joints}

    def symbolic(self, places: Mapping[str, Any]) -> tuple[Any, Any]:
        """Wrap angle before it is cut off at zero, and gained length, as CasADi scalars or numbers."""
        angle = self.angle_rad if self.angle is None else self.angle.symbolic(places)
        gained = 0.0 if self.length is None else self.length.symbolic(places) - (self.length_m or 0.0)
        return angle, gained

    def largest_angle_rad(self, motion: "JointMotion | None") -> float:
        """Largest wrap angle over the ranges of a motion [rad]: every combination of joints within them."""
        if motion is None or self.angle is None:
            return self.angle_rad
        low, high = (
            dict(zip(motion.names, each.tolist(), strict=True))
            for each in (motion.angle_rad.min(axis=0), motion.angle_rad.max(axis=0))
        )
        return max(self.angle.largest(low, high), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointMotion:
    """Joint angles over time, linear between instants and held beyond them, or repeated.

    Attributes
    ----------
    names : tuple of str
        Names of the joints, in the order of the columns.
    time_s : numpy.ndarray
        Shape (rows,); strictly increasing.
    angle_rad : numpy.ndarray
        Shape (rows, joints).
    period_s : float or None
        They repeat after so long; default: they are held.
    range_rad : tuple
        By joint the angles that are accepted live, (low, high) [rad], or None for what the path admits; default: all.
    """

    names: tuple[str, ...]
    time_s: Array
    angle_rad: Array
    period_s: float | None = None
    range_rad: tuple[tuple[float, ...] | None, ...] = ()

    def at(self, time_s: Array) -> Array:
        """Joint angles at instants, shape (len(time_s), joints) [rad]."""
        time = time_s if self.period_s is None else np.mod(time_s, self.period_s)
        return np.column_stack([np.interp(time, self.time_s, column) for column in self.angle_rad.T])

    def held(self, angle_rad: Array) -> "JointMotion":
        """Joints at constant angles, shape (joints,)."""
        angles = np.asarray(angle_rad, float)[None, :]
        return JointMotion(names=self.names, time_s=np.zeros(1), angle_rad=angles, range_rad=self.range_rad)

    def beside(self, standing_rad: Mapping[str, float]) -> "JointMotion":
        """The same with further joints at rest at angles by name [rad]."""
        own, further = self.angle_rad, np.array([*standing_rad.values()], dtype=np.float64)
        angle = np.hstack([own, np.broadcast_to(further, (len(own), len(further)))])
        names = (*self.names, *standing_rad)
        return JointMotion(names=names, time_s=self.time_s, angle_rad=angle, period_s=self.period_s)

    @property
    def by_joint(self) -> dict[str, Array]:
        """Angles by the names of the joints."""
        return dict(zip(self.names, self.angle_rad.T, strict=True))

    @property
    def moves(self) -> bool:
        """Whether any joint ever moves."""
        return bool(np.ptp(self.angle_rad, axis=0).any())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathRows:
    """The path at successive instants."""

    angle_rad: Array  # shape (rows, N); phi_i: wrap angle of each mass's piece
    ratio: Array  # shape (rows, N + 1); length of the whole tendon at joint angle zero over that of each link [-]
    # shape (rows, N + 1); what the path gained between the two ends of each link since joint angle zero [m]
    gained_m: Array
    # shape (rows,); what a joint does to the far end's position since joint angle zero [m]; 0 where it hangs on its
    # spring
    far_m: Array

    def table(self) -> Array:
        """All of it in one array, a row an instant."""
        return np.column_stack([self.angle_rad, self.ratio, self.gained_m, self.far_m])


@dataclass(frozen=True, kw_only=True, eq=False)
class CutPath:
    """A path cut into N pieces and N + 1 links.

    Attributes
    ----------
    sections : tuple of Section
        Sections from the actuator to the output.
    lengths : numpy.ndarray
        Shape (sections,); of the sections at joint angle zero, as shares of the whole [-].
    length_m : float or None
        Of the whole; None where no length is given: then only angles and gained lengths move.
    section_of : NDArray[np.int_]
        Shape (N,); section of each mass.
    parts : numpy.ndarray
        Shape (N + 1, sections); share of each section's length that belongs to each link.
    """

    sections: tuple[Section, ...]
    lengths: Array
    length_m: float | None
    section_of: NDArray[np.int_]
    parts: Array

    @property
    def count(self) -> int:
        """N."""
        return len(self.section_of)

    @cached_property
    def pieces(self) -> Array:
        """Number of pieces of each mass's section, shape (N,)."""
        return np.bincount(self.section_of, minlength=len(self.sections))[self.section_of].astype(float)

    @property
    def length_share(self) -> Array:
        """Length of each mass's piece as a share of all of them, shape (N,) [-]."""
        length = self.lengths[self.section_of] / self.pieces
        total = float(length.sum())
        return length / total if total > 0 else np.full(self.count, 1 / self.count)

    @property
    def total_angle_rad(self) -> float:
        """Theta at joint angle zero [rad]."""
        return math.fsum(section.angle_rad for section in self.sections)

    @property
    def still(self) -> bool:
        """Whether no section follows a joint."""
        return not any(section.moves for section in self.sections)

    @cached_property
    def at_zero(self) -> PathRows:
        """The path with all joint angles zero, in one row."""
        return self.at({})

    @cached_property
    def run_end(self) -> NDArray[np.intc]:
        """For each mass, the first one of the next section, shape (N,)."""
        return np.searchsorted(self.section_of, self.section_of, side="right").astype(np.intc)

    def at(self, joints: dict[str, Array], far_m: Array | None = None) -> PathRows:
        """The path for joint angles by name, each of shape (rows,) [rad]; without any, one row with all of them zero.

        `far_m`, shape (rows,), is what a joint does to the far end's position.
        """
        rows = len(next(iter(joints.values()))) if joints else 1
        angle, gained = (
            np.column_stack([np.broadcast_to(each, rows) for each in columns])
            for columns in (
                [section.angle_at(joints) for section in self.sections],
                [section.gained_at(joints) for section in self.sections],
            )
        )
        lengths = self.lengths if self.length_m is None else self.lengths + gained / self.length_m
        of_links = np.broadcast_to(lengths, gained.shape) @ self.parts.T
        return PathRows(
            angle_rad=angle[:, self.section_of] / self.pieces,
            ratio=1 / of_links,
            gained_m=gained @ self.parts.T,
            far_m=np.zeros(rows) if far_m is None else far_m,
        )


def check_motion(sections: tuple[Section, ...], length_m: float | None, motion: JointMotion) -> None:
    """Refuse a motion under which the path has no meaning; the length of the whole is known where lengths are given."""
    for section in sections:
        for joint in section.joints:
            if joint not in motion.names:
                given = ", ".join(motion.names) or "none"
                raise ParameterError(
                    f'section "{section.name}" names the joint "{joint}", which is not given (given: {given}); '
                    f"add a table [joints.{joint}]"
                )
        if not section.joints:
            continue
        name = ", ".join(f'"{joint}"' for joint in section.joints)
        most = section.largest_angle_rad(motion)
        if most > 2 * math.pi * MOST_TURNS:
            raise ParameterError(
                f'section "{section.name}": the wrap angle would reach {most:g} rad, more than {MOST_TURNS:g} turns; '
                f"check angle_per_rad and the motion of {name}, which is in radians"
            )
        least = (section.length_m or 0.0) + float(np.min(section.gained_at(motion.by_joint)))
        if section.length_m is not None and length_m is not None and least < 0:
            raise ParameterError(
                f'section "{section.name}": its length would become {least:g} m; check length_m, length_per_rad_m and '
                f"the motion of {name}"
            )


@functools.lru_cache(maxsize=64)
def cut_path(
    sections: tuple[Section, ...], count: int, radius_m: float | None = None, motion: JointMotion | None = None
) -> CutPath:
    """Cut a path into pieces: masses by the largest wrap angle over the motion, at least one where it ever touches.

    The radius gives lengths to sections that have none. ParameterError if there are fewer masses than sections that
    touch.
    """
    known = [_length_of(section, radius_m) for section in sections]
    if any(length is None for length in known):
        if any(length is not None for length in known if length != 0) and radius_m is None:
            missing = sections[known.index(None)].name
            raise ParameterError(f'section "{missing}": length_m is missing; give it for every section or for none')
        lengths, total = np.array([section.angle_rad for section in sections]), None
    else:
        lengths = np.array(known, dtype=float)
        total = float(lengths.sum()) or None
    if motion is not None:
        check_motion(sections, total, motion)
    if not lengths.sum() > 0:
        lengths = np.ones(len(sections))
    most = np.array([section.largest_angle_rad(motion) for section in sections])
    if not most.any():  # nothing touches: the masses go by length
        most = lengths
    counts = _apportion(most, count, sections)
    section_of = np.repeat(np.arange(len(sections)), counts)
    parts = np.zeros((count + 1, len(sections)))
    for mass, k in enumerate(section_of):  # either link beside a mass has half of its piece
        parts[mass : mass + 2, k] += 0.5 / counts[k]
    for k in np.flatnonzero(counts == 0):
        parts[counts[:k].sum(), k] = 1.0
    if not (parts @ lengths > 0).all():
        raise ParameterError(
            "a link between two masses would have no length; give every section that touches a length_m"
        )
    return CutPath(
        sections=sections, lengths=lengths / lengths.sum(), length_m=total, section_of=section_of, parts=parts
    )


def _length_of(section: Section, radius_m: float | None) -> float | None:
    if section.length_m is not None:
        return section.length_m
    return None if radius_m is None else section.angle_rad * radius_m


def _apportion(weights: Array, count: int, sections: tuple[Section, ...]) -> NDArray[np.int_]:
    """Whole numbers in proportion to weights, at least one where there is any."""
    touching = np.flatnonzero(weights > 0)
    if count < len(touching):
        names = ", ".join(sections[k].name for k in touching)
        raise ParameterError(
            f"segments must be >= {len(touching)}, got {count}: each section that the tendon touches needs a mass "
            f"({names})"
        )
    counts = np.zeros(len(weights), dtype=int)
    counts[touching] = 1
    for _ in range(count - len(touching)):  # to whom the next mass brings most
        counts[int(np.argmax(np.where(counts > 0, weights / np.maximum(counts, 1), -1.0)))] += 1
    return counts
