"""Joint angles that no motion explains: an encoder that was stuck, or uncounted missed calls."""

import math

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.models.tendon.chain import Chain

FACTOR = 1.5
"""Of the scenario's greatest joint speed: from rest no joint is taken to move further within a sample."""


def largest_starts_rad(chain: Chain, step_s: float) -> tuple[float, ...]:
    """Largest change of each joint's angle within the sample in which it starts [rad]; infinite of one at rest."""
    if chain.motion is None:
        return ()
    time = np.arange(0.0, float(chain.motion.time_s[-1]) + 0.5 * step_s, step_s)
    greatest = np.abs(np.diff(chain.motion.at(time), axis=0)).max(axis=0, initial=0.0)
    return tuple(FACTOR * float(change) if change > 0 else math.inf for change in greatest)


def has_jump(angle_rad: FloatArray, starts_rad: tuple[float, ...]) -> bool:
    """Whether angles, shape (rows, joints), hold a change beyond that of a start and twice the one before together."""
    change = np.abs(np.diff(angle_rad, axis=0, prepend=angle_rad[:1]))
    return bool(np.any(change[1:] > np.array(starts_rad) + 2 * change[:-1]))
