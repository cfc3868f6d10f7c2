"""References that arrive live: the filter before the exact inverse, preview against a rate limit, and their choice.

The functions that give forces are the model of the exported C.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.compensators.score import Score, scale_of, score
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.scenario.settings import Stream
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tracking.limits import ForceLimits

NOISE_GOAL_DB = 0.0  # noise in the force over that in the reference, above 30 Hz, that a filter should not exceed [dB]

_NOISE_FROM_HZ = 30.0
_BITS = 12  # of the converter that is assumed where the scenario states no resolution
_LONGEST = 100  # taps on either side
_FURTHEST = 1000  # samples of preview that a rate limit may use
_PARTS = (1.0, 0.8, 0.6, 0.4)  # of the preview that the filter leaves
_OVERSHOOTS = (0.5, 0.0, 0.7)
_SHARES = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1)  # of the delay that is allowed
_FREQUENCIES = 1024  # at which a filter's noise is weighed


@dataclass(frozen=True, kw_only=True)  # without slots: the taps are computed once
class StreamFilter:
    """A symmetric filter, whose lag is the same for all frequencies, and the samples of the reference handed over
    ahead.

    Of all symmetric filters of a length that pass a constant (and, on request, a parabola) unchanged, the one that
    passes the least noise to the force: white noise in the reference reaches the force through the inertia of the
    moving masses, with the gain 1 + (w/w_m)^2, w_m^2 = 1/(m (1/k_load + 1/k_1)).

    Attributes
    ----------
    half : int
        Taps on either side of the middle: the delay in samples.
    is_flat : bool
        Parabolas pass unchanged too: less error, more noise.
    corner_per_sample : float
        w_m h: above this the force follows the second derivative of the reference [-].
    ahead : int
        Samples of preview, >= half; 0 where there is none.
    step_s : float
        h [s].
    """

    half: int
    is_flat: bool
    corner_per_sample: float
    ahead: int
    step_s: float

    @property
    def delay(self) -> int:
        """Samples between a reference and its effect."""
        return max(self.half, self.ahead)

    @property
    def lag_s(self) -> float:
        """Lag of the output behind what was passed; negative: what was passed is ahead by so much [s]."""
        return (-self.ahead if self.ahead else self.half) * self.step_s

    @cached_property
    def taps(self) -> FloatArray:
        """Weights, shape (2 half + 1,), sum 1."""
        if self.half == 0:
            return np.ones(1)
        place = np.arange(-self.half, self.half + 1, dtype=np.float64)
        angle = (np.arange(_FREQUENCIES) + 0.5) * math.pi / _FREQUENCIES
        gain = 1 + (angle / self.corner_per_sample) ** 2
        waves = np.cos(np.outer(angle, place)) * gain[:, None]
        cost = waves.T @ waves
        sines = np.sin(np.outer(angle, place)) * gain[:, None]
        cost += sines.T @ sines
        moments = [np.ones_like(place)]
        if self.is_flat and self.half > 1:
            moments.append((place / self.half) ** 2)
        rows = np.array(moments)
        wanted = np.zeros(len(rows))
        wanted[0] = 1.0
        solved = np.linalg.solve(cost, rows.T)
        taps = solved @ np.linalg.solve(rows @ solved, wanted)
        taps = 0.5 * (taps + taps[::-1])
        symmetric: FloatArray = taps / taps.sum()
        return symmetric


def corner_per_sample(transmission: Transmission, step_s: float) -> float:
    """Frequency above which inertia decides the force, times the step [-]."""
    t = transmission
    mass = t.actuator.mass_kg + t.tendon.mass_kg + t.load.mass_kg
    compliance = 1 / t.load.stiffness_N_per_m + 1 / t.tendon.stiffness_N_per_m
    return step_s / math.sqrt(max(mass * compliance, (1e-3 * step_s) ** 2))


SLACK = 1 / 16  # part of the largest change a sample by which a ramp under way may be early: rounding must not end it


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """Preview against a rate limit: how far ahead the inverse runs, and what is made of it.

    At a reversal the exact force changes faster than the actuator can, and the output does not move until the force has
    arrived. With preview the inverse runs ahead of the time that its forces are due at, so that what cannot be reached
    in time is seen. The force then leaves its course at once, at the largest rate, and the output rests before
    the reference turns as well as after. Before that the force goes beyond its course for a moment, so that the output
    rests between the level that it set out from and the one at which the reference reverses.

    Attributes
    ----------
    samples : int
        Between the newest force of the inverse and the one that is due, >= 1.
    overshoot : float
        Place of the output on the way from the level that the force sets out from (0) to the turn (1) [-].
    """

    samples: int
    overshoot: float

    def apply(
        self, force_N: FloatArray, tension_N: FloatArray, limits: ForceLimits, step_s: float, start_N: float
    ) -> FloatArray:
        """Force within the limits, late by `samples`, from exact force and the tension that it gives, shape (n,) [N].

        `start_N` is the tension at rest before.
        """
        change = limits.rate_N_per_s * step_s
        now = limits.start(start_N)
        before = np.full(self.samples, start_N)
        forces = np.concatenate([np.full(self.samples, now), np.clip(force_N, limits.minimum_N, limits.maximum_N)])
        tensions = np.concatenate([before, tension_N])
        reach = change * np.arange(1, self.samples + 2)
        side, level, lifting = 0.0, 0.0, False
        found = []

        def out_of_reach(direction: float, slack_N: float) -> int:
            """Samples until the first force that cannot be reached in time; 0 for none."""
            missed = direction * (coming - now) > reach - slack_N
            return int(np.argmax(missed)) + 1 if missed.any() else 0

        for k in range(len(force_N)):
            coming, wanted = forces[k : k + self.samples + 1], tensions[k : k + self.samples + 1]
            due, tension = float(coming[0]), float(wanted[0])
            if side and not out_of_reach(side, SLACK * change):
                side = 0.0
            if not side:
                down, up = out_of_reach(-1.0, 0.0), out_of_reach(1.0, 0.0)
                if down or up:
                    side = -1.0 if down and (not up or down < up) else 1.0
                    rest = float(np.max(-side * (wanted[: down if side < 0 else up] - tension)))
                    level, lifting = tension - side * self.overshoot * rest, rest > 0
            asked = due
            if side:
                beyond = -side * (level - tension) > 0 and -side * (due * (level / tension) - now) > 0
                lifting = lifting and beyond
                asked = now + (-side if lifting else side) * change
            now = min(max(asked, limits.minimum_N, now - change), limits.maximum_N, now + change)
            found.append(now)
        return np.array(found)


RE_ENTRY_S = 0.1  # longest time in which the reference comes back from a held value to one that arrives again [s]
_MARGIN = 0.25  # of the scenario's range, by which live references may leave it
RE_ENTRY_SHARE = 2  # samples of the way back for each that was lost: a single lost one costs next to nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamDesign:
    """Everything that the stream module is made of.

    Attributes
    ----------
    filter : StreamFilter
        Of the reference.
    band_N : float
        Half of the width of the deadband [N].
    low_N, high_N : float
        Range that references are clamped to [N].
    ramp : Ramp or None
        Preview against a rate limit that binds; filter and ramp share the samples of the preview.
    """

    filter: StreamFilter
    band_N: float
    low_N: float
    high_N: float
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
        """Samples of the longest re-entry."""
        return max(1, round(RE_ENTRY_S / self.filter.step_s))


def smoothed(design: StreamDesign, reference_N: FloatArray, initial_N: float) -> FloatArray:
    """The reference that the inverse receives, ahead of what is due where there is a ramp, shape (n,) [N].

    What arrives and is not finite holds the last one; `initial_N` is the tension at rest before.
    """
    taps = design.filter.taps
    start = min(max(initial_N, design.low_N), design.high_N)
    if np.isfinite(reference_N).all():
        arrived = np.clip(reference_N, design.low_N, design.high_N)
    else:
        arrived = _held(design, reference_N, start)
    if design.band_N:
        arrived = _in_band(arrived, start, design.band_N)
    line = np.concatenate([np.full(design.line, start), arrived])
    windows = np.lib.stride_tricks.sliding_window_view(line, len(taps))[1 : len(reference_N) + 1]
    newest = windows[:, -1]
    found: FloatArray = newest + (windows - newest[:, None]) @ taps
    return found


def _held(design: StreamDesign, reference_N: FloatArray, start_N: float) -> FloatArray:
    """References as they arrive, clamped; what is lost holds the last one, and the way back is smooth [N]."""
    last = held = start_N
    left, span, lost = 0, design.re_entry, 0
    found = []
    for given in reference_N.tolist():
        if math.isfinite(given):
            clamped = min(max(given, design.low_N), design.high_N)
            if lost:
                span = min(max(RE_ENTRY_SHARE * lost, left), design.re_entry)
                held, left, lost = last, span, 0
            place = left / span
            last = held + (clamped - held) * (1 - place**3 * (10 + place * (6 * place - 15))) if left else clamped
            left = max(left - 1, 0)
        else:
            lost = min(lost + 1, design.re_entry)
        found.append(last)
    return np.array(found)


def _in_band(tension_N: FloatArray, start_N: float, band_N: float) -> FloatArray:
    """Centre of a deadband that the tension, shape (n,), drags along [N]."""
    centre, found = start_N, []
    for now in tension_N.tolist():
        centre = min(max(centre, now - band_N), now + band_N)
        found.append(centre)
    return np.array(found)


def stream_force(design: StreamDesign, problem: Problem, reference_N: FloatArray) -> FloatArray:
    """Force of the stream module for a reference, shape (n,), that arrives live, from rest at its first sample [N]."""
    start = float(reference_N[0])
    tension = smoothed(design, reference_N, start)
    step = problem.reference.step_s
    force = invert(problem.chain, tension, step, initial_tension_N=start).force_N
    if design.ramp is None:
        return problem.limits.apply(force, step, start)
    return design.ramp.apply(force, tension, problem.limits, step, start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """Filter and its errors on the scenario's reference with the noise of a converter.

    Attributes
    ----------
    design : StreamDesign
        With that filter.
    score : Score
        Of what is delivered against the reference, delayed by the stated lag.
    noise_dB : float
        Noise in the force over noise in the reference, both above 30 Hz [dB].
    """

    design: StreamDesign
    score: Score
    noise_dB: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamChoice:
    """Candidates and the one that was picked.

    Attributes
    ----------
    candidates : tuple of Candidate
        All that lag and preview admit.
    picked : Candidate
        The least error of those whose noise is within the goal; else the least noise.
    resolution_N : float
        Step of the converter that the noise was made for [N].
    """

    candidates: tuple[Candidate, ...]
    picked: Candidate
    resolution_N: float


def followed_range(problem: Problem) -> tuple[float, float]:
    """References that a live module follows by default: those of the scenario and a margin [N].

    A sensor or a bus that reads full scale must not be followed where the scenario never goes, unless it states so.
    """
    low, high = accepted_range(problem)
    if problem.reference.live_N is not None:
        return low, high
    tension = problem.reference.tension_N
    least, most = float(np.min(tension)), float(np.max(tension))
    margin = _MARGIN * max(most - least, _MARGIN * most)
    return max(low, least - margin), min(high, most + margin)


@in_turn
def choose_stream(problem: Problem, stream: Stream, *, with_ramps: bool = True) -> StreamChoice | None:
    """Try filters of all lengths that lag or preview admit, and pick one; None where no force can be simulated.

    With ramps, preview also helps against a rate limit that binds.
    """
    step, still = problem.reference.step_s, problem.chain.motion is None  # future joint angles are unknown
    binds = with_ramps and still and rate_binds(problem)
    ahead = min(round(stream.preview_s / step), _FURTHEST if binds else 2 * _LONGEST)
    longest = min(ahead or int(stream.lag_max_s / step * (1 + 1e-9)), _LONGEST)
    corner = corner_per_sample(problem.transmission, step)
    low, high = followed_range(problem)
    candidates: list[Candidate] = []

    def attempt(each: StreamFilter, ramp: Ramp | None) -> None:
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
    """Gain from preview longer than the filter [s] where the rate limit binds."""
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
    return min(quiet, key=lambda c: c.score.rmse) if quiet else min(candidates, key=lambda c: c.noise_dB)


def rate_binds(problem: Problem) -> bool:
    """Whether the exact force changes faster than the actuator; of position drives the command is not planned ahead."""
    change = problem.limits.rate_N_per_s * problem.reference.step_s
    fastest = float(np.abs(np.diff(problem.inversion.force_N)).max())
    return problem.transmission.actuator.drive is not Drive.POSITION and fastest > change


def quantised(tension_N: FloatArray, resolution_N: float) -> FloatArray:
    """A tension, shape (n,), as a converter hands it over: in whole steps, one of them noise [N]."""
    noise = np.random.default_rng(0).integers(-1, 2, len(tension_N))
    return (np.round(tension_N / resolution_N) + noise) * resolution_N


def _resolution_N(problem: Problem, stated_N: float) -> float:
    return stated_N or scale_of(problem.reference.tension_N) / 2**_BITS


def _tried(problem: Problem, design: StreamDesign) -> tuple[Candidate, ...]:
    """The design on the design model; nothing where that cannot be simulated under its force."""
    found = stream_candidate(problem, design, Plant(problem.transmission, problem.level))
    return () if found is None else (found,)


def stream_candidate(problem: Problem, design: StreamDesign, plant: Plant) -> Candidate | None:
    """A design with the noise of a converter, on a plant; None where that cannot be simulated under it.

    What is handed over ahead ends with the last reference, held.
    """
    reference, ahead, delay = problem.reference, design.filter.ahead, design.filter.delay
    rows = len(reference.tension_N)
    tension = np.pad(reference.tension_N, (0, ahead), mode="edge")
    noisy = quantised(tension, _resolution_N(problem, design.band_N))
    force, clean = (stream_force(design, problem, given) for given in (noisy, tension))

    def delayed(values: FloatArray) -> FloatArray:
        return np.pad(values, (delay, 0), mode="edge")[: len(force)]

    time = np.arange(len(force), dtype=np.float64) * reference.step_s
    position = None if reference.position_m is None else delayed(np.pad(reference.position_m, (0, ahead), mode="edge"))
    once = replace(reference, time_s=time, tension_N=delayed(tension), periodic=False, position_m=position)  # from rest
    profile = Profile(force_N=force)
    try:
        if plant.transmission.actuator.drive is Drive.POSITION:
            profile = with_motion(replace(problem, reference=once), "stream", profile)
        output = plant.respond(profile, once).require().delivered(once)
    except SolveError:
        return None
    noise_dB = _dB((force - clean)[:rows], reference.step_s) - _dB((noisy - tension)[:rows], reference.step_s)
    return Candidate(design=design, score=score(once.wanted[ahead:], output[ahead:]), noise_dB=noise_dB)


def _dB(values: FloatArray, step_s: float) -> float:
    """Size of what is above 30 Hz; of all there is where the samples are too slow for that [dB]."""
    spectrum, frequency = np.fft.rfft(values), np.fft.rfftfreq(len(values), step_s)
    kept = frequency >= min(_NOISE_FROM_HZ, 0.25 / step_s)
    return 10 * float(np.log10(np.sum(np.abs(spectrum[kept]) ** 2) + 1e-300))
