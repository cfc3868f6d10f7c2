"""Lengths, wrap angles and moment arms of a mechanism's tendons by the coordinates of its bodies."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.mechanism.parts import Tendon
from tendonff.models.turns import in_turn


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Paths of tendons from their drums to their far ends.

    Attributes
    ----------
    tendons : tuple of Tendon
    bodies : tuple of str
        Bodies whose coordinates are given, in the order of the columns; all others stand at zero.
    """

    tendons: tuple[Tendon, ...]
    bodies: tuple[str, ...]

    def length_m(self, angles: Array) -> Array:
        """Length between drum and far end [m]: (rows, bodies) -> (rows, tendons).

        Up to an offset of each tendon, which is none where the far end is fixed and every section has a length.
        """
        return self._evaluated(angles)[:, :, 0]

    def wrap_angle_rad(self, angles: Array) -> Array:
        """Sum of the wrap angles of its sections [rad]: (rows, bodies) -> (rows, tendons)."""
        return self._evaluated(angles)[:, :, 1]

    def moment_arm_m(self, angles: Array) -> Array:
        """Moment arms -d(length)/dq [m]: (rows, bodies) -> (rows, tendons, bodies)."""
        return self._evaluated(angles)[:, :, 2:]

    @in_turn
    def _evaluated(self, angles: Array) -> Array:
        given = np.asarray(angles, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] != len(self.bodies):
            raise ParameterError(f"angles must have a column for each of {', '.join(self.bodies)}, got {given.shape}")
        found = np.array(self._ends.map(len(given))(given.T)).reshape(len(self.tendons), -1, len(given), order="F")
        rows = np.ascontiguousarray(found.transpose(2, 0, 1))
        places = dict(zip(self.bodies, given.T, strict=True))
        for t, tendon in enumerate(self.tendons):
            for section in tendon.path.parts:
                rows[:, t, 0] += (section.length_m or 0.0) + section.gained_at(places)
                rows[:, t, 1] += section.angle_at(places)
                for name, slope in section.gained_slopes_at(places).items():
                    if name in self.bodies:
                        rows[:, t, 2 + self.bodies.index(name)] -= slope
        return rows

    @cached_property
    def _ends(self) -> ca.Function:
        """Shares of the far ends: length, no wrap angle, moment arms."""
        q = ca.SX.sym("q", len(self.bodies))
        places = dict(zip(self.bodies, ca.vertsplit(q), strict=True))
        rows = []
        for tendon in self.tendons:
            for name in tendon.far.bodies:
                places.setdefault(name, ca.SX(0))
            length = -tendon.far.travel_m(places)
            rows.append(ca.horzcat(length, 0, -ca.jacobian(length, q)))
        return ca.Function("ends", [q], [ca.densify(ca.vertcat(*rows))])


class Routed(ABC):
    """Joints that tendons cross: lengths, wrap angles and moment arms by the angles of the joints."""

    __slots__ = ()

    @abstractmethod
    def geometry(self) -> Geometry:
        """The paths of the tendons."""

    def length_m(self, angles: Array) -> Array:
        """Length of each tendon between drum and far end, as `Geometry` [m]: (rows, joints) -> (rows, tendons)."""
        return self.geometry().length_m(angles)

    def wrap_angle_rad(self, angles: Array) -> Array:
        """Sum of the wrap angles of each tendon [rad]: (rows, joints) -> (rows, tendons)."""
        return self.geometry().wrap_angle_rad(angles)

    def moment_arm_m(self, angles: Array) -> Array:
        """Moment arms under a uniform tension [m]: (rows, joints) -> (rows, tendons, joints)."""
        return self.geometry().moment_arm_m(angles)


@in_turn
def moment_arms(tendons: Sequence[Tendon], bodies: Sequence[str], at: Array) -> Array:
    """Moment arms at one place, shape (tendons, bodies) [m]."""
    found: Array = Geometry(tendons=tuple(tendons), bodies=tuple(bodies)).moment_arm_m(np.atleast_2d(at))[0]
    return found
