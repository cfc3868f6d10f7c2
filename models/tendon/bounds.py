"""Bounds on symbols: one-sided with a derivative that costs one comparison, and the play operator."""

import casadi as ca
import numpy as np


def at_least(x: ca.SX, floor: float) -> ca.SX:
    """max(x, floor); its slope is 1 above the floor and 0 at and below it.

    `ca.fmax` has the mean of both slopes at equality, which costs two comparisons and a division wherever it is
    differentiated.
    """
    if isinstance(x, np.ndarray):
        return np.where(x > floor, x, floor)
    return ca.if_else(x > floor, x, floor)


def play(memory: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    """Update of the play operator: keep the memory unless a bound set by the present input pushes it, low <= high.

    `models.capstan` has the same for whole histories of numbers.
    """
    return ca.fmin(ca.fmax(memory, low), high)
