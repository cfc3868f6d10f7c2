"""Measured files: reading, cleaning, units, smoothing."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_ROWS = 10
"""Of a file, of a piece of it, and of a time whose mean counts."""
