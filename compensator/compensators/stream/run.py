"""Choose the filter of a live reference: error against noise in the force, over filters that the lag admits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem, Profile
from tendonff.compensator.compensators.score import Score, SimulatedPlant, scale_N, score, simulate_profile
from tendonff.compensator.compensators.stream.model import (
    Ramp,
    StreamDesign,
    StreamFilter,
    corner_per_sample,
    stream_force,
)
from tendonff.compensator.scenario.settings import Stream
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.errors import SolveError

NOISE_GOAL_DB = 0.0
"""Noise in the force over that in the reference, above 30 Hz, that a filter should not exceed [dB]."""
_NOISE_FROM_HZ = 30.0
_BITS = 12  # of the converter that is assumed where the scenario states no resolution
_LONGEST = 100  # taps on either side
_FURTHEST = 1000  # samples of preview that a rate limit may use
_PARTS = (1.0, 0.8, 0.6, 0.4)  # of the preview that the filter leaves
_OVERSHOOTS = (0.5, 0.0, 0.7)
_SHARES = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1)  # of the delay that is allowed


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One filter, tried on the scenario's reference with the noise of a converter."""

    design: StreamDesign
    score: Score  # output tension against the reference, delayed by the stated lag
    noise_dB: float  # noise in the force over noise in the reference, both above 30 Hz [dB]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamChoice:
    """Candidates and the one that was picked."""

    candidates: tuple[Candidate, ...]
    picked: Candidate  # the least error of those whose noise is within the goal; else the least noise
    resolution_N: float  # step of the converter that the noise was made for [N]


def choose_stream(
    problem: Problem, stream: Stream, accepted_N: tuple[float, float], *, with_ramps: bool = True
) -> StreamChoice | None:
    """Try filters of all lengths that lag or preview admit, and pick one; None where no force can be simulated.

    References are accepted from `accepted_N[0]` to `accepted_N[1]`. With ramps, preview also helps against a rate limit
    that binds.
    """
    step, still = problem.reference.step_s, problem.chain.motion is None  # nobody knows where joints will be
    binds = with_ramps and still and rate_binds(problem)
    ahead = min(round(stream.preview_s / step), _FURTHEST if binds else 2 * _LONGEST)
    longest = min(ahead or int(stream.lag_max_s / step * (1 + 1e-9)), _LONGEST)
    corner = corner_per_sample(problem.transmission, step)
    candidates: list[Candidate] = []

    def attempt(each: StreamFilter, ramp: Ramp | None) -> None:
        low, high = accepted_N
        design = StreamDesign(filter=each, band_N=stream.resolution_N, low_N=low, high_N=high, ramp=ramp)
        candidates.extend(_tried(problem, design))

    for half in sorted({round(share * longest) for share in _SHARES} | {0}):
        for flat in (False, True) if half > 1 else (False,):
            each = StreamFilter(half=half, is_flat=flat, corner_per_sample=corner, ahead=ahead, step_s=step)
            left = ahead - half
            attempt(each, Ramp(samples=left, overshoot=_OVERSHOOTS[0]) if binds and left > 0 else None)
    if not candidates:
        return None
    best = _pick(candidates).design
    if best.ramp is not None:
        left = best.ramp.samples
        for samples in sorted({round(share * left) for share in _PARTS} - {0}):
            for overshoot in _OVERSHOOTS:
                attempt(best.filter, Ramp(samples=samples, overshoot=overshoot))
        attempt(best.filter, None)
    resolution = _resolution_N(problem, stream.resolution_N)
    return StreamChoice(candidates=tuple(candidates), picked=_pick(candidates), resolution_N=resolution)


def over_preview(problem: Problem, design: StreamDesign, previews_s: Sequence[float]) -> tuple[Candidate, ...]:
    """What further preview, longer than the filter [s], would buy with a design where the rate limit binds."""
    best = []
    for preview in previews_s:
        ahead = round(preview / problem.reference.step_s)
        longer, samples = replace(design.filter, ahead=ahead), ahead - design.filter.half
        ramps = (Ramp(samples=samples, overshoot=overshoot) for overshoot in _OVERSHOOTS)
        tried = [found for ramp in ramps for found in _tried(problem, replace(design, filter=longer, ramp=ramp))]
        best += [_pick(tried)] if tried else []
    return tuple(best)


def _pick(candidates: Sequence[Candidate]) -> Candidate:
    """The least error of those that are quiet enough; else the least noise."""
    quiet = [each for each in candidates if each.noise_dB <= NOISE_GOAL_DB]
    return min(quiet, key=lambda c: c.score.rmse_N) if quiet else min(candidates, key=lambda c: c.noise_dB)


def rate_binds(problem: Problem) -> bool:
    """Whether the exact force changes faster than the actuator; of position drives the command is not planned ahead."""
    change = problem.limits.rate_N_per_s * problem.reference.step_s
    fastest = float(np.abs(np.diff(problem.inversion.force_N)).max())
    return problem.transmission.actuator.drive is not Drive.POSITION and fastest > change


def quantised(tension_N: FloatArray, resolution_N: float) -> FloatArray:
    """A tension, shape (n,), as a converter hands it over: in whole steps, one of them noise [N]."""
    noise = np.random.default_rng(0).integers(-1, 2, len(tension_N))
    rough: FloatArray = (np.round(tension_N / resolution_N) + noise) * resolution_N
    return rough


def _resolution_N(problem: Problem, stated_N: float) -> float:
    return stated_N or scale_N(problem.reference.tension_N) / 2**_BITS


def _tried(problem: Problem, design: StreamDesign) -> tuple[Candidate, ...]:
    """The design with the noise of a converter; nothing where the chain cannot be simulated under its force.

    What is handed over ahead ends with the last reference, held.
    """
    reference, ahead, delay = problem.reference, design.filter.ahead, design.filter.delay
    rows = len(reference.tension_N)
    tension = np.pad(reference.tension_N, (0, ahead), mode="edge")
    noisy = quantised(tension, _resolution_N(problem, design.band_N))
    force, clean = (stream_force(design, problem, given) for given in (noisy, tension))
    wanted = np.pad(tension, (delay, 0), mode="edge")[: len(force)]
    time = np.arange(len(force), dtype=np.float64) * reference.step_s
    once = replace(reference, time_s=time, tension_N=wanted, periodic=False, position_m=None)  # starts at rest
    try:
        run = simulate_profile(
            problem.transmission, SimulatedPlant(level=problem.level), Profile(force_N=force), once
        ).require()
    except SolveError:
        return ()
    noise_dB = _dB((force - clean)[:rows], reference.step_s) - _dB((noisy - tension)[:rows], reference.step_s)
    return (Candidate(design=design, score=score(wanted[ahead:], run.output_tension_N[ahead:]), noise_dB=noise_dB),)


def _dB(values: FloatArray, step_s: float) -> float:
    """Size of what is above 30 Hz; of all there is where the samples are too slow for that [dB]."""
    spectrum, frequency = np.fft.rfft(values), np.fft.rfftfreq(len(values), step_s)
    kept = frequency >= min(_NOISE_FROM_HZ, 0.25 / step_s)
    return 10 * float(np.log10(np.sum(np.abs(spectrum[kept]) ** 2) + 1e-300))
