"""What the interactive page shows."""

from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.compensator.compensators.base import FloatArray
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.scenario.sampled.sampling import Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One compensator over time, thinned for the screen."""

    # time_s, force_N, output_N, error_N: shape (n,)
    time_s: FloatArray
    force_N: FloatArray
    output_N: FloatArray
    error_N: FloatArray
    score: Score  # of all rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """One scenario with a few parameters changed."""

    reference: Reference
    courses: Mapping[str, Course]  # by name of the compensator
    notes: tuple[str, ...]  # what the reader should know, such as a slack tendon
