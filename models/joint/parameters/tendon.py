"""A tendon from its drum to the joint, and the effect of the joint on its far end."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.mechanism import parts
from tendonff.models.parameters import Friction, Path, Tendon

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LengthTable:
    """Length of the path that a joint leaves to a tendon, by its angle: a cubic spline, straight beyond its ends.

    Parameters
    ----------
    angle_rad : ndarray, shape (n,)
        Increasing joint angles [rad], n >= 3.
    length_m : ndarray, shape (n,)
        Length between drum and insertion [m]; an offset that all share has no effect.
    """

    angle_rad: Array
    length_m: Array

    def __post_init__(self) -> None:
        angle, length = (np.array(each, dtype=np.float64) for each in (self.angle_rad, self.length_m))
        if angle.ndim != 1 or angle.shape != length.shape or len(angle) < 3:
            raise ParameterError(
                f"a table of lengths needs at least 3 rows of an angle and a length, got {angle.shape} and "
                f"{length.shape}; 5 to 20 rows over the range of the joint are a good start"
            )
        if not (np.isfinite(angle).all() and np.isfinite(length).all()):
            raise ParameterError("a table of lengths must hold finite numbers only; remove the rows that do not")
        late = np.flatnonzero(np.diff(angle) <= 0)
        if late.size:
            row = int(late[0]) + 1
            raise ParameterError(
                f"the angles of a table of lengths must increase, got {angle[row]:g} after {angle[row - 1]:g} rad; "
                "sort its rows"
            )
        object.__setattr__(self, "angle_rad", angle)
        object.__setattr__(self, "length_m", length)

    @property
    def travel_pieces(self) -> Array:
        """Cubics of the far end's travel -L(q), rows of c0 + c1 s + c2 s^2 + c3 s^3 with s from the knot [m]."""
        return np.ascontiguousarray(-self._spline().c[::-1].T)

    def length_at(self, angle_rad: Array) -> Array:
        """L(q) [m]."""
        angle = np.asarray(angle_rad, dtype=np.float64)
        within = np.clip(angle, self.angle_rad[0], self.angle_rad[-1])
        spline = self._spline()
        length: Array = spline(within) + spline(within, 1) * (angle - within)
        return length

    def arm_at(self, angle_rad: Array) -> Array:
        """Moment arm -dL/dq [m]."""
        within = np.clip(np.asarray(angle_rad, dtype=np.float64), self.angle_rad[0], self.angle_rad[-1])
        arm: Array = -self._spline()(within, 1)
        return arm

    def _spline(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline  # a third of a second to import, for a measured length alone

        return CubicSpline(self.angle_rad, self.length_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Effect of a joint on the far end of a tendon.

    Parameters
    ----------
    joint : str
        Name of the joint.
    moment_arm_m : float, optional
        Constant moment arm [m], positive where pulling turns the joint towards positive angles; 0 where only sections
        of the path follow the joint.
    lengths : LengthTable, optional
        Length of the path by angle, instead of a constant arm.
    """

    joint: str
    moment_arm_m: float | None = None
    lengths: LengthTable | None = None

    def __post_init__(self) -> None:
        if (self.moment_arm_m is None) == (self.lengths is None):
            raise ParameterError("a tendon needs moment_arm_m or lengths, one of them")
        if self.moment_arm_m is not None and not math.isfinite(self.moment_arm_m):
            raise ParameterError(f"moment_arm_m must be finite, got {self.moment_arm_m}")

    def travel_m(self, angle_rad: Array) -> Array:
        """Far end's position for joint angles, up to an offset [m]."""
        if self.lengths is not None:
            return -self.lengths.length_at(angle_rad)
        return np.asarray(angle_rad, dtype=np.float64) * (self.moment_arm_m or 0.0)

    def arm_at(self, angle_rad: Array) -> Array:
        """Moment arm of the far end [m]."""
        if self.lengths is not None:
            return self.lengths.arm_at(angle_rad)
        return np.full(np.shape(angle_rad), self.moment_arm_m or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTendon:
    """Tendon from its drum to the joint.

    Parameters
    ----------
    name : str
        Its name in reports.
    path : Path
        From the drum to the joint.
    tendon : Tendon
        Its mass and stiffness.
    friction : Friction
        On this path.
    arms : tuple of Arm
        One for each joint that moves its far end; none where that is fixed to a bone and sections of the path alone
        follow joints.
    """

    name: str
    path: Path
    tendon: Tendon
    friction: Friction
    arms: tuple[Arm, ...]

    def __post_init__(self) -> None:
        joints = [arm.joint for arm in self.arms]
        if len(set(joints)) != len(joints):
            raise ParameterError(f'tendon "{self.name}" has two moment arms about one joint, got {", ".join(joints)}')

    @property
    def arm(self) -> Arm:
        """Effect of the one joint that moves its far end; AttributeError where there are several or none."""
        if len(self.arms) != 1:
            raise AttributeError(f'tendon "{self.name}" has {len(self.arms)} arms')
        return self.arms[0]

    def wound_on(self, drum: parts.Arm) -> parts.Tendon:
        """The tendon of a mechanism, from a drum to the bodies that move its far end."""
        far = (
            parts.Arm(body=arm.joint, metres_per_unit=arm.moment_arm_m or 0.0)
            if arm.lengths is None
            else parts.Table(body=arm.joint, knots=arm.lengths.angle_rad, cubics=arm.lengths.travel_pieces)
            for arm in self.arms
        )
        return parts.Tendon(
            name=self.name,
            path=self.path,
            tendon=self.tendon,
            friction=self.friction,
            near=parts.Attachment(arms=(drum,)),
            far=parts.Attachment(arms=tuple(far)),
        )

    def follows(self, joint: str) -> bool:
        """Whether a section of its path bends or gets longer with a joint."""
        return any(joint in section.joints and section.moves for section in self.path.sections)

    def exponent_at(self, places: Mapping[str, Array | float]) -> float:
        """Logarithm of what pulling loses on the way, the sum of mu phi, where joints stand by name [rad]."""
        own = self.friction.mu_dynamic, self.friction.release_dynamic
        parts = self.path.parts
        return math.fsum(float(s.angle_at(places)) * s.dynamic_coefficients(*own)[0] for s in parts)

    def moment_arm_at(self, angle_rad: Array) -> Array:
        """Moment arm with a tension that is the same along the path, -d(whole length)/dq [m]."""
        gained = math.fsum(s.length_per_rad_m for s in self.path.sections if s.joint == self.arm.joint)
        return self.arm.arm_at(angle_rad) - gained

    def path_travel_m(self, angle_rad: Array, others: dict[str, Array] | None = None) -> Array:
        """Length between path and drum for joint angles, by name where sections follow others, up to an offset [m].

        Its slope over the driven joint's angle is the moment arm.
        """
        joints = {self.arm.joint: np.asarray(angle_rad, dtype=np.float64)} | (others or {})
        travel = self.arm.travel_m(joints[self.arm.joint])
        for section in self.path.sections:
            if section.joint is not None and section.joint in joints:
                travel = travel - section.length_per_rad_m * joints[section.joint]
        return travel
