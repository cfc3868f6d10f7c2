"""The desired tension at the far end, sampled on the grid of the run."""

import math
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.text import require_named
from tendonff.compensator.scenario.doubts import (
    length_doubts,
    reach_notes,
    reference_doubts,
    scenario_doubts,
    scenario_notes,
)
from tendonff.compensator.scenario.reference import (
    CsvReference,
    Hold,
    SineReference,
    WaypointReference,
    along_sines,
    along_waypoints,
)
from tendonff.compensator.scenario.sampled.from_file import read_samples, resample
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.unit import METRE, NEWTON, Unit

_MAX_STEPS = 50_000_000
_LEAST_SHARE = 0.02  # of the range: a taut tendon where the reference is zero


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Samples of the reference tension.

    Parameters
    ----------
    time_s, tension_N : ndarray, shape (n + 1,)
        k step_s for k = 0 .. n [s], and the reference tension there [N], > 0.
    initial_tension_N : float
        Uniform tension at rest before the start [N].
    removed_noise_N, sample_interval_s : float
        Root mean square of what the low-pass took away [N], and usual time between the samples of a file [s]; else 0.
    position_m : ndarray, shape (n + 1,), or None
        Reference position of the load relative to the start [m], where the reference is a position.
    periodic : bool
        One period of a cycle: the last row is the first of the next.
    hold : Hold
        What the force does while the reference rests.
    raised_N : float
        Tension to which a lower reference was raised [N]; 0 where it is as the user wrote it.
    step_s : float
        Time step [s].
    live_N : tuple of float or None
        Tensions that a live reference may have, low and high, as the scenario states them [N].
    warnings : tuple of str
        Doubts about it, one sentence each.
    """

    time_s: FloatArray
    tension_N: FloatArray
    step_s: float
    initial_tension_N: float
    removed_noise_N: float = 0.0
    sample_interval_s: float = 0.0
    position_m: FloatArray | None = None
    periodic: bool = False
    hold: Hold = Hold.EXACT
    raised_N: float = 0.0
    live_N: tuple[float, ...] | None = None
    warnings: tuple[str, ...] = ()

    @property
    def wanted(self) -> FloatArray:
        """Base of relative errors, shape (n + 1,), in `unit`: the load's position where that is the reference."""
        return self.tension_N if self.position_m is None else self.position_m

    @property
    def unit(self) -> Unit:
        """Unit of the reference and its errors."""
        return NEWTON if self.position_m is None else METRE

    @property
    def output(self) -> str:
        """The quantity that follows the reference, in words."""
        return "output tension" if self.position_m is None else "load position"

    @property
    def name(self) -> str:
        """Reference of the errors: as the user wrote it, or raised; a position is never raised."""
        raised = self.raised_N > 0 and self.position_m is None
        return f"reference raised to {self.raised_N:.3g} N" if raised else "reference"

    @property
    def share_of(self) -> str:
        """Scale of percentages: "range", and of which reference where it is not as the user wrote it."""
        return "range" if self.name == "reference" else f"range of the {self.name}"

    @property
    def range_N(self) -> float:
        """Largest minus smallest reference tension [N]: what percentages refer to, unless that is a position."""
        return float(np.ptp(self.tension_N))


def sample_reference(scenario: Scenario, *, strict: bool = False) -> Reference:
    """Sample the reference of a scenario and check that the transmission can deliver it.

    InputError where the reference reaches 0 or below, or (only a warning unless `strict`) above the largest tension
    that the largest force delivers through the friction.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> reference = tf.sample_reference(scenario)
    >>> reference.tension_N.shape, reference.step_s
    ((4001,), 0.001)
    """
    spec, sampled, file = scenario.reference, _sample(scenario), scenario.source.name
    tension, initial, removed = sampled.tension_N, sampled.initial_tension_N, sampled.removed_noise_N
    require_taut(sampled.time_s, tension, file)
    rig = scenario.transmission
    reach = reach_notes(rig, sampled.time_s, tension, file)
    if strict and reach:
        raise InputError("; ".join(reach))
    doubts = (
        *scenario_doubts(scenario),
        *length_doubts(spec, float(sampled.time_s[-1]), scenario.run),
        *reference_doubts(rig, tension, scenario.run),
    )
    notes = [*sampled.warnings, *map(str, doubts), *scenario_notes(rig), *reach]
    if removed > 0 and isinstance(spec, CsvReference):
        span, unit = (tension, "N") if sampled.position_m is None else (sampled.position_m, "m")
        low_pass = (
            f"{spec.file}: the low-pass at {spec.cutoff_Hz:g} Hz removed {removed:.3g} {unit} RMS "
            f"({100 * removed / max(float(np.ptp(span)), 1e-300):.2g} % of range)"
        )
        notes.append(Remark(low_pass))
    if abs(initial - tension[0]) > 1e-3 * max(float(np.ptp(tension)), 1e-9):
        notes.append(
            f"the reference starts at {tension[0]:.4g} N but initial_tension_N is {initial:.4g} N: it jumps at t = 0"
        )
    if (live := spec.range_N) is not None and not (live[0] <= tension.min() and tension.max() <= live[1]):
        raise InputError(
            f"{file} [reference]: range_N = [{live[0]:g}, {live[1]:g}] does not hold the reference, which goes from "
            f"{tension.min():.4g} to {tension.max():.4g} N; widen it"
        )
    return replace(sampled, warnings=tuple(notes), live_N=live)


def initial_tension(scenario: Scenario) -> float:
    """Uniform tension at rest before the start [N], without checking the rest of the reference."""
    return _sample(scenario).initial_tension_N


def _sample(scenario: Scenario) -> Reference:
    """The reference before it is checked against what the transmission can deliver."""
    spec, step, file = scenario.reference, scenario.run.step_s, scenario.source.name
    removed, interval, notes = 0.0, 0.0, list[str]()
    match spec:
        case SineReference():
            time = _grid(spec.duration_s, step, file)
            highest = max(spec.frequencies_Hz)
            if not highest * step < 0.5:  # sampled, it would be another sine, slower than the given one
                raise InputError(
                    f"{file} [reference]: frequencies_Hz must be < {0.5 / step:g} (half the rate of "
                    f"step_s = {step:g}), got {highest:g}; use a step of {0.02 / highest:.2g} s or less: "
                    f"step_s is in seconds, 1 ms is 0.001"
                )
            start = 0.0 if spec.wants_position else spec.initial_tension_N
            course = start + along_sines(spec.amplitudes, spec.frequencies_Hz, spec.fade_in_s, time, spec.fade)
        case WaypointReference():
            time = _grid(spec.duration_s, step, file)
            course = along_waypoints(spec.times_s, spec.values, spec.shape, time)
        case CsvReference():
            require_named(scenario.source.parent / spec.file, f"{scenario.source.name} [reference]: file")
            samples = read_samples(spec, scenario.source.parent / spec.file, step)
            time = _grid(float(samples.time_s[-1]), step, file)
            course, removed = resample(spec, samples, time, step, file)
            interval = samples.interval_s
            notes += samples.notes
        case _:
            assert_never(spec)
    if spec.periodic:
        course = _closed(course, file)
    position = course if spec.wants_position else None
    if position is not None:
        from tendonff.ocp.reference.motion import tension_of_motion  # brings CasADi, and a refusal is to be quick

        # The first of a periodic course is not at rest: its tension is that of the cycle.
        rest = spec.initial_tension_N or 0.0
        course = tension_of_motion(scenario.transmission.load, position, step, rest, periodic=spec.periodic)
    # The first sample of the filtered course, where there is a filter: the run then starts without a jump.
    initial = float(course[0]) if spec.initial_tension_N is None else spec.initial_tension_N
    tension, floor, note = keep_taut(course, spec.least_tension_N)
    return Reference(
        time_s=time,
        tension_N=tension,
        step_s=step,
        initial_tension_N=max(initial, floor),
        removed_noise_N=removed,
        sample_interval_s=interval,
        position_m=position,
        periodic=spec.periodic,
        hold=spec.hold,
        raised_N=floor,
        warnings=(*notes, *note),
    )


def _closed(course: FloatArray, file: str) -> FloatArray:
    """Period of the reference, its last sample the first of the next."""
    first, last, span = float(course[0]), float(course[-1]), float(np.ptp(course))
    if abs(last - first) > 1e-3 * span:
        raise InputError(
            f"{file} [reference]: periodic = true, but the reference starts at {first:.4g} and ends at {last:.4g}; let "
            "one period end where it starts (sines: whole periods and fade_in_s = 0)"
        )
    closed = course.copy()
    closed[-1] = first
    return closed


def keep_taut(tension_N: FloatArray, least_N: float | None) -> tuple[FloatArray, float, tuple[str, ...]]:
    """A reference, shape (n,), that touches zero, lifted to a least tension; that tension, and what to say.

    By default the least tension is 2 % of the range where the reference touches zero, else none.
    """
    lowest, span = float(np.min(tension_N)), float(np.ptp(tension_N))
    if lowest < -1e-6 * span or (least_N is None and lowest > 0) or (least_N is not None and lowest >= least_N):
        return tension_N, 0.0, ()
    least = _LEAST_SHARE * span if least_N is None else least_N
    if least <= 0:
        return tension_N, 0.0, ()
    # A hyperbola between reference and floor: a corner there would make the inverse jump.
    lifted: FloatArray = 0.5 * (tension_N + least + np.hypot(tension_N - least, 0.5 * least))
    floor = float(np.min(lifted))
    source = f"least_tension_N, default {100 * _LEAST_SHARE:g} % of range" if least_N is None else "least_tension_N"
    share = 100 * float(np.mean(lifted - tension_N > 0.1 * least))
    note = Remark(
        f"the reference falls to {lowest:.3g} N and is raised to {floor:.3g} N ({source}) in {share:.2g} % of the "
        "samples; errors are relative to the raised reference"
    )
    return lifted, floor, (note,)


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
    return np.arange(steps + 1, dtype=np.float64) * step_s


def require_taut(time_s: FloatArray, tension_N: FloatArray, file: str) -> None:
    """Refuse a reference, shape (n,), that reaches 0 or below."""
    lowest = int(np.argmin(tension_N))
    if not tension_N[lowest] > 0:
        raise InputError(
            f"{file} [reference]: the tension must stay above 0, got {tension_N[lowest]:.4g} N at "
            f"t = {time_s[lowest]:g} s; a tendon cannot push: raise the reference, or make it swing less"
        )
