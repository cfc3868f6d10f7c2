"""A smoothing spline through noisy points of a curve, and what its turning means.

A quintic spline with a penalty on its third derivative, so that arcs cost nothing; the penalty's weight is that of
restricted maximum likelihood, which, unlike cross-validation, hardly ever follows the noise.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import BSpline
from scipy.linalg import eigh
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.optimize import minimize_scalar

from tendonff.compensator.files.reading import FloatArray

_DEGREE, _ORDER = 5, 3
_MOST_COEFFICIENTS = 120  # sharper bends than a hundredth of the path are none of a tendon's
_PLACES = 401
_WIDEST = 25.0  # logarithm of the weight over its usual one: from a spline through the points to a parabola


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothCurve:
    """A curve through noisy points."""

    parameter_m: FloatArray  # shape (n,); where the points are along it, about arc length
    points_m: FloatArray  # shape (n, dimensions)
    knots: FloatArray
    # shape (coefficients, coefficients); uncorrelated shapes of the spline, from those that the penalty leaves alone to
    # the roughest
    modes: FloatArray
    roughness: FloatArray  # shape (coefficients,); penalty of each over what it gains in fit [-]
    weight: float  # of the penalty

    @property
    def kept(self) -> FloatArray:
        """Share of each mode that the penalty keeps [-]."""
        return np.asarray(1 / (1 + self.weight * self.roughness))

    @property
    def noise_m(self) -> float:
        """Standard deviation of the points across the curve [m]."""
        spline = self.spline()
        along, off = spline(self.parameter_m, 1), self.points_m - spline(self.parameter_m)
        along /= np.linalg.norm(along, axis=1)[:, None]
        across = off - (off * along).sum(axis=1)[:, None] * along
        free = max(len(off) - float(self.kept.sum()), 1.0) * max(off.shape[1] - 1, 1)
        return float(np.sqrt((across**2).sum() / free))

    def through(self, points_m: FloatArray) -> "SmoothCurve":
        """The smoothing spline of other points at the same places: the weight is that of these."""
        loads = self._loads(points_m)
        whole, (count, dimensions) = float((points_m**2).sum()), points_m.shape
        rough = self.roughness[_ORDER:]

        def likelihood(log_weight: float) -> float:
            """Minus twice the logarithm of the restricted likelihood."""
            kept = 1 / (1 + np.exp(log_weight) * self.roughness)
            left = max(whole - float((kept[:, None] * loads**2).sum()), 1e-30 * whole)
            determinant = float(np.log(kept[_ORDER:]).sum()) + len(rough) * log_weight
            return float(dimensions * ((count - _ORDER) * np.log(left) - determinant))

        middle = -np.log(np.median(rough))
        found = minimize_scalar(likelihood, bounds=(middle - _WIDEST, middle + _WIDEST), method="bounded")
        return replace(self, points_m=points_m, weight=float(np.exp(found.x)))

    def _loads(self, points_m: FloatArray) -> FloatArray:
        basis = BSpline.design_matrix(self.parameter_m, self.knots, _DEGREE)
        return np.asarray(self.modes.T @ (basis.T @ points_m))

    def spline(self) -> BSpline:
        """The curve over its parameter."""
        return BSpline(self.knots, self.modes @ (self.kept[:, None] * self._loads(self.points_m)), _DEGREE)

    def turning(self) -> tuple[FloatArray, FloatArray]:
        """Length and angle turned from the start, at places along the curve [m], [rad].

        Curvature counts along its own mean direction over the length that the data resolve: what noise turns to and
        fro cancels there, where its magnitude would add up.
        """
        spline, places = self.spline(), np.linspace(self.parameter_m[0], self.parameter_m[-1], _PLACES)
        first, second = spline(places, 1), spline(places, 2)
        speed = np.linalg.norm(first, axis=1)
        tangent = first / speed[:, None]

        def across(vector: FloatArray) -> FloatArray:
            return np.asarray(vector - (vector * tangent).sum(axis=1)[:, None] * tangent)

        turn = across(second) / speed[:, None]
        window = (_PLACES - 1) / float(self.kept.sum())
        mean = across(gaussian_filter1d(turn, window, axis=0, mode="nearest"))
        size = np.maximum(np.linalg.norm(mean, axis=1), 1e-300)
        step = places[1] - places[0]
        length, angle = (
            cumulative_trapezoid(rate, dx=step, initial=0) for rate in (speed, (turn * mean).sum(axis=1) / size)
        )
        return length, angle

    def wider(self) -> "SmoothCurve":
        """The curve at half of the resolution: lengths go with the sixth root of the weight."""
        return replace(self, weight=self.weight * 2 ** (2 * _ORDER))


def _places_of(points_m: FloatArray) -> FloatArray:
    """About the length along the curve of each point: chords, smoothed, since jitter lengthens them."""
    chords = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    half = max(1, len(chords) // 20)
    return np.concatenate([[0.0], np.cumsum(uniform_filter1d(chords, 2 * half + 1, mode="mirror"))])


def smooth_curve(points_m: FloatArray) -> SmoothCurve:
    """The smoothing spline through points, shape (n, dimensions), at least 8, in their order along the curve."""
    places, count = _places_of(points_m), len(points_m)
    coefficients = int(np.clip(count // 2, _DEGREE + 2, _MOST_COEFFICIENTS))
    inner = np.linspace(places[0], places[-1], coefficients - _DEGREE + 1)
    knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
    basis = BSpline.design_matrix(places, knots, _DEGREE)
    node, share = np.polynomial.legendre.leggauss(_DEGREE)
    half = np.diff(inner) / 2
    at = ((inner[1:] + inner[:-1])[:, None] / 2 + half[:, None] * node).ravel()
    rough = BSpline(knots, np.eye(coefficients), _DEGREE)(at, _ORDER)
    penalty = rough.T @ ((half[:, None] * share).ravel()[:, None] * rough)
    gram = (basis.T @ basis).toarray()
    gram += 1e-12 * np.trace(gram) / coefficients * np.eye(coefficients)
    roughness, modes = eigh(penalty, gram)
    roughness = np.maximum(roughness, 0.0)
    roughness[:_ORDER] = 0.0
    curve = SmoothCurve(
        parameter_m=places, points_m=points_m, knots=knots, modes=modes, roughness=roughness, weight=1.0
    )
    return curve.through(points_m)
