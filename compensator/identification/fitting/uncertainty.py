"""What adds to the doubt of a fitted chain: other laws, noise on the input, the method itself."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.identification.measured.reading import Array
from tendonff.compensator.identification.measured.smoothing import find_adaptive_low_pass
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance

D = DynamicParameter

REPLICAS = 8
"""Runs with noise put on the input again, for what its noise does to the answer."""

MORE_THAN_ONCE, CORRECTION_DOUBT = 1.5, 0.5
"""The first dose of noise shifts the answer by so many times what a second one does, for rectification grows more
slowly than variance; and the standard error of the correction, as a share of it. Both seen on simulated rigs."""

FLOORS = {
    D.MU_PULL: 0.005,
    D.MU_RELEASE: 0.005,
    D.BRISTLE: 0.03,
    D.STIFFNESS: 0.003,
    D.RELAXING: 0.01,
    D.RELAXATION_TIME: 0.01,
}
"""Standard error of the method itself as a share of the value, seen on simulated rigs: masses and steps are finite, and
low-passes round what friction remembers."""

ADHESION_FLOOR = 0.002
"""The same for adhesion and offsets, as a share of the mean output tension."""

ALTERNATIVES = (D.ADHESION, D.STATIC_EXCESS, D.OUTPUT_BIAS)
"""Each may be missing in the law although it acts; they are averaged over by what the data say of them."""

POSITIVE = tuple(n for n in D if n not in (D.INPUT_BIAS, D.OUTPUT_BIAS))


def slopes_over_all(task: ChainResiduals, names: Sequence[DynamicParameter]) -> Residuals | None:
    """Residuals at the fixed values with slopes over all of `names`; None where the model has no answer."""
    try:
        return replace(task, free=tuple(names)).evaluate({str(n): task.fixed[n] for n in names})
    except ValueError:
        return None


def expected_errors(found: Residuals | None, names: Sequence[DynamicParameter]) -> dict[DynamicParameter, float]:
    """Standard errors if all of `names` were free, by the slopes at the present values.

    Parameters
    ----------
    found : Residuals or None
        With slopes over `names`.
    names : sequence of DynamicParameter
    """
    if found is None:
        return dict.fromkeys(names, float("inf"))
    covariance, _ = block_covariance(found, robust=True)
    return dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))


def with_other_laws(
    solution: Solution,
    found: Residuals | None,
    names: Sequence[DynamicParameter],
    task: ChainResiduals,
) -> Solution:
    """Average the covariance over laws with one more effect, each weighted by what the data say of it.

    One Gauss-Newton step from the solution tells where the answer would go with the effect and how much the error would
    fall; Akaike's weights follow, with as many samples as there are independent ones.

    Parameters
    ----------
    solution : Solution
    found : Residuals or None
        At the solution, with slopes over `names`.
    names : sequence of DynamicParameter
    task : ChainResiduals
    """
    if found is None:
        return solution
    free = [names.index(D(n)) for n in solution.values]
    independent = task.independent_rows(found)
    own_step, own_size = _newton(found, free)
    moves, spreads, evidence = [np.zeros(len(free))], [solution.covariance], [0.0]
    for extra in ALTERNATIVES:
        if names.index(extra) in free:
            continue
        columns = [*free, names.index(extra)]
        step, size = _newton(found, columns)
        covariance, _ = block_covariance(replace(found, slopes=found.slopes[:, columns]), robust=True)
        feasible = extra not in POSITIVE or step[-1] + task.fixed[extra] > 0
        if feasible and np.isfinite(covariance).all():
            moves.append(step[:-1] - own_step)
            spreads.append(covariance[:-1, :-1])
            evidence.append(min(independent / 2 * float(np.log(own_size / size)) - 1, 0.0))
    share = np.exp(evidence) / np.sum(np.exp(evidence))
    total = sum(s * (c + np.outer(m, m)) for s, c, m in zip(share, spreads, moves, strict=True))
    return replace(solution, covariance=np.asarray(total))


def _newton(found: Residuals, columns: Sequence[int]) -> tuple[Array, float]:
    """A Gauss-Newton step over some columns, and the squared residuals after it."""
    weight = 1 / np.sqrt(1 + found.values**2)
    slopes = found.slopes[:, columns]
    scale = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    scaled = slopes / scale
    step = -np.linalg.pinv(scaled.T @ (scaled * weight[:, None]), rcond=1e-12) @ (scaled.T @ (weight * found.values))
    after = found.values + scaled @ step
    return step / scale, max(float((weight * after**2).sum()), 1e-300)


def with_input_noise(task: ChainResiduals, solution: Solution) -> Solution:
    """Take the input's noise into account: what it shifts is taken out, what it scatters joins the covariance.

    The model is driven by a measurement. Its noise is rectified by the play of friction, and the filter against it
    rounds the extremes that friction remembers; neither is in the residuals' statistics. So the smoothed input is taken
    for true, measured again with noise of the same size, filtered again, and one Gauss-Newton step tells where the
    answer goes (parametric bootstrap).

    Parameters
    ----------
    task : ChainResiduals
        On few masses, with the free parameters of `solution`.
    solution : Solution
    """
    if all(run.input_noise_N <= 0 for run in task.pieces):
        return solution
    base = task.evaluate(solution.values)
    weight = 1 / np.sqrt(1 + base.values**2)
    normal = (base.slopes * weight[:, None]).T
    inverse = np.linalg.pinv(normal @ base.slopes, hermitian=True, rcond=1e-14)
    rng = np.random.default_rng(0)
    moves = []
    for _ in range(REPLICAS):
        again = []
        for run in task.pieces:
            read = run.drive.input_N + run.input_noise_N * rng.standard_normal(len(run.drive.input_N))
            smooth = find_adaptive_low_pass(read, run.step_s).apply(read)
            again.append(replace(run, drive=replace(run.drive, input_N=smooth)))
        other = replace(task, pieces=again, free=()).evaluate(solution.values)
        moves.append(-inverse @ (normal @ (other.values - base.values)))
    shift, scatter = MORE_THAN_ONCE * np.mean(moves, axis=0), np.atleast_2d(np.cov(np.array(moves).T))
    values = {}
    for name, by in zip(task.free, shift, strict=True):
        least = 0.0 if name in (D.ADHESION, D.STATIC_EXCESS, D.VISCOUS) else 0.1 * solution.values[name]
        corrected = solution.values[name] - float(by)
        values[str(name)] = max(corrected, least) if name in POSITIVE else corrected
    doubt = np.outer(shift, shift) * CORRECTION_DOUBT**2
    return replace(solution, values=values, covariance=solution.covariance + scatter * (1 + 1 / REPLICAS) + doubt)


def with_floors(solution: Solution, mean_N: float) -> Solution:
    """Add what the method itself does not resolve.

    Parameters
    ----------
    solution : Solution
    mean_N : float
        Mean output tension.
    """
    floors: Mapping[DynamicParameter, float] = FLOORS
    errors = [
        ADHESION_FLOOR * mean_N if D(n) in (D.ADHESION, D.INPUT_BIAS, D.OUTPUT_BIAS) else floors.get(D(n), 0.0) * abs(v)
        for n, v in solution.values.items()
    ]
    return replace(solution, covariance=solution.covariance + np.diag(np.square(errors)))
