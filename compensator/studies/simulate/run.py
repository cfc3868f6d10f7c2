"""Simulate the chain under a force file: row by row into a file, in bounded memory."""

import math
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.plant import behind_servo
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.quantities import FORCE_UNITS, LENGTH_UNITS, Quantity, read_quantities, time_quantity
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.tables import table_dialect
from tendonff.compensator.files.writing import open_csv
from tendonff.compensator.scenario.doubts import (
    UnitDoubt,
    force_doubts,
    force_notes,
    scenario_doubts,
    scenario_notes,
    settle,
)
from tendonff.compensator.scenario.sampled.joint_motion import moved, moved_by_file
from tendonff.compensator.scenario.sampled.sampling import initial_tension
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters import Actuator
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.tendon.crosscheck import StepHalving
from tendonff.ocp.tendon.simulate import Simulator, describe_failure, tensions_of

_CHUNK_VALUES = 200_000  # numbers in memory at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceProfile:
    """A force file."""

    # time_s, force_N: shape (rows,); piecewise linear force of the actuator; time rises from 0
    time_s: FloatArray
    force_N: FloatArray
    name: str  # file name, for messages
    notes: tuple[str, ...] = ()  # what was taken for granted when it was read
    is_command: bool = False  # it holds the command of a position drive relative to the start [m] instead of a force

    def steps(self, step_s: float) -> int:
        """Number of whole steps until the last row."""
        return math.floor(float(self.time_s[-1]) / step_s * (1 + 1e-9) + 1e-9)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Force at the given times [N]."""
        return np.interp(time_s, self.time_s, self.force_N)


def read_force(path: Path, column: str | None = None, actuator: Actuator | None = None) -> ForceProfile:
    """Read what drives the actuator: columns time_s and force_N, or command_m for a position drive, first row at 0.

    The file of a force drive with a lag or the like has its commands: force_N, or command_NAME_N in a profile.csv.

    In a `profile.csv` the optimal one is taken, unless a column is named. InputError where the file is refused, or its
    columns do not tell which is the force.
    """
    drive = Drive.FORCE if actuator is None else actuator.drive
    word, unit, units = ("force", "N", FORCE_UNITS) if drive is Drive.FORCE else ("command", "m", LENGTH_UNITS)
    plain, usual = f"{word}_{unit}", f"{word}_optimal_{unit}"
    names = table_dialect(path, ("time_s", plain, *([column] if column else []))).names
    if drive is Drive.FORCE and actuator is not None and not actuator.servo.is_ideal:
        word = "command" if any(re.fullmatch(r"command_\w+_N", name) for name in names) else word
        usual = f"{word}_optimal_{unit}"
    profiles = [name for name in names if re.fullmatch(rf"{word}_\w+_{unit}", name)]
    note: tuple[str, ...] = ()
    if column is None and plain not in names and usual in profiles:
        column = usual
        others = ", ".join(name for name in profiles if name != column)
        note = (f"{path.name}: simulating {column}" + (f" (--force-column for {others})" if others else ""),)
    wanted = (
        time_quantity('the name "time_s"'),
        Quantity(
            name=plain,
            words=(word, f"actuator_{word}", *(name.removesuffix(f"_{unit}") for name in profiles)),
            units=units,
            option='--force-column "{}"',
            column=column,
        ),
    )
    read = read_quantities(path, wanted, starts_at_zero=True)
    return ForceProfile(
        time_s=read.values["time_s"],
        force_N=read.values[plain],
        name=path.name,
        notes=(*note, *read.notes),
        is_command=drive is Drive.POSITION,
    )


def doubts_of(scenario: Scenario, profile: ForceProfile) -> tuple[UnitDoubt, ...]:
    """Doubts about a force file."""
    if profile.is_command:
        return ()
    return force_doubts(scenario.transmission, profile.force_N, scenario.run, file=profile.name)


def notes_of(scenario: Scenario, profile: ForceProfile) -> tuple[str, ...]:
    """Notes on a scenario and a force file, which is simulated nevertheless."""
    rig = scenario.transmission
    if profile.is_command:
        return scenario_notes(rig)
    start = initial_tension(scenario)
    return (*scenario_notes(rig), *force_notes(rig, profile.force_N, start, file=profile.name))


def simulate_force_file(
    scenario: Scenario,
    level: Level,
    commands: Path,
    out: Path,
    *,
    column: str | None = None,
    joints: Path | None = None,
    check: bool = False,
    method: Method = Method.BDF2,
    accept: bool = False,
    progress: Progress = silent,
) -> SimulatedFile:
    """Simulate the chain under a force file; see `tendonff.compensator.door.simulate_file`."""
    scenario = scenario if joints is None else moved_by_file(scenario, joints)
    profile = read_force(commands, column, scenario.transmission.actuator)
    settle(doubts_of(scenario, profile), file=scenario.source.name, accept=accept)
    return simulate_force(scenario, level, profile, out, check=check, method=method, progress=progress)


def simulate_force(
    scenario: Scenario,
    level: Level,
    profile: ForceProfile,
    out: Path,
    *,
    check: bool = False,
    method: Method = Method.BDF2,
    progress: Progress = silent,
) -> SimulatedFile:
    """Simulate the chain under a force file, from rest at the scenario's initial tension, and write the rows.

    The file has the columns `time_s,force_N,tension_1_N,...,actuator_position_m,load_position_m`. A check runs with a
    half and a quarter of the step as well and states the error estimate. SolveError
    when a step cannot be solved; nothing is written then.
    """
    step = scenario.run.step_s
    total = profile.steps(step) + 1
    if total > 2_000_000_000:
        raise InputError(
            f"{profile.name}: {profile.time_s[-1]:g} s at step_s = {step:g} are {total} rows; use a larger step"
        )
    start_tension, given = initial_tension(scenario), profile
    chain = Chain.of(moved(scenario, float(profile.time_s[-1])), level)
    actuator = scenario.transmission.actuator
    if not actuator.servo.is_ideal:
        grid: FloatArray = np.arange(total, dtype=np.float64) * step
        reached = actuator.servo.follow(profile.at(grid), step)
        profile = replace(profile, time_s=grid, force_N=reached)
    if profile.is_command:
        chain, drive = behind_servo(chain, actuator, start_tension, profile.force_N)
        profile = replace(profile, force_N=drive)
    names = ["time_s", "force_N", *(f"tension_{k}_N" for k in range(1, chain.count + 2))]
    size = max(1, _CHUNK_VALUES // (chain.count + 5))
    pieces = [(first, min(first + size, total)) for first in range(1, total, size)]
    columns = [*names, "actuator_position_m", "load_position_m"]
    with open_csv(out, columns) as stream, ThreadPoolExecutor(max_workers=1) as worker:
        run = _Run(chain, profile, start_tension, step, check=check, method=method)
        stream.write(run.first_row())
        # Compiled steps leave the interpreter free to write what came before them.
        computed = (worker.submit(run.next_rows, *piece) for piece in pieces)
        coming = next(computed, None)
        while coming is not None:
            rows = coming.result()
            coming = next(computed, None)
            stream.write(rows)
            progress(round(rows[-1, 0] / step) + 1, total)
    doubts = (*scenario_doubts(scenario), *doubts_of(scenario, given))
    warnings = [*map(str, doubts), *notes_of(scenario, given)]
    if given.is_command and (jump := abs(run.first_force - start_tension)) > 1e-6 * max(start_tension, 1.0):
        warnings.append(
            f"{profile.name} starts at {run.first_force:.6g} N, but the run starts at rest at {start_tension:.6g} N: "
            f"the force jumps by {jump:.3g} N at t = 0"
        )
    if run.slack_rows:
        warnings.append(
            f"the tendon goes slack at t = {run.first_slack_s:.6g} s, and in {100 * run.slack_rows / total:.2g} % of "
            "the rows some link carries no tension: raise the force there"
        )
    found = run.halving.result().text if run.halving is not None else None
    return SimulatedFile(rows=total, notes=given.notes, warnings=tuple(warnings), check=found)


class _Run:
    """A simulation on its way from chunk to chunk."""

    def __init__(
        self,
        chain: Chain,
        profile: ForceProfile,
        start_tension: float,
        step_s: float,
        *,
        check: bool,
        method: Method,
    ) -> None:
        self._chain, self._profile, self._step = chain, profile, step_s
        state = chain.rest_state(start_tension)
        first_drive = float(profile.force_N[0])
        self._spring = chain.near.stiffness_N_per_m  # of a servo, whose force is what the actuator gives
        self.first_force = first_drive - self._spring * state.near_position_m
        start = ChainInputs.of_force(np.array([first_drive]))
        self._first = state.vector()
        self._simulator = Simulator(chain, step_s, state, start, method=method)
        self.halving = StepHalving(chain, step_s, state, first_drive) if check else None
        self.slack_rows = 0
        self.first_slack_s = math.nan

    def first_row(self) -> FloatArray:
        """The row at rest."""
        tension = tensions_of(self._chain, self._first)
        self._note_slack(tension, np.zeros(1))
        return np.concatenate([[0.0, self.first_force], tension[0], self._first[-2:]])[None, :]

    def next_rows(self, first: int, after: int) -> FloatArray:
        """Rows first .. after - 1, which follow the last ones."""
        time = np.arange(first, after, dtype=np.float64) * self._step
        force = self._profile.at(time)
        rows = self._simulator.advance(ChainInputs.of_force(force))
        if (good := len(rows.tension_N)) < len(time):
            raise SolveError(describe_failure(self._chain, rows, float(time[good]), self._step))
        self._note_slack(rows.tension_N, time)
        if self.halving is not None:
            self.halving.add(time, rows.tension_N[:, -1], self._profile.at)
        return np.column_stack([time, force - self._spring * rows.ends_m[:, 0], rows.tension_N, rows.ends_m])

    def _note_slack(self, tension: FloatArray, time: FloatArray) -> None:
        slack = (tension <= 0).any(axis=1)
        if slack.any() and not self.slack_rows:
            self.first_slack_s = float(time[int(np.argmax(slack))])
        self.slack_rows += int(slack.sum())
