"""One-sided bounds whose derivative costs one comparison."""

import casadi as ca
import numpy as np


def at_least(x: ca.SX, floor: float) -> ca.SX:
    """max(x, floor); its slope is 1 above the floor and 0 at and below it.

    `ca.fmax` has the mean of both slopes at equality, which costs two comparisons and a division wherever it is
    differentiated.

    Parameters
    ----------
    x : ca.SX or ndarray
    floor : float
    """
    if isinstance(x, np.ndarray):
        return np.where(x > floor, x, floor)
    return ca.if_else(x > floor, x, floor)
