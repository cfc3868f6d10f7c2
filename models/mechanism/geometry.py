"""Lengths, wrap angles and moment arms of a mechanism's tendons by the coordinates of its bodies."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.mechanism.parts import Tendon
from tendonff.models.tendon.bounds import at_least
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
        """Length between drum and far end, up to an offset of each tendon [m]: (rows, bodies) -> (rows, tendons)."""
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
        found = np.array(self._function.map(len(given))(given.T)).reshape(len(self.tendons), -1, len(given), order="F")
        return np.ascontiguousarray(found.transpose(2, 0, 1))

    @cached_property
    def _function(self) -> ca.Function:
        q = ca.SX.sym("q", len(self.bodies))
        places = dict(zip(self.bodies, ca.vertsplit(q), strict=True))
        rows = []
        for tendon in self.tendons:
            for name in tendon.far.bodies:
                places.setdefault(name, ca.SX(0))
            length = -tendon.far.travel_m(places)
            wrap = ca.SX(0)
            for section in tendon.path.parts:
                bent, gained = section.symbolic(places)
                length += gained
                wrap += at_least(bent, 0.0)
            rows.append(ca.horzcat(length, wrap, -ca.jacobian(length, q)))
        return ca.Function("geometry", [q], [ca.vertcat(*rows)])


@in_turn
def moment_arms(tendons: Sequence[Tendon], bodies: Sequence[str], at: Array) -> Array:
    """Moment arms at one place, shape (tendons, bodies) [m]."""
    found: Array = Geometry(tendons=tuple(tendons), bodies=tuple(bodies)).moment_arm_m(np.atleast_2d(at))[0]
    return found
