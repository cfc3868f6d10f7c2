"""Wrap angles and lengths of a path as smooth functions of one to three joints: uniform cubic B-splines.

Along an axis with nodes q_0, q_0 + h, ... a spline is the sum of c_k B(u - k), u = (q - q_0)/h + 1, with the cardinal
cubic B of support (-2, 2); over several axes the sum over products. Value and slope are continuous, so torques do not
jump at nodes. Outside its range a table goes on straight; `beyond` says by how much a motion leaves it.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array

if TYPE_CHECKING:
    import casadi as ca

MOST_AXES = 3
FEWEST_NODES = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathTable:
    """A smooth function of joint angles.

    Parameters
    ----------
    joints : tuple of str
        One to three, an axis each.
    low_rad, step_rad : ndarray, shape (axes,)
        First node and distance of nodes of each axis [rad].
    coefficients : ndarray, shape (nodes + 2, ...)
        Of the B-splines, one axis for each joint [rad or m].
    """

    joints: tuple[str, ...]
    low_rad: Array
    step_rad: Array
    coefficients: Array

    @classmethod
    def through(cls, joints: Sequence[str], nodes_rad: Sequence[ArrayLike], values: ArrayLike) -> "PathTable":
        """The spline through values at nodes; its third derivative is continuous next to the ends.

        Parameters
        ----------
        joints : sequence of str
        nodes_rad : sequence of ndarray, shape (nodes,)
            Of each axis: increasing by equal steps, at least 5.
        values : ndarray, shape (nodes, ...)
            An axis for each joint [rad or m].

        Raises
        ------
        ParameterError
            If they are no such table.
        """
        axes = [np.asarray(each, dtype=np.float64) for each in nodes_rad]
        found = np.array(values, dtype=np.float64)
        name = ", ".join(joints)
        if not 1 <= len(joints) <= MOST_AXES or len(set(joints)) != len(joints) or len(axes) != len(joints):
            raise ParameterError(f"a path table needs one to {MOST_AXES} different joints, got {name or 'none'}")
        if found.shape != tuple(len(axis) for axis in axes):
            raise ParameterError(f"the path table over {name} needs a value at every node, got shape {found.shape}")
        if not np.isfinite(found).all():
            raise ParameterError(f"the path table over {name} must hold finite numbers only")
        for joint, axis in zip(joints, axes, strict=True):
            steps = np.diff(axis)
            if len(axis) < FEWEST_NODES or not steps[0] > 0 or np.ptp(steps) > 1e-6 * steps[0]:
                raise ParameterError(
                    f'the path table over {name} needs at least {FEWEST_NODES} nodes of "{joint}" that increase '
                    f"by equal steps, got {len(axis)}; write it with tendonff import"
                )
        for k in range(len(axes)):
            found = np.moveaxis(_coefficients(np.moveaxis(found, k, 0)), 0, k)
        return cls(
            joints=tuple(joints),
            low_rad=np.array([axis[0] for axis in axes]),
            step_rad=np.array([(axis[-1] - axis[0]) / (len(axis) - 1) for axis in axes]),
            coefficients=np.ascontiguousarray(found),
        )

    @property
    def nodes(self) -> tuple[int, ...]:
        """Number of nodes of each axis."""
        return tuple(size - 2 for size in self.coefficients.shape)

    @property
    def high_rad(self) -> Array:
        """Last node of each axis [rad]."""
        high: Array = self.low_rad + self.step_rad * (np.array(self.nodes) - 1)
        return high

    @property
    def home(self) -> float:
        """Value where all joints are at zero, or as near to it as its range allows."""
        near = np.clip(0.0, self.low_rad, self.high_rad)
        return float(self.at(dict(zip(self.joints, near.tolist(), strict=True))))

    @property
    def peak(self) -> float:
        """Largest value at a node."""
        low, high = (dict(zip(self.joints, each.tolist(), strict=True)) for each in (self.low_rad, self.high_rad))
        return self.largest(low, high)

    def shifted(self, by: float) -> "PathTable":
        """The same with a number added to every value."""
        return replace(self, coefficients=self.coefficients + by)

    def at(self, places: Mapping[str, Any]) -> Array:
        """Values for angles by joint, each of shape (rows,) or numbers; a joint that is not named stands at zero."""
        return self._evaluated(places)[0]

    def slopes_at(self, places: Mapping[str, Any]) -> dict[str, Array]:
        """Slopes over each of its joints, as `at`."""
        return dict(zip(self.joints, self._evaluated(places)[1:], strict=True))

    def beyond(self, places: Mapping[str, Any]) -> dict[str, float]:
        """By how much angles leave its range, for joints that do [rad]."""
        found = {}
        for joint, low, high in zip(self.joints, self.low_rad, self.high_rad, strict=True):
            q = np.asarray(places.get(joint, 0.0), dtype=np.float64)
            off = float(np.max(np.maximum(low - q, q - high)))
            if off > 1e-9:
                found[joint] = off
        return found

    def largest(self, low_rad: Mapping[str, float], high_rad: Mapping[str, float]) -> float:
        """Largest value between bounds of its joints, at about as many places as it has nodes."""
        spans = [
            np.linspace(low_rad.get(joint, 0.0), high_rad.get(joint, 0.0), count)
            for joint, count in zip(self.joints, self.nodes, strict=True)
        ]
        points = np.meshgrid(*spans, indexing="ij")
        return float(self.at(dict(zip(self.joints, map(np.ravel, points), strict=True))).max())

    def symbolic(self, places: Mapping[str, Any]) -> "ca.SX":
        """Value as a CasADi scalar, by the places of its joints; those that are not named stand at zero."""
        import casadi as ca  # a quarter of a second to import, which reading a scenario does without

        parts, over = [], []
        for joint, low, step, count in zip(self.joints, self.low_rad, self.step_rad, self.nodes, strict=True):
            q = ca.SX(places.get(joint, 0.0))
            within = ca.fmin(ca.fmax(q, float(low)), float(low + step * (count - 1)))
            u = (within - float(low)) / float(step)
            piece = ca.fmin(ca.floor(u), count - 2)
            s = u - piece
            chosen = ca.vertcat(*(piece == k for k in range(count - 1)))
            parts.append((chosen, _weights(s), [w / float(step) for w in _slopes(s)]))
            over.append(q - within)
        flags = [None, *range(len(parts))]  # value, then slopes over each axis
        found = [self._contracted(parts, sloped) for sloped in flags]
        return found[0] + sum((slope * off for slope, off in zip(found[1:], over, strict=True)), ca.SX(0))

    def _contracted(self, parts: list[tuple["ca.SX", list[Any], list[Any]]], sloped: int | None) -> "ca.SX":
        """Sum over all axes, the last one first; of the slope over the axis `sloped`."""
        import casadi as ca

        shape = self.coefficients.shape
        left = ca.SX(ca.DM(self.coefficients.reshape(-1, shape[-1])))
        for k in reversed(range(len(parts))):
            chosen, weights, slopes = parts[k]
            count = shape[k] - 3
            own = slopes if k == sloped else weights
            window = ca.SX.zeros(shape[k])
            for j in range(4):  # of each window of four coefficients, the weights of that one in which q is
                window[j : j + count] += own[j] * chosen
            left = ca.mtimes(left, window)
            if k:
                left = ca.reshape(left, shape[k - 1], -1).T
        return left

    def _evaluated(self, places: Mapping[str, Any]) -> list[Array]:
        given = [np.asarray(places.get(joint, 0.0), dtype=np.float64) for joint in self.joints]
        given = list(np.broadcast_arrays(*given))
        weights, slopes, first, over = [], [], [], []
        for q, low, step, count in zip(given, self.low_rad, self.step_rad, self.nodes, strict=True):
            within = np.clip(q, low, low + step * (count - 1))
            u = (within - low) / step
            piece = np.minimum(np.floor(u), count - 2)
            weights.append(_weights(u - piece))
            slopes.append([w / step for w in _slopes(u - piece)])
            first.append(piece.astype(int))
            over.append(q - within)
        axes = range(len(given))
        found: list[Array] = [np.zeros(np.shape(given[0])) for _ in range(1 + len(given))]
        for corner in itertools.product(range(4), repeat=len(given)):
            own = self.coefficients[tuple(first[a] + corner[a] for a in axes)]
            for k, total in enumerate(found):
                share = own
                for a in axes:
                    share = share * (slopes if a == k - 1 else weights)[a][corner[a]]
                found[k] = total + share
        for slope, off in zip(found[1:], over, strict=True):
            found[0] = found[0] + slope * off
        return found


def _weights(s: Any) -> list[Any]:
    """Weights of four neighbouring coefficients at s in [0, 1) of a piece."""
    t = 1 - s
    return [t**3 / 6, (4 - 3 * s**2 * (2 - s)) / 6, (4 - 3 * t**2 * (2 - t)) / 6, s**3 / 6]


def _slopes(s: Any) -> list[Any]:
    """Slopes of those weights over s."""
    t = 1 - s
    return [-(t**2) / 2, (3 * s**2 - 4 * s) / 2, -(3 * t**2 - 4 * t) / 2, s**2 / 2]


def _coefficients(values: Array) -> Array:
    """Coefficients along the first axis through values at nodes."""
    n = len(values)
    rows = np.zeros((n + 2, n + 2))
    for k in range(n):
        rows[k + 1, k : k + 3] = (1 / 6, 4 / 6, 1 / 6)
    rows[0, :5] = rows[-1, -5:] = (1, -4, 6, -4, 1)
    right = np.zeros((n + 2, *values.shape[1:]))
    right[1:-1] = values
    found: Array = np.asarray(np.linalg.solve(rows, right.reshape(n + 2, -1)), np.float64).reshape(right.shape)
    return found
