"""Laws of an observer by least squares: what the fits of angle and torque at a joint share.

One candidate law is one file: it says what it predicts, and what its numbers are called.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tendonff.compensator.identification.answer.estimate import Estimate, is_known
from tendonff.compensator.identification.measured import Array
from tendonff.ocp.fits.least_squares import Residuals, Solution, Unknown, solve
from tendonff.ocp.fits.mechanism import differences

ROW_S = 0.05
"""Distance of the rows that are fitted: the laws are quasi-static."""

BLOCK_S = 2.5
"""Rows this far apart are taken as independent."""

STEP = 1e-4
STARTS = (0.3, 1.0)
"""Exponents from which the searches start."""

MEMORY = ("pull_exponent", "release_exponent", "preload_N_m")
"""Numbers of a law's memory, searched by their logarithms within a factor of 20."""

_FACTOR, _STEPS = 20.0, 30


def solved(
    start: Mapping[str, float],
    errors: Callable[[Mapping[str, float]], Array],
    times_s: Sequence[Array],
    *,
    largest: Mapping[str, float] | None = None,
) -> Solution:
    """Least squares over the numbers of `start`.

    Parameters
    ----------
    start : mapping of str to float
    errors : callable
        Predicted less measured rows of all files at values, in units of their size.
    times_s : sequence of ndarray
        Times of the rows of each file.
    largest : mapping, optional
        Upper bounds.
    """
    names, most = tuple(start), largest or {}
    blocks = np.concatenate([1000 * k + (time / BLOCK_S).astype(int) for k, time in enumerate(times_s)])

    def evaluate(values: Mapping[str, float]) -> Residuals:
        def predict(x: Array) -> Array:
            return errors(dict(zip(names, x.tolist(), strict=True)))

        at = np.array([values[n] for n in names])
        found, slopes = differences(predict, at, [STEP * max(abs(v), 1e-3) for v in at.tolist()])
        return Residuals(values=found, slopes=slopes, blocks=blocks)

    def unknown(name: str) -> Unknown:
        at, memory = start[name], name in MEMORY
        return Unknown(
            name=name,
            start=at,
            low=at / _FACTOR if memory else -np.inf,
            high=min(at * _FACTOR, most.get(name, np.inf)) if memory else np.inf,
            scale=0.3 if memory else max(abs(at), 1e-3),
            logarithmic=memory,
        )

    return solve(evaluate, [unknown(n) for n in names], robust=False, most=_STEPS, tolerance=1e-5)


def estimates_of(solution: Solution, prefix: str, units: Mapping[str, str], why: str) -> tuple[Estimate, ...]:
    """Estimates of a law's numbers, called `prefix` and their name."""
    rows = []
    for name, value in solution.values.items():
        error = solution.standard_error(name)
        known = bool(is_known(error, max(abs(value), 1e-12)))
        rows.append(
            Estimate(
                name=f"{prefix}_{name}",
                value=value,
                standard_error=error if np.isfinite(error) else None,
                interval=solution.interval(name) if np.isfinite(error) else None,
                identifiable=known,
                why=why if known else f"its standard error is {error:.2g} {units[name]}",
                fitted=True,
            )
        )
    return tuple(rows)
