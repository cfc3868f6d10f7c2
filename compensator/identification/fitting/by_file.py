"""What each file says by itself, and what several say about each other: scatter, a drift over time, conditions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals, gauss_newton_step
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance

D = DynamicParameter

LEAST_FILES = 3
"""So many files show a scatter between them."""

WORTH_TELLING = 0.02
"""Scatter between files from which on it is told, as a share of the value."""

SURE_OF_DRIFT = 3.0
OFTEN_ASKED = (D.MU_PULL, D.MU_RELEASE, D.ADHESION, D.BRISTLE, D.STIFFNESS)


@dataclass(frozen=True, slots=True, kw_only=True)
class ByFile:
    """Values by one file alone, the laws and the other values as in the joint fit."""

    file: str
    # values, errors: estimates and standard errors by name; what the file does not tell is left out
    values: dict[str, float]
    errors: dict[str, float]
    condition: str = ""  # the label that it was given; empty without one
    started_s: float | None = None  # start of the file by its own clock, where that tells dates [s]


def file_estimates(task: ChainResiduals, found: Residuals, solution: Solution) -> tuple[ByFile, ...]:
    """One Gauss-Newton step for each file alone from the joint solution, where the residuals are `found`; none for
    one file.
    """
    names = list(dict.fromkeys(run.record.name for run in task.pieces))
    if len(names) < 2:
        return ()
    own = found.slopes[:, : len(solution.values)]
    of_piece = found.blocks // task.BLOCKS_A_PIECE
    joint = gauss_newton_step(found.values, own)
    estimates = []
    for name in names:
        rows = np.isin(of_piece, [k for k, run in enumerate(task.pieces) if run.record.name == name])
        part = Residuals(values=found.values[rows], slopes=own[rows], blocks=found.blocks[rows])
        covariance, _ = block_covariance(part, robust=True)
        errors = np.sqrt(np.diag(covariance))
        moved = gauss_newton_step(part.values, part.slopes) - joint
        told = [k for k, error in enumerate(errors) if np.isfinite(error)]
        called = {k: _name(D(n)) for k, n in enumerate(solution.values)}
        values = list(solution.values.values())
        estimates.append(
            ByFile(
                file=name,
                values={called[k]: values[k] + float(moved[k]) for k in told},
                errors={called[k]: float(errors[k]) for k in told},
            )
        )
    return tuple(estimates)


def with_scatter(solution: Solution, files: Sequence[ByFile]) -> Solution:
    """Add the scatter between files to the covariance, over their number."""
    if len(files) < LEAST_FILES:
        return solution
    extra = [_scatter(files, _name(D(n))) ** 2 / len(files) for n in solution.values]
    return replace(solution, covariance=solution.covariance + np.diag(extra))


def between_files(
    files: Sequence[ByFile],
    values: Mapping[DynamicParameter, float],
    records: Sequence[Record],
    conditions: Mapping[str, str],
) -> tuple[tuple[ByFile, ...], list[str]]:
    """Estimates by file with their conditions and times, and what is to be said about their differences."""
    started = {r.name: r.started_s for r in records}
    rows = tuple(replace(f, condition=conditions.get(f.file, ""), started_s=started.get(f.file)) for f in files)
    said = []
    for parameter in OFTEN_ASKED if files else ():
        name, value = _name(parameter), abs(values[parameter])
        scatter = _scatter(rows, name)
        if value > 0 and scatter > WORTH_TELLING * value:
            said.append(
                f"{name} differs between files beyond its errors: scatter {100 * scatter / value:.2g} % "
                "(estimates by file are in fit.json); the intervals take it into account"
            )
        said += [line for line in (_drift(rows, name), _by_condition(rows, name)) if line]
    return rows, said


def _name(parameter: DynamicParameter) -> str:
    return "soft_bristle_stiffness_N_per_m" if parameter is D.BRISTLE else str(parameter)


def _told(files: Sequence[ByFile], name: str) -> tuple[Array, Array]:
    """Values by file, and their weights."""
    some = [(f.values[name], f.errors[name]) for f in files if name in f.values]
    values, errors = np.array(some).reshape(-1, 2).T
    return values, 1 / np.maximum(errors, 1e-300) ** 2


def _scatter(files: Sequence[ByFile], name: str) -> float:
    """Standard deviation between files beyond what their own errors explain; 0 with few files."""
    values, weight = _told(files, name)
    if len(values) < LEAST_FILES:
        return 0.0
    mean = float((weight * values).sum() / weight.sum())
    excess = float((weight * (values - mean) ** 2).sum()) - (len(values) - 1)
    return float(np.sqrt(max(excess / float(weight.sum() - (weight**2).sum() / weight.sum()), 0.0)))


def _drift(files: Sequence[ByFile], name: str) -> str:
    """A trend over the files' own time stamps; empty where none is sure."""
    dated = [f for f in files if f.started_s is not None and name in f.values and f.errors[name] > 0]
    hours = np.array([f.started_s for f in dated], dtype=np.float64) / 3600
    if len(dated) < LEAST_FILES or float(np.ptp(hours)) == 0:
        return ""
    values, weight = _told(dated, name)
    hours = hours - hours.mean()
    (slope, middle), covariance = np.polyfit(hours, values, 1, w=np.sqrt(weight), cov="unscaled")
    left = values - middle - slope * hours
    error = np.sqrt(max(1.0, float((weight * left**2).sum()) / (len(values) - 2)) * covariance[0, 0])
    if abs(slope) <= SURE_OF_DRIFT * error:
        return ""
    scale = 100 / abs(float(values.mean()))
    return f"{name} drifts by {scale * slope:+.2g} % an hour over these files (standard error {scale * error:.2g} %)"


def _by_condition(files: Sequence[ByFile], name: str) -> str:
    """Means by condition, where there are several."""
    means = []
    for label in dict.fromkeys(f.condition for f in files if f.condition and name in f.values):
        values, weight = _told([f for f in files if f.condition == label], name)
        means.append(f"{label} {float((weight * values).sum() / weight.sum()):.4g} +- {1 / np.sqrt(weight.sum()):.2g}")
    return f"{name} by condition: {', '.join(means)}" if len(means) > 1 else ""
