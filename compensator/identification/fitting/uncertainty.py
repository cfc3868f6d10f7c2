"""What adds to the doubt of a fitted chain: other laws, and the method itself."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals, gauss_newton_step
from tendonff.compensator.identification.measured import Array
from tendonff.models.path import Section
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance

D = DynamicParameter

FLOORS = {
    D.MU_PULL: 0.002,
    D.MU_RELEASE: 0.003,
    D.BRISTLE: 0.015,
    D.STIFFNESS: 0.002,
    D.RELAXING: 0.005,
    D.RELAXATION_TIME: 0.01,
}
"""Standard error of the method itself as a share of the value, seen on simulated rigs: masses and steps are finite, and
no device has exactly these laws."""

ALIKE = {D.BRISTLE: 3.0}
"""A bristle that fills up by another law shows alike in all blocks: their scatter tells a third of what it does to the
stiffness, seen on simulated rigs."""

ADHESION_FLOOR = 0.0008
"""The same for adhesion and offsets, as a share of the mean output tension."""

ALTERNATIVES = (D.ADHESION, D.STATIC_EXCESS, D.OUTPUT_BIAS)
"""Each may be missing in the law although it acts; they are averaged over by what the data say of them."""

TRIED_CONCENTRATION = 0.3
"""The path whose nearer half carries so much more than half of the wrap angle is one more of them."""

UNEVEN_FROM = 3.0
"""From this logarithm of the evidence on a path that is not even is spoken of."""

POSITIVE = tuple(n for n in D if n not in (D.INPUT_BIAS, D.OUTPUT_BIAS))


def slopes_over_all(task: ChainResiduals, names: Sequence[DynamicParameter]) -> Residuals | None:
    """Residuals at the fixed values with slopes over all of `names`; None where the model has no answer."""
    try:
        return replace(task, free=tuple(names)).evaluate({str(n): task.fixed[n] for n in names})
    except ValueError:
        return None


def expected_errors(found: Residuals | None, names: Sequence[DynamicParameter]) -> dict[DynamicParameter, float]:
    """Standard errors if all of `names` were free, by the slopes over them at the present values."""
    if found is None:
        return dict.fromkeys(names, float("inf"))
    covariance, _ = block_covariance(found, robust=True)
    return dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))


def with_other_laws(
    solution: Solution, found: Residuals | None, names: Sequence[DynamicParameter], task: ChainResiduals
) -> tuple[Solution, float]:
    """Add to the covariance what laws with one more effect make doubtful, each weighted by what the data say of it.

    One Gauss-Newton step from the solution, where `found` has slopes over `names`, tells where the answer would go with
    the effect and how much the error would fall; Akaike's weights follow, with as many samples as there are independent
    ones. A path whose wrap angle is not even along its length is one of the effects: it shows in the elongation and
    moves the stiffness most. Returned with the solution: by how much more of the wrap angle the nearer half carries
    than half [-]; 0 where the data do not tell.
    """
    if found is None:
        return solution, 0.0
    free = [names.index(D(n)) for n in solution.values]
    independent = task.independent_rows(found)
    own_step, own_size = _newton(found, free)
    own, _ = block_covariance(replace(found, slopes=found.slopes[:, free]), robust=True)
    moves, spreads, evidence = [np.zeros(len(free))], [own], [0.0]
    others: list[tuple[DynamicParameter | None, Residuals, int]] = [
        (extra, found, names.index(extra)) for extra in ALTERNATIVES if names.index(extra) not in free
    ]
    uneven = _with_concentration(found, task)
    if uneven is not None:
        others.append((None, uneven, len(names)))
    concentration = 0.0
    for extra, slopes, column in others:
        columns = [*free, column]
        step, size = _newton(slopes, columns)
        covariance, _ = block_covariance(replace(slopes, slopes=slopes.slopes[:, columns]), robust=True)
        feasible = extra is None or extra not in POSITIVE or step[-1] + task.fixed[extra] > 0
        if not (feasible and np.isfinite(covariance).all()):
            continue
        said = independent / 2 * float(np.log(own_size / size)) - 1
        moves.append(step[:-1] - own_step)
        spreads.append(covariance[:-1, :-1])
        # The choice of the law has turned the others down already; nobody has asked for this one yet.
        evidence.append(said if extra is None else min(said, 0.0))
        if extra is None and said > UNEVEN_FROM:
            concentration = float(step[-1])
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    total = sum(s * (c + np.outer(m, m)) for s, c, m in zip(share, spreads, moves, strict=True))
    doubt = np.clip(np.diag(total - own), 0, None)
    return replace(solution, covariance=solution.covariance + np.diag(doubt)), concentration


def _with_concentration(found: Residuals, task: ChainResiduals) -> Residuals | None:
    """Slopes over one more value: by how much the nearer half carries more than its half of the wrap angle."""
    t = task.model.transmission
    if t.path.sections or t.joints or not all(run.with_elongation for run in task.pieces):
        return None
    theta = t.path.total_angle_rad
    shares = {"near": 0.5 * (1 + TRIED_CONCENTRATION), "far": 0.5 * (1 - TRIED_CONCENTRATION)}
    halves = tuple(Section(name=name, angle_rad=theta * share, length_m=0.5) for name, share in shares.items())
    path = replace(t.path, sections=halves, total_angle_rad=sum(half.angle_rad for half in halves))
    model = replace(task.model, transmission=replace(t, path=path))
    try:
        other = replace(task, model=model, free=()).evaluate({})
    except ValueError:
        return None
    slope = (other.values - found.values) / TRIED_CONCENTRATION
    return replace(found, slopes=np.column_stack([found.slopes, slope]))


def _newton(found: Residuals, columns: Sequence[int]) -> tuple[Array, float]:
    """A Gauss-Newton step over some columns, and the squared residuals after it."""
    step = gauss_newton_step(found.values, found.slopes[:, columns])
    after = found.values + found.slopes[:, columns] @ step
    return step, max(float((after**2 / np.sqrt(1 + found.values**2)).sum()), 1e-300)


def with_common_errors(solution: Solution) -> Solution:
    """Widen what is wrong alike in all blocks, whose scatter hides it."""
    factors = np.array([ALIKE.get(D(n), 1.0) for n in solution.values])
    return replace(solution, covariance=solution.covariance * np.outer(factors, factors))


def with_floors(solution: Solution, mean_N: float) -> Solution:
    """Add what the method itself does not resolve, the mean output tension being `mean_N`."""
    floors: Mapping[DynamicParameter, float] = FLOORS
    errors = [
        ADHESION_FLOOR * mean_N if D(n) in (D.ADHESION, D.INPUT_BIAS, D.OUTPUT_BIAS) else floors.get(D(n), 0.0) * abs(v)
        for n, v in solution.values.items()
    ]
    return replace(solution, covariance=solution.covariance + np.diag(np.square(errors)))
