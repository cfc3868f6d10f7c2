"""What each file says by itself: estimates, and their scatter between files."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.identification.measured.reading import Array
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance

D = DynamicParameter

LEAST_FILES = 3
"""So many files show a scatter between them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileEstimate:
    """Values by one file alone, the laws and the other values as in the joint fit."""

    file: str
    # values, errors: estimates and standard errors; what a file does not tell has an infinite one
    values: dict[DynamicParameter, float]
    errors: dict[DynamicParameter, float]


def file_estimates(task: ChainResiduals, found: Residuals, solution: Solution) -> tuple[FileEstimate, ...]:
    """One Gauss-Newton step from the joint solution for each file alone.

    Parameters
    ----------
    found : Residuals
        At the joint solution, its first columns over the values of `solution`.
    """
    free = [D(n) for n in solution.values]
    names = list(dict.fromkeys(run.record.name for run in task.pieces))
    if len(names) < 2:
        return ()
    own = found.slopes[:, : len(free)]
    of_piece = found.blocks // task.BLOCKS_A_PIECE
    joint = gauss_newton_step(found.values, own)
    estimates = []
    for name in names:
        rows = np.isin(of_piece, [k for k, run in enumerate(task.pieces) if run.record.name == name])
        part = Residuals(values=found.values[rows], slopes=own[rows], blocks=found.blocks[rows])
        covariance, _ = block_covariance(part, robust=True)
        errors = np.sqrt(np.diag(covariance))
        moved = gauss_newton_step(part.values, part.slopes) - joint
        estimates.append(
            FileEstimate(
                file=name,
                values={n: solution.values[n] + float(m) for n, m in zip(free, moved, strict=True)},
                errors={n: float(e) for n, e in zip(free, errors, strict=True)},
            )
        )
    return tuple(estimates)


def gauss_newton_step(residuals: Array, slopes: Array) -> Array:
    """Change of the values that the residuals ask for, large ones counted linearly, shape (k,)."""
    weight = 1 / np.sqrt(1 + residuals**2)
    scale = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    scaled = slopes / scale
    return np.asarray(-np.linalg.lstsq(np.sqrt(weight)[:, None] * scaled, np.sqrt(weight) * residuals)[0] / scale)


def scatter_of(estimates: Sequence[FileEstimate], name: DynamicParameter) -> float:
    """Standard deviation between files beyond what their own errors explain; 0 with few files."""
    told = [(e.values[name], e.errors[name]) for e in estimates if np.isfinite(e.errors.get(name, np.inf))]
    if len(told) < LEAST_FILES:
        return 0.0
    values, errors = (np.array(x) for x in zip(*told, strict=True))
    weight = 1 / np.maximum(errors, 1e-300) ** 2
    mean = float((weight * values).sum() / weight.sum())
    excess = float((weight * (values - mean) ** 2).sum()) - (len(values) - 1)
    return float(np.sqrt(max(excess / float(weight.sum() - (weight**2).sum() / weight.sum()), 0.0)))


def with_scatter(solution: Solution, estimates: Sequence[FileEstimate]) -> Solution:
    """Add the scatter between files to the covariance, over their number."""
    if len(estimates) < LEAST_FILES:
        return solution
    extra = [scatter_of(estimates, D(n)) ** 2 / len(estimates) for n in solution.values]
    return replace(solution, covariance=solution.covariance + np.diag(extra))
