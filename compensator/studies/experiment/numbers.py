"""Numbers of the two-motor test.

The paper prints pictures of this test and no numbers, so there is nothing to compare these with but the capstan law and
the models among themselves.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.studies.experiment.machine import StatePass
from tendonff.compensator.studies.experiment.result import SECTIONS, ExperimentResult, ExperimentRun, MeasuredTensions
from tendonff.models.capstan.two_ended import TwoEndedLaw

_BREAKAWAY = (0.05, 0.5)
MEANINGS = {
    "range_N": "largest minus smallest tension anywhere on the path during the test; percentages refer to it",
    "change_N, change_percent_of_range": "tension at the held end when the hold ends, minus that when it begins",
    "travel_m": "how far the holding motor moves away from the tendon meanwhile; with a held force it is creep",
    "width_s": "after a reversal: time from 5 to 50 % of the output's change; long means a smooth transient",
    "max_slope_N_per_s": "largest rate of the output tension after a reversal; high means a sudden breakaway",
    "two_ended_law": "difference of all tensions from the capstan law that is given both end tensions, RMS and largest",
    "measured": "difference of a measured tension, by sensor, from the simulated one, RMS and largest",
    "largest_switch_percent_of_range": "departure of any tension from its course as a motor changes its mode",
    "bristle_stiffness_factor": "factor on the bristles of the quasi-static run, which stands for the capstan law",
    "refinement": "difference of seven tensions to the run with more masses, the discretisation error, RMS and largest",
}
"""Meaning of each number of the test, in one line; most are fields of the classes below."""
_LEAST_CHANGE = 0.01  # of range: an output that changes less has no transient to speak of


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """Change at the held end during a hold: the tension of a held position, the travel of a held force."""

    change_N: float
    change_percent_of_range: float
    travel_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Transient:
    """Response of the far motor's end when the tendon reverses."""

    change_N: float  # change of the output tension over the state: of the end whose motor loads
    width_s: float  # the rest of the change is slip on all levels
    max_slope_N_per_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LawDeviation:
    """Difference of the tensions along the path from the two-ended capstan law, over all links and rows."""

    rms_percent_of_range: float
    max_percent_of_range: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """Difference between the path's own number of masses and a larger one, over seven tensions and all rows."""

    segments: int
    fine_segments: int
    rms_percent_of_range: float
    max_percent_of_range: float


def _rms_and_largest(off_N: FloatArray, range_N: float) -> tuple[float, float]:
    """RMS and largest size of differences, in % of a range."""
    rms, largest = math.sqrt(float((off_N**2).mean())), float(np.abs(off_N).max())
    return percent_of(rms, range_N), percent_of(largest, range_N)


def percent_of(value: float, range_N: float) -> float:
    """`value` in % of a range, 0 where the range is 0."""
    return 100 * value / range_N if range_N > 0 else 0.0


def holds(run: ExperimentRun) -> Iterator[tuple[StatePass, int]]:
    """States in which a motor holds its position or its force, and its index."""
    for done in run.passes:
        for motor in (0, 1):
            if done.state.modes[motor].holds and not any(done.state.rates):
                yield done, motor


def sliding_direction(done: StatePass) -> int:
    """Direction in which the commands of a state move the tendon: 1 to motor 1, -1 to motor 2, 0 neither."""
    return int(np.sign(done.state.rates[0]) - np.sign(done.state.rates[1]))


def reversals(run: ExperimentRun) -> list[StatePass]:
    """States in which the tendon is moved the other way than in the last one that moved it."""
    moving = [done for done in run.passes if sliding_direction(done) != 0]
    return [now for before, now in pairwise(moving) if sliding_direction(now) * sliding_direction(before) < 0]


def driven_motor(done: StatePass) -> int:
    """Index of the motor whose command moves; the other end is the output."""
    return 0 if done.state.rates[0] != 0 else 1


def relaxation(run: ExperimentRun) -> dict[str, Relaxation]:
    """Change in each hold, by state."""
    found = {}
    for done, motor in holds(run):
        end = run.link_tension_N[:, -motor]  # column 0 for motor 1, -1 for motor 2
        change = float(end[done.last_row] - end[done.first_row])
        position = run.position_m[:, motor]
        found[done.state.name] = Relaxation(
            change_N=change,
            change_percent_of_range=percent_of(change, run.range_N),
            travel_m=(1 - 2 * motor) * float(position[done.last_row] - position[done.first_row]),
        )
    return found


def transient(run: ExperimentRun, done: StatePass) -> Transient | None:
    """Course of the output tension in a state; None where the output hardly changes."""
    rows = slice(done.first_row, done.last_row + 1)
    output = run.link_tension_N[rows, -1 if driven_motor(done) == 0 else 0]
    change = float(output[-1] - output[0])
    if abs(change) < _LEAST_CHANGE * run.range_N:
        return None
    step = float(run.time_s[1] - run.time_s[0])
    share = (output - output[0]) / change
    first, last = (int(np.argmax(share >= level)) for level in _BREAKAWAY)
    return Transient(
        change_N=change,
        width_s=round((last - first) * step, 12),
        max_slope_N_per_s=float(np.abs(np.diff(output)).max()) / step,
    )


def largest_switch(run: ExperimentRun) -> float:
    """Largest departure of any tension from its course as a motor changes its mode, in % of the range.

    One step after the change, from the straight line through the two rows before.
    """
    starts = [now.first_row for before, now in pairwise(run.passes) if before.state.modes != now.state.modes]
    f = run.link_tension_N
    steps = [float(np.abs(f[k + 1] - 2 * f[k] + f[k - 1]).max()) for k in starts]
    return percent_of(max(steps, default=0.0), run.range_N)


def law_deviation(run: ExperimentRun) -> LawDeviation:
    """Difference from the capstan law with two ends, given the run's own end tensions."""
    tension = run.link_tension_N
    law = TwoEndedLaw.of(run.transmission, tension.shape[1] - 1)
    # inertia and viscous friction may take the ends beyond full slip: no tension is too far here
    off = law.history_N(tension[:, 0], tension[:, -1], tension[0], excess=math.inf) - tension
    rms, largest = _rms_and_largest(off, run.range_N)
    return LawDeviation(rms_percent_of_range=rms, max_percent_of_range=largest)


def refinement(coarse: ExperimentRun, fine: ExperimentRun) -> Refinement:
    """Difference of two runs of the same schedule."""
    rms, largest = _rms_and_largest(fine.tension_N - coarse.tension_N, coarse.range_N)
    return Refinement(
        segments=coarse.link_tension_N.shape[1] - 1,
        fine_segments=fine.link_tension_N.shape[1] - 1,
        rms_percent_of_range=rms,
        max_percent_of_range=largest,
    )


def warnings_of(result: ExperimentResult) -> list[str]:
    """Warnings of the test."""
    lead = result.runs[result.lead]
    notes = [
        f"{done.state.name} ended after {done.state.at_most_s:g} s without {done.state.until}: give it more time"
        for done in lead.passes
        if done.state.until is not None and not done.met
    ]
    actuator = lead.transmission.actuator
    for level, run in result.runs.items():
        if float(run.link_tension_N.min()) <= 0:
            row = int(np.argmax((run.link_tension_N <= 0).any(axis=1)))
            notes.append(
                f"{level}: the tendon goes slack in {run.state_names()[row]} at t = {run.time_s[row]:.4g} s: "
                "raise low_tension_N"
            )
        most = float(run.force_N.max())
        if most > actuator.force_max_N * (1 + 1e-9):
            notes.append(f"{level}: a motor needs {most:.4g} N, force_max_N is {actuator.force_max_N:g}")
    notes += [
        f"{done.state.name}: the reversal does not reach the other end on level {level}; lower low_tension_N"
        for level, run in result.runs.items()
        for done in reversals(run)
        if transient(run, done) is None
    ]
    return notes


COLUMNS = tuple(f"tension_{k + 1}_N" for k in range(SECTIONS))


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Measured against simulated, over the time that both have."""

    sensor: int  # place along the path, 1 at motor 1 to 7 at motor 2
    # measured_rms_percent_of_range, measured_max_percent_of_range: of the range of the simulated run
    measured_rms_percent_of_range: float
    measured_max_percent_of_range: float


def read_measured(path: Path) -> MeasuredTensions:
    """Read a file with `time_s` and any of `tension_1_N` .. `tension_7_N`; its time counts from the start of the test.

    InputError if it has no time or none of the tensions, or starts after the test.
    """
    table = read_table(path, ("time_s", *COLUMNS))
    there = [k for k, name in enumerate(COLUMNS) if name in table.columns]
    if "time_s" not in table.columns or not there:
        raise InputError(
            f"{path.name}: --measured needs the column time_s and at least one of tension_1_N (motor 1) to "
            f"tension_{SECTIONS}_N (motor 2); it has {', '.join(table.columns)}"
        )
    time, _ = table.seconds("time_s")
    rows = np.column_stack([time, *(table.numbers(COLUMNS[k]) for k in there)])
    rows = rows[np.isfinite(rows).all(axis=1)]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    if len(rows) < 2:
        raise InputError(f"{path.name}: {len(rows)} rows hold numbers in all columns; at least 2 are needed")
    return MeasuredTensions(
        name=path.name, time_s=rows[:, 0], tension_N={k: rows[:, j + 1] for j, k in enumerate(there)}
    )


def deviations(run: ExperimentRun, measured: MeasuredTensions) -> tuple[Deviation, ...]:
    """Difference of each measured tension from a run; InputError if no measured row lies within the test."""
    inside = (measured.time_s >= run.time_s[0]) & (measured.time_s <= run.time_s[-1])
    if not inside.any():
        raise InputError(
            f"{measured.name}: time_s goes from {measured.time_s[0]:g} to {measured.time_s[-1]:g} s, the test from 0 "
            f"to {run.time_s[-1]:g} s; let the measured time start with the test"
        )
    found = []
    for k, tension in measured.tension_N.items():
        simulated = np.interp(measured.time_s[inside], run.time_s, run.tension_N[:, k])
        rms, largest = _rms_and_largest(tension[inside] - simulated, run.range_N)
        found.append(Deviation(sensor=k + 1, measured_rms_percent_of_range=rms, measured_max_percent_of_range=largest))
    return tuple(found)
