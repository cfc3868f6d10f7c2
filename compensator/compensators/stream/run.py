"""Choose the filter of a live reference: error against noise in the force, over filters that the lag admits."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem, Profile
from tendonff.compensator.compensators.score import Score, SimulatedPlant, scale_N, score, simulate_profile
from tendonff.compensator.compensators.stream.filter import StreamFilter, corner_per_sample
from tendonff.compensator.compensators.stream.model import StreamDesign, stream_force
from tendonff.compensator.scenario.stream import Stream
from tendonff.ocp.errors import SolveError

NOISE_GOAL_DB = 0.0
"""Noise in the force over that in the reference, above 30 Hz, that a filter should not exceed [dB]."""
_NOISE_FROM_HZ = 30.0
_BITS = 12  # of the converter that is assumed where the scenario states no resolution
_LONGEST = 100  # taps on either side
_SHARES = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1)  # of the delay that is allowed


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One filter, tried on the scenario's reference with the noise of a converter.

    Parameters
    ----------
    design : StreamDesign
    score : Score
        Output tension against the reference, delayed by the stated lag.
    noise_dB : float
        Noise in the force over noise in the reference, both above 30 Hz [dB].
    """

    design: StreamDesign
    score: Score
    noise_dB: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamChoice:
    """Candidates and the one that was picked.

    Parameters
    ----------
    candidates : tuple of Candidate
    picked : Candidate
        The least error of those whose noise is within the goal; else the least noise.
    resolution_N : float
        Step of the converter that the noise was made for [N].
    """

    candidates: tuple[Candidate, ...]
    picked: Candidate
    resolution_N: float


def choose_stream(problem: Problem, stream: Stream, accepted_N: tuple[float, float]) -> StreamChoice | None:
    """Try filters of all lengths that lag or preview admit, and pick one; None where no force can be simulated.

    Parameters
    ----------
    problem : Problem
    stream : Stream
    accepted_N : tuple of float
        References that the exported modules accept [N].
    """
    reference, step = problem.reference, problem.reference.step_s
    ahead = min(round(stream.preview_s / step), 2 * _LONGEST)
    longest = min(ahead or int(stream.lag_max_s / step * (1 + 1e-9)), _LONGEST)
    resolution = stream.resolution_N or scale_N(reference.tension_N) / 2**_BITS
    noisy = quantised(reference.tension_N, resolution)
    corner = corner_per_sample(problem.transmission, step)
    filters = [
        StreamFilter(half=half, is_flat=flat, corner_per_sample=corner, ahead=ahead, step_s=step)
        for half in sorted({round(share * longest) for share in _SHARES} | {0})
        for flat in ((False, True) if half > 1 else (False,))
    ]
    candidates = []
    for each in filters:
        design = StreamDesign(filter=each, band_N=stream.resolution_N, low_N=accepted_N[0], high_N=accepted_N[1])
        with suppress(SolveError):  # a force under which the chain cannot be simulated is none to pick
            candidates.append(_tried(problem, design, noisy))
    if not candidates:
        return None
    quiet = [each for each in candidates if each.noise_dB <= NOISE_GOAL_DB]
    picked = min(quiet, key=lambda c: c.score.rmse_N) if quiet else min(candidates, key=lambda c: c.noise_dB)
    return StreamChoice(candidates=tuple(candidates), picked=picked, resolution_N=resolution)


def quantised(tension_N: FloatArray, resolution_N: float) -> FloatArray:
    """A tension as a converter hands it over: in whole steps, one of them noise [N].

    Parameters
    ----------
    tension_N : ndarray, shape (n,)
    resolution_N : float
        Step of the converter [N].
    """
    noise = np.random.default_rng(0).integers(-1, 2, len(tension_N))
    rough: FloatArray = (np.round(tension_N / resolution_N) + noise) * resolution_N
    return rough


def _tried(problem: Problem, design: StreamDesign, noisy_N: FloatArray) -> Candidate:
    reference = problem.reference
    tension, delay = reference.tension_N, design.filter.delay
    force = stream_force(design, problem, noisy_N)
    clean = stream_force(design, problem, tension)
    plant = SimulatedPlant(level=problem.level)
    once = replace(reference, periodic=False)  # what arrives live starts at rest
    run = simulate_profile(problem.transmission, plant, Profile(force_N=force), once)
    output = run.require().output_tension_N
    wanted = np.concatenate([np.full(delay, tension[0]), tension])[: len(tension)]
    return Candidate(
        design=design,
        score=score(wanted, output),
        noise_dB=_dB(force - clean, reference.step_s) - _dB(noisy_N - tension, reference.step_s),
    )


def _dB(values: FloatArray, step_s: float) -> float:
    """Size of what is above 30 Hz; of all there is where the samples are too slow for that [dB]."""
    spectrum, frequency = np.fft.rfft(values), np.fft.rfftfreq(len(values), step_s)
    kept = frequency >= min(_NOISE_FROM_HZ, 0.25 / step_s)
    return 10 * float(np.log10(np.sum(np.abs(spectrum[kept]) ** 2) + 1e-300))
