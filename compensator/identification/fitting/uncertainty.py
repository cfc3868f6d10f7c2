"""Contributions to the uncertainty of a fitted chain: other laws, the method itself, and each file on its own.

Several files also say something about each other: a scatter, a drift over time.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.gains import Gains
from tendonff.compensator.identification.parameters import CELL_GAINS, TENDON, Parameter
from tendonff.models.path import Section
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance, gauss_newton_step

D = Parameter

ALTERNATIVES = (D.ADHESION, D.STATIC_EXCESS, D.OUTPUT_BIAS)
"""Each may be missing in the law although it acts; they are averaged over by what the data say of them."""

WATCHED = (D.MU, D.MU_RELEASE, D.ADHESION, D.BRISTLE, D.STIFFNESS)
"""Values whose differences between files are reported."""


def slopes_over_all(task: ChainResiduals, names: Sequence[Parameter]) -> Residuals:
    """Residuals at the fixed values with slopes over all of `names`."""
    return replace(task, free=tuple(names)).evaluate({str(n): task.fixed[n] for n in names})


def expected_errors(found: Residuals, names: Sequence[Parameter]) -> dict[Parameter, float]:
    """Standard errors if all of `names` but the cells' gains were free, by the slopes over them at the present
    values.
    """
    own = [k for k, name in enumerate(names) if name not in CELL_GAINS]
    covariance, _ = block_covariance(replace(found, slopes=found.slopes[:, own]), robust=True)
    return dict(zip((names[k] for k in own), np.sqrt(np.diag(covariance)), strict=True))


def doubt_of_other_laws(
    solution: Solution, found: Residuals, names: Sequence[Parameter], task: ChainResiduals
) -> tuple[Array, float]:
    """Covariance of what laws with one more effect make doubtful, each weighted by what the data say of it.

    One Gauss-Newton step from the solution, where `found` has slopes over `names`, tells where the answer would go with
    the effect and how much the error would fall; Akaike's weights follow, with as many samples as there are independent
    ones. A path whose wrap angle is not even along its length is one of the effects: it shows in the elongation and
    moves the stiffness most. Returned with the doubt: by how much more of the wrap angle the nearer half carries
    than half [-]; 0 where the data do not tell.
    """
    free = [names.index(D(n)) for n in solution.values]
    independent = task.independent_rows(found)
    own_step, own_size = _newton(found, free)
    own, _ = block_covariance(replace(found, slopes=found.slopes[:, free]), robust=True)
    if not np.isfinite(own).all():  # nothing to add to what is not known
        return np.zeros_like(own), 0.0
    moves, spreads, evidence = [np.zeros(len(free))], [own], [0.0]
    others: list[tuple[Parameter | None, Residuals, int]] = [
        (extra, found, names.index(extra))
        for extra in ALTERNATIVES
        if names.index(extra) not in free
        # Nearly the same in most data; which of both it is was decided where nothing was fitted.
        and not (extra is D.ADHESION and D.LOAD_EXPONENT in solution.values)
    ]
    uneven = _with_concentration(found, task)
    if uneven is not None:
        others.append((None, uneven, len(names)))
    concentration = 0.0
    for extra, slopes, column in others:
        columns = [*free, column]
        step, size = _newton(slopes, columns)
        covariance, _ = block_covariance(replace(slopes, slopes=slopes.slopes[:, columns]), robust=True)
        feasible = extra is None or extra.tensions.signed or step[-1] + task.fixed[extra] > 0
        if not (feasible and np.isfinite(covariance).all()):
            continue
        support = independent / 2 * float(np.log(own_size / size)) - 1
        moves.append(step[:-1] - own_step)
        spreads.append(covariance[:-1, :-1])
        # The choice of the law has turned the others down already; nobody has asked for this one yet.
        evidence.append(support if extra is None else min(support, 0.0))
        if extra is None and support > TUNED.worth_a_constant:
            concentration = float(step[-1])
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    total = sum(s * (c + np.outer(m, m)) for s, c, m in zip(share, spreads, moves, strict=True))
    return TUNED.other_laws * _nearest_covariance(total - own), concentration


def _nearest_covariance(found: Array) -> Array:
    """A covariance with the variances of a matrix, those below nothing left out, and its correlation as far as may be.

    What moves several values moves them together.
    """
    deviation = np.sqrt(np.clip(np.diag(found), 0, None))
    seen = np.where(deviation > 0, deviation, np.inf)
    sizes, directions = np.linalg.eigh(found / np.outer(seen, seen))
    positive = (directions * np.clip(sizes, 0, None)) @ directions.T
    own = np.sqrt(np.where(np.diag(positive) > 0, np.diag(positive), np.inf))
    together: Array = positive * np.outer(deviation / own, deviation / own)
    return together


def _with_concentration(found: Residuals, task: ChainResiduals) -> Residuals | None:
    """Slopes over one more value: by how much the nearer half carries more than its half of the wrap angle."""
    t = task.model.transmission
    if t.path.sections or t.joints or not all(run.with_elongation for run in task.pieces):
        return None
    theta = t.path.total_angle_rad
    shares = {"near": 0.5 * (1 + TUNED.tried_concentration), "far": 0.5 * (1 - TUNED.tried_concentration)}
    halves = tuple(Section(name=name, angle_rad=theta * share, length_m=0.5) for name, share in shares.items())
    path = replace(t.path, sections=halves, total_angle_rad=sum(half.angle_rad for half in halves))
    model = replace(task.model, transmission=replace(t, path=path))
    other = replace(task, model=model, free=()).evaluate({})
    slope = (other.values - found.values) / TUNED.tried_concentration
    return replace(found, slopes=np.column_stack([found.slopes, slope]))


def _newton(found: Residuals, columns: Sequence[int]) -> tuple[Array, float]:
    """A Gauss-Newton step over some columns, and the squared residuals after it."""
    step = gauss_newton_step(found.values, found.slopes[:, columns])
    after = found.values + found.slopes[:, columns] @ step
    return step, max(float((after**2 / np.sqrt(1 + found.values**2)).sum()), 1e-300)


def with_taken_for_granted(
    solution: Solution,
    found: Residuals,
    names: Sequence[Parameter],
    task: ChainResiduals,
    *,
    gains: Gains,
    kept_uncertainty: float,
) -> Solution:
    """Add what the cells' gains and the tendon's kept values, by their 95 % half-width, make doubtful.

    The answer goes with such a number as a Gauss-Newton step does. What the files themselves say of a kept value does
    not narrow its doubt: the value stays.
    """
    free = [names.index(D(n)) for n in solution.values]
    kept = [n for n in names if n in TENDON and n not in solution.values] if kept_uncertainty > 0 else []
    # The lower end of a value's interval is the further one: its logarithm counts.
    by_kept = -math.log1p(-kept_uncertainty) / 2
    granted = [by_kept * found.slopes[:, names.index(n)] * task.fixed[n] for n in kept]
    variances, directions = np.linalg.eigh(gains.covariance)
    by_gains = found.slopes[:, [names.index(n) for n in CELL_GAINS]] @ directions
    granted += [math.sqrt(size) * slope for size, slope in zip(variances.tolist(), by_gains.T, strict=True) if size > 0]
    own, covariance = found.slopes[:, free], solution.covariance
    for slope in granted:
        moved = TUNED.granted * (gauss_newton_step(found.values + slope, own) - gauss_newton_step(found.values, own))
        covariance = covariance + np.outer(moved, moved)
    return replace(solution, covariance=covariance)


def with_common_errors(solution: Solution) -> Solution:
    """Widen what is wrong alike in all blocks, whose scatter hides it."""
    factors = np.array([D(n).tensions.alike for n in solution.values])
    return replace(solution, covariance=solution.covariance * np.outer(factors, factors))


def with_floors(solution: Solution, mean_N: float) -> Solution:
    """Add what the method itself does not resolve, the mean output tension being `mean_N`."""
    errors = [D(n).tensions.floor_of(v, mean_N) for n, v in solution.values.items()]
    return replace(solution, covariance=solution.covariance + np.diag(np.square(errors)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ByFile:
    """Values by one file alone, the laws and the other values as in the joint fit.

    Attributes
    ----------
    file : str
        Name of the file.
    values, errors : dict of str to float
        Estimates and standard errors by name; without those that the file does not identify.
    started_s : float or None
        Start of the file by its own clock, where that tells dates [s].
    """

    file: str
    values: dict[str, float]
    errors: dict[str, float]
    started_s: float | None = None


def file_estimates(task: ChainResiduals, found: Residuals, solution: Solution) -> tuple[ByFile, ...]:
    """Gauss-Newton step for each file alone from the joint solution, where the residuals are `found`; none for
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
        identified = [k for k, error in enumerate(errors) if np.isfinite(error)]
        called = dict(enumerate(solution.values))
        values = list(solution.values.values())
        estimates.append(
            ByFile(
                file=name,
                values={called[k]: values[k] + float(moved[k]) for k in identified},
                errors={called[k]: float(errors[k]) for k in identified},
            )
        )
    return tuple(estimates)


def with_scatter(solution: Solution, files: Sequence[ByFile]) -> Solution:
    """Add the scatter between files to the covariance, over their number."""
    if len(files) < TUNED.least_files:
        return solution
    extra = [_scatter(files, n) ** 2 / len(files) for n in solution.values]
    return replace(solution, covariance=solution.covariance + np.diag(extra))


def between_files(
    files: Sequence[ByFile],
    values: Mapping[Parameter, float],
    records: Sequence[Record],
) -> tuple[tuple[ByFile, ...], list[str]]:
    """Estimates by file with their times, and messages on their differences."""
    started = {r.name: r.started_s for r in records}
    rows = tuple(replace(f, started_s=started.get(f.file)) for f in files)
    lines = []
    for parameter in WATCHED if files else ():
        name, value = str(parameter), abs(values[parameter])
        scatter = _scatter(rows, name)
        if value > 0 and scatter > TUNED.scatter_share * value:
            lines.append(
                f"{name} differs between files beyond its errors: scatter {100 * scatter / value:.2g} % "
                "(estimates by file are in fit.json); the intervals take it into account"
            )
        lines += [line for line in (_drift(rows, name),) if line]
    return rows, lines


def _identified(files: Sequence[ByFile], name: str) -> tuple[Array, Array]:
    """Values by file, and their weights."""
    some = [(f.values[name], f.errors[name]) for f in files if name in f.values]
    values, errors = np.array(some).reshape(-1, 2).T
    return values, 1 / np.maximum(errors, 1e-300) ** 2


def _scatter(files: Sequence[ByFile], name: str) -> float:
    """Standard deviation between files beyond what their own errors explain; 0 with few files."""
    values, weight = _identified(files, name)
    if len(values) < TUNED.least_files:
        return 0.0
    mean = float((weight * values).sum() / weight.sum())
    excess = float((weight * (values - mean) ** 2).sum()) - (len(values) - 1)
    return float(np.sqrt(max(excess / float(weight.sum() - (weight**2).sum() / weight.sum()), 0.0)))


def _drift(files: Sequence[ByFile], name: str) -> str:
    """A trend over the files' own time stamps; empty where none is sure."""
    dated = [f for f in files if f.started_s is not None and name in f.values and f.errors[name] > 0]
    hours = np.array([f.started_s for f in dated], dtype=np.float64) / 3600
    if len(dated) < TUNED.least_files or float(np.ptp(hours)) == 0:
        return ""
    values, weight = _identified(dated, name)
    hours = hours - hours.mean()
    (slope, middle), covariance = np.polyfit(hours, values, 1, w=np.sqrt(weight), cov="unscaled")
    left = values - middle - slope * hours
    error = np.sqrt(max(1.0, float((weight * left**2).sum()) / (len(values) - 2)) * covariance[0, 0])
    if abs(slope) <= TUNED.very_sure * error:
        return ""
    scale = 100 / abs(float(values.mean()))
    return f"{name} drifts by {scale * slope:+.2g} % an hour over these files (standard error {scale * error:.2g} %)"
