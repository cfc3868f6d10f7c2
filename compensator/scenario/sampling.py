"""The desired tension at the far end, sampled on the grid of the run."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import assert_never

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.scenario.reference import CsvReference, Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters import Transmission

_ORDER = 2  # of the Butterworth filter, run forwards and backwards: -6 dB at the cut-off, 24 dB per octave above
_MAX_STEPS = 50_000_000
_MANY_TURNS_RAD = 20.0
_TRIAL_CUTOFFS_HZ = (100.0, 50.0, 20.0, 10.0, 5.0)
_MOST_NOISE = 0.05  # of the range; a larger share is signal
_GAP_ROWS, _LOGGED_ROWS = 10, 100  # a logged trace, not one written by hand, whose interval is so many usual ones


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Samples of the reference tension.

    Parameters
    ----------
    time_s : ndarray, shape (n + 1,)
        k step_s for k = 0 .. n [s].
    tension_N : ndarray, shape (n + 1,)
        Reference tension [N], > 0.
    step_s : float
        Time step [s].
    initial_tension_N : float
        Uniform tension at rest before the start [N].
    removed_noise_N : float
        Root mean square of what the low-pass took away [N]; 0 without one.
    warnings : tuple of str
        What the user should know.
    """

    time_s: FloatArray
    tension_N: FloatArray
    step_s: float
    initial_tension_N: float
    removed_noise_N: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def range_N(self) -> float:
        """Largest minus smallest reference tension [N]: what percentages refer to."""
        return float(np.ptp(self.tension_N))


def sample_reference(scenario: Scenario, *, strict: bool = True) -> Reference:
    """Sample the reference of a scenario and check that the transmission can deliver it.

    Parameters
    ----------
    scenario : Scenario
    strict : bool, optional
        Refuse a reference out of reach; otherwise it is a warning.

    Raises
    ------
    InputError
        The reference reaches 0 or below, or, strictly, above the largest tension that force_max_N delivers through
        the friction.
    """
    spec = scenario.reference
    time, tension, initial, removed, notes = _sample(scenario)
    beyond = _check_deliverable(scenario.transmission, time, tension, scenario.source.name)
    if beyond and strict:
        raise InputError(beyond)
    notes += [beyond] if beyond else []
    if removed > 0 and isinstance(spec, CsvReference):
        notes.append(
            f"{spec.file}: the low-pass at {spec.cutoff_Hz:g} Hz removed {removed:.3g} N rms "
            f"({100 * removed / max(float(np.ptp(tension)), 1e-300):.2g} % of range)"
        )
    if abs(initial - tension[0]) > 1e-3 * max(float(np.ptp(tension)), 1e-9):
        notes.append(
            f"the reference starts at {tension[0]:.4g} N but initial_tension_N is {initial:.4g} N: it jumps at t = 0"
        )
    return Reference(
        time_s=time,
        tension_N=tension,
        step_s=scenario.run.step_s,
        initial_tension_N=initial,
        removed_noise_N=removed,
        warnings=tuple(notes),
    )


def initial_tension(scenario: Scenario) -> float:
    """Uniform tension at rest before the start [N], without checking the rest of the reference.

    Parameters
    ----------
    scenario : Scenario
    """
    given = scenario.reference.initial_tension_N
    return given if given is not None else _sample(scenario)[2]


def _sample(scenario: Scenario) -> tuple[FloatArray, FloatArray, float, float, list[str]]:
    """Times, tensions, initial tension, the rms of what a filter removed, and what the user should know of a file."""
    spec, step, file = scenario.reference, scenario.run.step_s, scenario.source.name
    removed, notes = 0.0, list[str]()
    match spec:
        case SineReference():
            time = _grid(spec.duration_s, step, file)
            highest = max(spec.frequencies_Hz)
            if not highest * step < 0.5:  # sampled, it would be another sine, slower than the one asked for
                raise InputError(
                    f"{file} [reference]: frequencies_Hz must be < {0.5 / step:g} (half the rate of "
                    f"step_s = {step:g}), "
                    f"got {highest:g}; use a step of {0.02 / highest:.2g} s or less"
                )
            tension = _sine(spec, time)
        case WaypointReference():
            time = _grid(spec.times_s[-1], step, file)
            tension = _waypoints(spec, time)
        case CsvReference():
            time, tension, removed, notes = _csv(spec, scenario.source.parent / spec.file, step, file)
        case _:
            assert_never(spec)
    # The first sample of the filtered course, where there is a filter: the run then starts without a jump.
    initial = float(tension[0]) if spec.initial_tension_N is None else spec.initial_tension_N
    return time, tension, initial, removed, notes


def _grid(duration_s: float, step_s: float, file: str) -> FloatArray:
    """Times k step_s up to the duration (a duration that is a multiple of the step up to rounding is included)."""
    steps = math.floor(min(duration_s / step_s * (1 + 1e-9), _MAX_STEPS + 1.0))
    if steps < 1:
        raise InputError(
            f"{file} [run]: step_s must be <= the length of the reference, {duration_s:g} s, got {step_s:g}; "
            "use a thousandth of it or less"
        )
    if steps > _MAX_STEPS:
        raise InputError(
            f"{file} [run]: step_s = {step_s:g} makes more than {_MAX_STEPS} steps of the {duration_s:g} s long "
            "reference; use a larger step"
        )
    time: FloatArray = np.arange(steps + 1, dtype=np.float64) * step_s
    return time


def _sine(spec: SineReference, time: FloatArray) -> FloatArray:
    fade = np.minimum(time / spec.fade_in_s, 1.0) if spec.fade_in_s > 0 else np.ones_like(time)
    waves = np.zeros_like(time)
    for amplitude, frequency in zip(spec.amplitudes_N, spec.frequencies_Hz, strict=True):
        waves += amplitude * np.sin(2 * np.pi * frequency * time)
    result: FloatArray = spec.initial_tension_N + fade * waves
    return result


def _waypoints(spec: WaypointReference, time: FloatArray) -> FloatArray:
    times, tensions = np.array(spec.times_s), np.array(spec.tensions_N)
    if spec.shape is Shape.LINEAR:
        straight: FloatArray = np.interp(time, times, tensions)
        return straight
    # 10 u^3 - 15 u^4 + 6 u^5 is the lowest polynomial with zero velocity and acceleration at both ends: the pieces
    # join with two continuous derivatives, and each is monotone, so no piece leaves the range of its two waypoints.
    piece = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    u = np.clip((time - times[piece]) / (times[piece + 1] - times[piece]), 0.0, 1.0)
    result: FloatArray = tensions[piece] + (tensions[piece + 1] - tensions[piece]) * u**3 * (10 - 15 * u + 6 * u * u)
    return result


def _gaps(time: FloatArray, name: str) -> list[str]:
    """What is missing of a logged trace, and what stands in for it."""
    intervals = np.diff(time)
    usual = float(np.median(intervals))
    wide = np.flatnonzero(intervals > _GAP_ROWS * usual)
    if len(time) < _LOGGED_ROWS or not len(wide):
        return []
    longest = int(wide[np.argmax(intervals[wide])])
    message = (
        f"{name}: {len(wide)} {'gap' if len(wide) == 1 else 'gaps'} in rows that are {usual:.3g} s apart, the longest "
        f"from {time[longest]:.4g} to {time[longest + 1]:.4g} s; a straight line bridges it"
    )
    return [message]


def _csv(spec: CsvReference, path: Path, step: float, file: str) -> tuple[FloatArray, FloatArray, float, list[str]]:
    """Samples on the grid of the run, the rms of what the filter removed, and what the user should know."""
    data = read_csv(path, ("time_s", "tension_N"), starts_at_zero=True)
    measured_time, measured = data["time_s"], data["tension_N"]
    if len(measured) < 2:
        raise InputError(f"{path.name} has {len(measured)} row; a reference needs at least two")
    time = _grid(float(measured_time[-1]), step, file)
    raw, notes = np.interp(time, measured_time, measured), _gaps(measured_time, path.name)
    if spec.cutoff_Hz is None:
        return time, raw, 0.0, notes
    # Filtered on a grid at least as fine as the samples, so that nothing above the run's rate folds down.
    finer = max(1, min(math.ceil(step / float(np.median(np.diff(measured_time))) - 1e-9), 1000))
    fine_time = np.arange((len(time) - 1) * finer + 1) * (step / finer)
    rate = finer / step
    if not spec.cutoff_Hz < rate / 2:
        raise InputError(
            f"{file} [reference]: cutoff_Hz must be < {rate / 2:g} (half the sampling rate), got {spec.cutoff_Hz:g}; "
            "leave it out to take the samples as they are"
        )
    fine = np.interp(fine_time, measured_time, measured)
    filtered = low_pass(fine, spec.cutoff_Hz, rate)
    return time, filtered[::finer], float(np.sqrt(np.mean((fine - filtered) ** 2))), notes


def low_pass(values: FloatArray, cutoff_Hz: float, rate_Hz: float) -> FloatArray:
    """Zero-phase low-pass: Butterworth of second order, forwards and backwards.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Evenly spaced samples.
    cutoff_Hz, rate_Hz : float
        Corner frequency (-6 dB) and sampling rate [Hz].

    Returns
    -------
    ndarray, shape (n,)
    """
    from scipy import signal  # costs a second to import, and most references need none of it

    sections = signal.butter(_ORDER, cutoff_Hz, fs=rate_Hz, output="sos")
    # Both ends are continued by point reflection, for longer than the filter remembers.
    pad = min(len(values) - 1, math.ceil(3 * rate_Hz / cutoff_Hz))
    result: FloatArray = signal.sosfiltfilt(sections, values, padtype="odd", padlen=pad)
    return result


def largest_tension(transmission: Transmission) -> float:
    """Largest output tension that force_max_N reaches by slow pulling [N].

    Parameters
    ----------
    transmission : Transmission
    """
    from tendonff.models.capstan import CapstanLaw

    return CapstanLaw.of(transmission).largest_output_N(transmission.actuator.force_max_N)


def _check_deliverable(transmission: Transmission, time: FloatArray, tension: FloatArray, file: str) -> str:
    """What keeps the reference out of reach; empty where it can be delivered."""
    lowest, highest = int(np.argmin(tension)), int(np.argmax(tension))
    if not tension[lowest] > 0:
        raise InputError(
            f"{file} [reference]: the tension must stay above 0, got {tension[lowest]:.4g} N at "
            f"t = {time[lowest]:g} s; a tendon cannot push: raise the reference, or make it swing less"
        )
    reachable = largest_tension(transmission)
    if tension[highest] <= reachable:
        return ""
    angle = transmission.path.total_angle_rad
    degrees = f" (total_angle_rad = {angle:g} is {angle / (2 * math.pi):.3g} turns: degrees?)"
    return (
        f"{file} [reference]: the tension reaches {tension[highest]:.4g} N at t = {time[highest]:g} s, but "
        f"force_max_N = {transmission.actuator.force_max_N:g} delivers at most {reachable:.4g} N through the "
        f"friction; lower the reference or raise force_max_N{degrees if angle > _MANY_TURNS_RAD else ''}"
    )


# --- noise -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseAdvice:
    """What to do about a noisy reference.

    Parameters
    ----------
    cutoff_Hz : float
        Proposed corner frequency [Hz].
    noise_N : float
        Noise of the samples, root mean square [N].
    force_noise_N : float
        What that noise makes of the force, root mean square [N].
    message : str
        The warning for the user.
    """

    cutoff_Hz: float
    noise_N: float
    force_noise_N: float
    message: str


def noise_advice(
    reference: Reference, force_of: Callable[[FloatArray], FloatArray], *, file: str = "reference", share: float = 0.05
) -> NoiseAdvice | None:
    """Propose a cut-off where noise in the reference would dominate the force.

    The inverse differentiates its reference twice and reverses the friction with every change of direction, so noise
    that is hard to see in the tension can rule the force. The samples are compared with themselves after the gentlest
    low-pass that removes the noise; both go through the inverse.

    Parameters
    ----------
    reference : Reference
        Samples as they were taken.
    force_of : callable
        The inverse: reference tension [N], shape (n + 1,), to force [N], shape (n + 1,).
    file : str
        Name for the message.
    share : float
        How much of the force's range the noise may make up before it is worth a warning [-].

    Returns
    -------
    NoiseAdvice or None
        None when the noise does not matter.
    """
    tension, rate = reference.tension_N, 1 / reference.step_s
    found = _cutoff_at_the_noise_floor(tension, rate)
    # Noise that was logged slowly and interpolated has no floor: then the gentlest of a few filters that matters.
    for cutoff in (found,) if found is not None else [f for f in _TRIAL_CUTOFFS_HZ if f < rate / 4]:
        smooth = low_pass(tension, cutoff, rate)
        if not (smooth > 0).all():
            return None  # the filter's own overshoot would be judged, not the noise
        quiet = force_of(smooth)
        force_noise = float(np.sqrt(np.mean((force_of(tension) - quiet) ** 2)))
        # Percentiles: a jump at the start makes one huge force that says nothing of the rest.
        spread = float(np.subtract(*np.percentile(quiet, (99, 1))))
        if force_noise > share * spread:
            break
    else:
        return None
    noise = float(np.sqrt(np.mean((tension - smooth) ** 2)))
    if noise > _MOST_NOISE * float(np.ptp(tension)):
        return None  # what the filter removes is the reference itself
    message = (
        f"{file}: noise of {noise:.2g} N rms in the samples becomes {force_noise:.3g} N rms in the force "
        f"({100 * force_noise / max(spread, 1e-300):.0f} % of its range); "
        f"set cutoff_Hz = {cutoff:.2g} in [reference] to filter it"
    )
    return NoiseAdvice(cutoff_Hz=float(f"{cutoff:.2g}"), noise_N=noise, force_noise_N=force_noise, message=message)


def _cutoff_at_the_noise_floor(tension: FloatArray, rate: float) -> float | None:
    """Frequency where the spectrum of the samples flattens out into noise [Hz]; None when there is no floor above 0.

    The floor is the median power of the upper third of the spectrum below the rate at which the samples really vary;
    the cut-off is where the smoothed spectrum last stands ten times above it.
    """
    from scipy import signal

    if len(tension) < 64:
        return None
    frequency, power = signal.welch(np.asarray(tension), fs=rate, nperseg=min(len(tension), 4096), detrend="linear")
    frequency, power = frequency[1:], power[1:]
    # A trace logged slower than the run and interpolated carries no noise near the top: look below the fall.
    running = np.maximum.accumulate(power[::-1])[::-1]
    total = float(np.sum(power))
    carrying = np.nonzero(running > 1e-9 * total)[0]
    if len(carrying) < 16:
        return None
    top = carrying[-1] + 1
    floor = float(np.median(power[top // 2 : top]))
    above = np.nonzero(signal.medfilt(power[:top], 5) > 10 * floor)[0]
    last = above[-1] if len(above) else 0
    cutoff = 1.5 * float(frequency[last])
    return cutoff if cutoff < 0.8 * float(frequency[top - 1]) else None
