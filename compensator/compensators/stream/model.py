"""What the stream module makes of a reference, sample by sample: the model of its C."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.compensator.compensators.stream.filter import StreamFilter
from tendonff.compensator.compensators.stream.ramp import Ramp
from tendonff.models.errors import ParameterError
from tendonff.ocp.inverse import invert

RE_ENTRY_S = 0.1
"""Time in which the reference comes back from a held value to one that arrives again [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamDesign:
    """Everything that the stream module is made of."""

    filter: StreamFilter
    band_N: float  # half of the width of the dead band [N]
    # low_N, high_N: range that references are clamped to [N]
    low_N: float
    high_N: float
    # what preview does against a rate limit that binds; its samples are part of those of the preview
    ramp: Ramp | None = None

    def __post_init__(self) -> None:
        if self.ahead > self.filter.delay - self.filter.half:
            raise ParameterError(
                f"samples of the ramp must be at most {self.filter.delay - self.filter.half}, got {self.ahead}; "
                "filter and ramp share the preview"
            )

    @property
    def ahead(self) -> int:
        """Samples by which the inverse runs ahead of what is due."""
        return 0 if self.ramp is None else self.ramp.samples

    @property
    def line(self) -> int:
        """Length of the line of references before the inverse."""
        return self.filter.delay + self.filter.half + 1 - self.ahead

    @property
    def re_entry(self) -> int:
        """Samples of a re-entry."""
        return max(1, round(RE_ENTRY_S / self.filter.step_s))


def smoothed(design: StreamDesign, reference_N: FloatArray, initial_N: float) -> FloatArray:
    """The reference that the inverse receives, ahead of what is due where there is a ramp [N].

    Parameters
    ----------
    reference_N : ndarray, shape (n,)
        What arrives; what is not finite holds the last one [N].
    initial_N : float
        Tension at rest before [N].
    """
    taps = design.filter.taps
    last = centre = min(max(initial_N, design.low_N), design.high_N)
    offset, left, lost = 0.0, 0, False
    line = [centre] * design.line
    found = []
    for given in reference_N.tolist():
        if math.isfinite(given):
            clamped = min(max(given, design.low_N), design.high_N)
            if lost:
                offset, left, lost = last - clamped, design.re_entry, False
            place = left / design.re_entry
            last = clamped + offset * place**3 * (10 + place * (6 * place - 15))
            left = max(left - 1, 0)
        else:
            lost = True
        centre = min(max(centre, last - design.band_N), last + design.band_N)
        line = [*line[1:], centre]
        window = np.array(line[: len(taps)])
        newest = window[-1]
        found.append(float(newest + taps @ (window - newest)))
    return np.array(found)


def stream_force(design: StreamDesign, problem: Problem, reference_N: FloatArray) -> FloatArray:
    """Force of the stream module for a reference that arrives live, from rest at its first sample [N].

    Parameters
    ----------
    problem : Problem
        Model and limits.
    reference_N : ndarray, shape (n,)
    """
    start = float(reference_N[0])
    tension = smoothed(design, reference_N, start)
    step = problem.reference.step_s
    force = invert(problem.chain, tension, step, initial_tension_N=start).force_N
    if design.ramp is None:
        return problem.limits.apply(force, step, start)
    return design.ramp.apply(force, tension, problem.limits, step, start)
