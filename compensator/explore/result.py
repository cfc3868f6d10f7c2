"""What the interactive page shows."""

from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.compensator.compensators.base import FloatArray
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.scenario.sampled.sampling import Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One compensator over time, thinned for the screen.

    Parameters
    ----------
    time_s, force_N, output_N, error_N : ndarray, shape (n,)
    score : Score
        Of all rows.
    """

    time_s: FloatArray
    force_N: FloatArray
    output_N: FloatArray
    error_N: FloatArray
    score: Score


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """One scenario with a few parameters changed.

    Parameters
    ----------
    reference : Reference
    courses : mapping of str to Course
        By name of the compensator.
    notes : tuple of str
        What the reader should know, such as a slack tendon.
    """

    reference: Reference
    courses: Mapping[str, Course]
    notes: tuple[str, ...]
