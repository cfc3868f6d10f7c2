"""Samples of a command that is held between them, by least squares over a plant.

Each step of a held command moves masses and bristles, and what friction keeps of the overshoot is no linear function of
it. So the samples that a linear drive asks for are improved on the design model: Levenberg's method, with a
simulation for each sample's slope.
"""

from collections.abc import Callable

import numpy as np

from tendonff.models.layout import Array

MOVES = 8
_ENOUGH = 0.05  # relative decrease of the error below which a move ends the search
_DAMPING = (1e-3, 1e-1, 10.0)  # of the mean square slope, tried in turn


def improve_samples(
    respond: Callable[[Array], Array], samples: Array, wanted: Array, nudge: float, moves: int = MOVES
) -> Array:
    """Samples whose response is closer to what is wanted, in the mean square; never further.

    Parameters
    ----------
    respond : callable
        Response, shape (n,), to samples, shape (k,).
    samples : ndarray, shape (k,)
        Where the search starts.
    wanted : ndarray, shape (n,)
    nudge : float
        Change of a sample, in its unit, by which slopes are found.
    moves : int, optional
        At most so many Jacobians, of k simulations each.
    """
    best, output = samples.copy(), respond(samples)
    error = float(np.mean((output - wanted) ** 2))
    for _ in range(moves):
        slopes = np.empty((len(wanted), len(best)))
        for k in range(len(best)):
            trial = best.copy()
            trial[k] += nudge
            slopes[:, k] = (respond(trial) - output) / nudge
        normal, right = slopes.T @ slopes, slopes.T @ (wanted - output)
        scale, before = float(np.trace(normal)) / len(best), error
        for damping in _DAMPING:
            trial = best + np.linalg.solve(normal + damping * scale * np.eye(len(best)), right)
            response = respond(trial)
            square = float(np.mean((response - wanted) ** 2))
            if square < error:
                best, output, error = trial, response, square
                break
        if not error < (1 - _ENOUGH) * before:
            break
    return best
