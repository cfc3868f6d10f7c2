"""The tension wanted at the far end, sampled on the grid of the run."""

import math
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.from_file import read_samples, resample
from tendonff.compensator.scenario.plausibility import questions
from tendonff.compensator.scenario.reference import CsvReference, Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters import Transmission

_MAX_STEPS = 50_000_000
_LONG_RUN = 200_000
_MANY_TURNS_RAD = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Samples of the wanted tension.

    Parameters
    ----------
    time_s : ndarray, shape (n + 1,)
        k step_s for k = 0 .. n [s].
    tension_N : ndarray, shape (n + 1,)
        Wanted tension [N], > 0.
    step_s : float
        Time step [s].
    initial_tension_N : float
        Uniform tension at rest before the start [N].
    removed_noise_N : float
        Root mean square of what the low-pass took away [N]; 0 without one.
    sample_interval_s : float
        Usual time between the samples of a file [s]; 0 for the other kinds.
    warnings : tuple of str
        What the user should know.
    """

    time_s: FloatArray
    tension_N: FloatArray
    step_s: float
    initial_tension_N: float
    removed_noise_N: float = 0.0
    sample_interval_s: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def range_N(self) -> float:
        """Largest minus smallest wanted tension [N]: what percentages refer to."""
        return float(np.ptp(self.tension_N))


def sample_reference(scenario: Scenario) -> Reference:
    """Sample the reference of a scenario and check that the transmission can deliver it.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    InputError
        The reference reaches 0 or below, or above the largest tension that force_max_N delivers through the friction.
    """
    spec = scenario.reference
    time, tension, initial, removed, interval, notes = _sample(scenario)
    _check_deliverable(scenario.transmission, time, tension, scenario.source.name)
    notes += questions(scenario.transmission)
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
        sample_interval_s=interval,
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


def work_ahead(scenario: Scenario) -> str | None:
    """What to say before a long run starts; None for an ordinary one.

    Parameters
    ----------
    scenario : Scenario
    """
    step, spec = scenario.run.step_s, scenario.reference
    match spec:
        case SineReference():
            duration = spec.duration_s
        case WaypointReference():
            duration = spec.times_s[-1]
        case CsvReference():
            duration = float(read_samples(spec, scenario.source.parent / spec.file, step).time_s[-1])
        case _:
            assert_never(spec)
    if not duration > _LONG_RUN * step:
        return None
    return (
        f"{duration:g} s in steps of {step:g} s are {duration / step:.0f} steps, which takes long: is the length in "
        "seconds? A larger step_s, a part of the reference  takes less"
    )


def _sample(scenario: Scenario) -> tuple[FloatArray, FloatArray, float, float, float, list[str]]:
    """Times, tensions, initial tension, rms of what a filter removed, interval and notes of a file."""
    spec, step, file = scenario.reference, scenario.run.step_s, scenario.source.name
    removed, interval, notes = 0.0, 0.0, list[str]()
    match spec:
        case SineReference():
            time = _grid(spec.duration_s, step, file)
            highest = max(spec.frequencies_Hz)
            if not highest * step < 0.5:  # sampled, it would be another sine, slower than the wanted one
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
            samples = read_samples(spec, scenario.source.parent / spec.file, step)
            time = _grid(float(samples.time_s[-1]), step, file)
            tension, removed = resample(spec, samples, time, step, file)
            interval = samples.interval_s
            notes += samples.notes
        case _:
            assert_never(spec)
    # The first sample of the filtered course, where there is a filter: the run then starts without a jump.
    initial = float(tension[0]) if spec.initial_tension_N is None else spec.initial_tension_N
    return time, tension, initial, removed, interval, notes


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


def largest_tension(transmission: Transmission) -> float:
    """Largest output tension that force_max_N reaches by slow pulling [N].

    Parameters
    ----------
    transmission : Transmission
    """
    from tendonff.models.capstan import CapstanLaw

    return CapstanLaw.of(transmission).largest_output_N(transmission.actuator.force_max_N)


def _check_deliverable(transmission: Transmission, time: FloatArray, tension: FloatArray, file: str) -> None:
    lowest, highest = int(np.argmin(tension)), int(np.argmax(tension))
    if not tension[lowest] > 0:
        raise InputError(
            f"{file} [reference]: the tension must stay above 0, got {tension[lowest]:.4g} N at "
            f"t = {time[lowest]:g} s; a tendon cannot push: raise the reference, or make it swing less"
        )
    reachable = largest_tension(transmission)
    if tension[highest] > reachable:
        angle = transmission.path.total_angle_rad
        degrees = f" (total_angle_rad = {angle:g} is {angle / (2 * math.pi):.3g} turns: degrees?)"
        raise InputError(
            f"{file} [reference]: the tension reaches {tension[highest]:.4g} N at t = {time[highest]:g} s, but "
            f"force_max_N = {transmission.actuator.force_max_N:g} delivers at most {reachable:.4g} N through the "
            f"friction; lower the reference or raise force_max_N{degrees if angle > _MANY_TURNS_RAD else ''}"
        )
