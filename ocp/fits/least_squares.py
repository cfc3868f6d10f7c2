"""Robust nonlinear least squares with exact Jacobians, and what it says about its own uncertainty."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array

Blocks = NDArray[np.int_]

SINGULAR = 1e-9
"""Singular values of the scaled Jacobian below this share of the largest: the data does not see that direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """Unknown number."""

    name: str
    start: float
    # low, high: bounds; start is moved inside them
    low: float
    high: float
    scale: float  # typical size [unit of the value], > 0; for a logarithmic unknown, of its logarithm
    logarithmic: bool = False  # search over ln(value): for positive values known to a factor only

    def inside(self, value: float) -> float:
        """`value` as the search sees it."""
        return float(np.log(value)) if self.logarithmic else value

    def outside(self, x: float) -> float:
        """Inverse of `inside`."""
        return float(np.exp(x)) if self.logarithmic else float(x)


@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Weighted differences between model and measurement."""

    values: Array  # shape (m,); in units of their expected size
    slopes: Array  # shape (m, unknowns); over the values of the unknowns
    blocks: Blocks  # shape (m,); rows of one block may be correlated, rows of different blocks are taken as independent


Evaluate = Callable[[Mapping[str, float]], Residuals]
Values = Callable[[Mapping[str, float]], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """Minimiser and its uncertainty."""

    values: dict[str, float]
    # shape (k, k); of the values, in the order of `values`; infinite variance where the data does not see a value
    covariance: Array
    degrees: int  # independent blocks less unknowns: degrees of freedom of Student's t
    residuals: Residuals  # at the minimiser
    cost: float
    at_bound: tuple[str, ...]  # unknowns that ended on a bound

    def standard_error(self, name: str) -> float:
        """Standard error of one value."""
        k = list(self.values).index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))

    def interval(self, name: str) -> tuple[float, float]:
        """95 % confidence interval of one value."""
        reach = float(student.ppf(0.975, max(self.degrees, 1))) * self.standard_error(name)
        return self.values[name] - reach, self.values[name] + reach

    def correlation(self) -> Array:
        """Correlation matrix of the values, shape (k, k); zero with values that the data does not see."""
        found = self.share(self.covariance)
        np.fill_diagonal(found, 1.0)
        return found

    def share(self, part: Array) -> Array:
        """Part of the covariance over the standard errors, shape (k, k); 0 with values that the data does not see."""
        deviation = np.sqrt(np.clip(np.diag(self.covariance), 0, None))
        seen = np.isfinite(deviation) & (deviation > 0)
        found = np.zeros(self.covariance.shape)
        if seen.any():
            own = part[np.ix_(seen, seen)] / np.outer(deviation[seen], deviation[seen])
            found[np.ix_(seen, seen)] = np.clip(own, -1, 1)
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Minimum:
    """Minimiser without its uncertainty."""

    values: dict[str, float]
    residuals: Residuals
    cost: float
    at_bound: tuple[str, ...]

    def with_covariance(self, *, robust: bool = True) -> Solution:
        """The minimiser and its uncertainty."""
        covariance, degrees = block_covariance(self.residuals, robust=robust)
        return Solution(
            values=self.values,
            covariance=covariance,
            degrees=degrees,
            residuals=self.residuals,
            cost=self.cost,
            at_bound=self.at_bound,
        )


def solve(
    evaluate: Evaluate,
    unknowns: Sequence[Unknown],
    *,
    values: Values | None = None,
    begun: Residuals | None = None,
    robust: bool = True,
    from_afar: bool = False,
    most: int = 60,
    tolerance: float = 1e-8,
) -> Solution:
    """`minimise`, with the covariance of the values."""
    found = minimise(
        evaluate,
        unknowns,
        values=values,
        begun=begun,
        robust=robust,
        from_afar=from_afar,
        most=most,
        tolerance=tolerance,
    )
    return found.with_covariance(robust=robust)


def minimise(
    evaluate: Evaluate,
    unknowns: Sequence[Unknown],
    *,
    values: Values | None = None,
    begun: Residuals | None = None,
    robust: bool = True,
    from_afar: bool = False,
    most: int = 60,
    tolerance: float = 1e-8,
) -> Minimum:
    """Minimise the residuals: soft-l1 loss (quadratic below one unit, linear above) or plain squares.

    `from_afar`, most residuals of the start are large: SciPy's soft-l1 loss has hardly any curvature there, so the same
    is searched as plain squares of `softened` residuals, in usual steps of the unknowns, the first of at most one each.
    `values` gives the residuals alone, where their slopes cost much: a third of the points that a search tries is worse
    than the one before, and asked for no slopes. `begun` are the residuals at the start, where they are known. At most
    so many evaluations; SolveError if the residuals are not finite at the start.
    """
    usual, first = np.array([u.scale for u in unknowns]), np.array([u.inside(u.start) for u in unknowns])
    unit = usual if from_afar else np.ones(len(unknowns))
    origin = first - unit if from_afar else np.zeros(len(unknowns))
    low = (np.array([u.inside(u.low) if u.low > 0 or not u.logarithmic else -np.inf for u in unknowns]) - origin) / unit
    high = (np.array([u.inside(u.high) for u in unknowns]) - origin) / unit
    start = np.clip((first - origin) / unit, low, high)
    known = begun is not None and np.array_equal(start, (first - origin) / unit)  # no bound has moved it
    memory: dict[bytes, Residuals] = {start.tobytes(): begun} if begun is not None and known else {}

    def outside(x: Array) -> dict[str, float]:
        return {u.name: u.outside(v) for u, v in zip(unknowns, origin + unit * x, strict=True)}

    def at(x: Array) -> Residuals:
        key = x.tobytes()
        if key not in memory:
            if len(memory) > 4:
                memory.pop(next(iter(memory)))
            memory[key] = evaluate(outside(x))
        return memory[key]

    soft = robust and from_afar

    def alone(x: Array) -> Array:
        found = at(x).values if values is None or x.tobytes() in memory else values(outside(x))
        return softened(found)[0] if soft else found

    def slopes(x: Array) -> Array:
        stretch = unit * [v if u.logarithmic else 1.0 for u, v in zip(unknowns, outside(x).values(), strict=True)]
        found = at(x)
        return np.asarray(found.slopes * (stretch * softened(found.values)[1][:, None] if soft else stretch))

    if not np.isfinite(at(start).values).all():
        raise SolveError("the model has no finite answer at the start of the fit; check units and signs of the data")
    found = least_squares(
        alone,
        start,
        jac=slopes,
        bounds=(low, high),
        x_scale=usual / unit,
        loss="soft_l1" if robust and not soft else "linear",
        max_nfev=most,
        xtol=tolerance,
        ftol=tolerance,
        gtol=1e-12,
    )
    residuals = at(found.x)
    bound = tuple(u.name for u, active in zip(unknowns, found.active_mask, strict=True) if active != 0)
    return Minimum(values=outside(found.x), residuals=residuals, cost=float(found.cost), at_bound=bound)


def softened(residuals: Array) -> tuple[Array, Array]:
    """Residuals whose squares are twice their soft-l1 loss, and slopes of these over the given ones."""
    size = np.sqrt(1 + residuals**2)
    root = np.sqrt(2 / (1 + size))
    return residuals * root, 1 / (size * root)


def block_covariance(residuals: Residuals, *, robust: bool) -> tuple[Array, int]:
    """Covariance of the values that stands correlated residuals, and its degrees of freedom, >= 1.

    H^-1 (sum over blocks of g g') H^-1, g = J' r; shape (k, k). The loss was soft-l1 where `robust`.
    """
    r, jacobian = residuals.values, residuals.slopes
    weight = 1 / np.sqrt(1 + r * r) if robust else np.ones_like(r)
    count = jacobian.shape[1]
    size = np.sqrt((weight[:, None] * jacobian**2).sum(axis=0))
    covariance = np.full((count, count), 0.0)
    seen = size > 0
    names, index = np.unique(residuals.blocks, return_inverse=True)
    degrees = max(len(names) - count, 1)
    if seen.any():
        scaled = jacobian[:, seen] / size[seen]
        _, s, vt = np.linalg.svd(np.sqrt(weight)[:, None] * scaled, full_matrices=False)
        blind = s < SINGULAR * s[0]
        inverse = (vt.T / np.where(blind, np.inf, s) ** 2) @ vt
        score = np.zeros((len(names), scaled.shape[1]))
        np.add.at(score, index, scaled * (weight * r)[:, None])
        factor = len(names) / max(len(names) - count, 1)
        clustered = factor * inverse @ (score.T @ score) @ inverse
        # The blocks' own scatter is a noisy estimate; never fall below what independent rows would give.
        rows = max(len(r) - count, 1)
        plain = inverse * float((weight * r * r).sum() / rows)
        alone = np.diag(clustered) <= np.finfo(float).eps * np.diag(plain)  # rounding is all that their blocks scatter
        clustered[alone, :] = clustered[:, alone] = 0.0
        clustered[alone, alone] = np.diag(plain)[alone]
        excess = np.ones(len(clustered))
        excess[~alone] = np.sqrt(np.maximum(np.diag(plain)[~alone] / np.diag(clustered)[~alone], 1.0))
        clustered = clustered * np.outer(excess, excess)
        part = clustered / np.outer(size[seen], size[seen])
        lost = (np.abs(vt[blind]) > 1e-3).any(axis=0) if blind.any() else np.zeros(scaled.shape[1], dtype=bool)
        part[lost, lost] = np.inf
        covariance[np.ix_(seen, seen)] = part
    covariance[~seen, ~seen] = np.inf
    return covariance, degrees


def gauss_newton_step(residuals: Array, slopes: Array) -> Array:
    """Change of the values that the residuals ask for, large ones counted linearly, shape (k,)."""
    weight = 1 / np.sqrt(1 + residuals**2)
    scale = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    scaled = slopes / scale
    return np.asarray(-np.linalg.lstsq(np.sqrt(weight)[:, None] * scaled, np.sqrt(weight) * residuals)[0] / scale)


def after_a_step(found: Residuals) -> float:
    """Soft-l1 loss that residuals would have after a Gauss-Newton step, were their slopes constant."""
    left = found.values + found.slopes @ gauss_newton_step(found.values, found.slopes)
    return float((np.sqrt(1 + left**2) - 1).sum())
