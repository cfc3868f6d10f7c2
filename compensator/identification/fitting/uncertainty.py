"""What adds to the doubt of a fitted chain: other laws, noise on the input, the method itself."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.identification.measured.reading import Array
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Residuals, Solution, block_covariance

D = DynamicParameter

REPLICAS = 8
"""Runs with more noise on the input, for what its noise does to the answer."""

LOUDER = (1.0, 3.0)
"""Added variance of the input's noise, in units of its own."""

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
    """Residuals at the fixed values with slopes over all of `names`; None where the model has no answer.

    Parameters
    ----------
    task : ChainResiduals
    names : sequence of DynamicParameter
    """
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

    The model is driven by a measurement, whose noise is not in the residuals' statistics and is rectified by the play
    of friction. More noise of the same kind is put on the input, one Gauss-Newton step tells where the answer goes, and
    the way back to no noise is extrapolated (simulation extrapolation).

    Parameters
    ----------
    task : ChainResiduals
        On few masses, with the free parameters of `solution`.
    solution : Solution
    """
    noisy = [(run, run.input_noise_N) for run in task.pieces]
    if all(noise <= 0 for _, noise in noisy):
        return solution
    base = task.evaluate(solution.values)
    weight = 1 / np.sqrt(1 + base.values**2)
    normal = (base.slopes * weight[:, None]).T
    inverse = np.linalg.pinv(normal @ base.slopes, hermitian=True, rcond=1e-14)
    rng = np.random.default_rng(0)
    moves: dict[float, list[Array]] = {level: [] for level in LOUDER}
    for _ in range(REPLICAS):
        extra = [
            run.piece.input_filter.apply(noise * rng.standard_normal(len(run.drive.input_N))) for run, noise in noisy
        ]
        for level in LOUDER:
            shaken = [
                replace(run, drive=replace(run.drive, input_N=run.drive.input_N + np.sqrt(level) * more))
                for (run, _), more in zip(noisy, extra, strict=True)
            ]
            other = replace(task, pieces=shaken, free=()).evaluate(solution.values)
            moves[level].append(-inverse @ (normal @ (other.values - base.values)))
    # What noise of variance 1 + level does is a (1 + level)^(1/2) + b (1 + level): rectified, and averaged.
    shapes = np.array([[np.sqrt(1 + level) - 1, level] for level in LOUDER])
    means = np.array([np.mean(moves[level], axis=0) for level in LOUDER])
    shift = np.linalg.solve(shapes, means).sum(axis=0)
    once = means[0]
    # Between what one dose of noise did and two and a half of it, the ratio for pure rectification.
    shift = np.where(once >= 0, np.clip(shift, once, 2.5 * once), np.clip(shift, 2.5 * once, once))
    scatter = np.atleast_2d(np.cov(np.array(moves[LOUDER[0]]).T))
    values = {}
    for name, by in zip(task.free, shift, strict=True):
        least = 0.0 if name in (D.ADHESION, D.STATIC_EXCESS, D.VISCOUS) else 0.1 * solution.values[name]
        corrected = solution.values[name] - float(by)
        values[str(name)] = max(corrected, least) if name in POSITIVE else corrected
    doubt = np.outer(shift, shift) / 4
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
