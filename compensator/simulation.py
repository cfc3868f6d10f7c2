"""Play a force file on the chain: row by row into a file, in bounded memory."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files import CsvStream, FloatArray, InputError, open_csv, read_csv
from tendonff.compensator.reference import initial_tension
from tendonff.compensator.scenario import Scenario
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.simulate import Simulator, describe_failure, force_inputs, tensions_of

_CHUNK_VALUES = 200_000  # numbers in memory at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceProfile:
    """A force file.

    Parameters
    ----------
    time_s, force_N : ndarray, shape (rows,)
        Piecewise linear force of the actuator; time rises from 0.
    name : str
        File name, for messages.
    """

    time_s: FloatArray
    force_N: FloatArray
    name: str

    def steps(self, step_s: float) -> int:
        """Number of whole steps until the last row."""
        return math.floor(float(self.time_s[-1]) / step_s * (1 + 1e-9) + 1e-9)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Force at the given times [N]."""
        force: FloatArray = np.interp(time_s, self.time_s, self.force_N)
        return force


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedForce:
    """What became of a force that was played.

    Parameters
    ----------
    rows : int
        Rows written.
    warnings : tuple of str
        What the user should know.
    check : str or None
        Estimate of the discretisation error, in words, when it was asked for.
    """

    rows: int
    warnings: tuple[str, ...]
    check: str | None


class _Error:
    """Difference between a run and one with half the step, gathered chunk by chunk."""

    def __init__(self) -> None:
        self.squares = 0.0
        self.peak = 0.0
        self.rows = 0
        self.lowest = math.inf
        self.highest = -math.inf

    def add(self, coarse: FloatArray, fine: FloatArray) -> None:
        difference = coarse - fine
        self.squares += float(difference @ difference)
        self.peak = max(self.peak, float(np.abs(difference).max(initial=0.0)))
        self.rows += len(difference)
        self.lowest = min(self.lowest, float(coarse.min(initial=math.inf)))
        self.highest = max(self.highest, float(coarse.max(initial=-math.inf)))

    def text(self, step_s: float) -> str:
        rms = math.sqrt(self.squares / max(self.rows, 1))
        span = self.highest - self.lowest
        percent = f" ({100 * rms / span:.2g} % and {100 * self.peak / span:.2g} % of range)" if span > 0 else ""
        error = f"{rms:.3g} N rms, {self.peak:.3g} N at most{percent}"
        return f"output tension against a run with step {step_s / 2:g} s: {error}"


def read_force(path: Path) -> ForceProfile:
    """Read a force file: columns time_s, force_N, first row at 0.

    Parameters
    ----------
    path : Path
    """
    columns = read_csv(path, ("time_s", "force_N"), starts_at_zero=True)
    return ForceProfile(time_s=columns["time_s"], force_N=columns["force_N"], name=path.name)


def play_force(
    scenario: Scenario,
    level: Level,
    profile: ForceProfile,
    out: Path,
    *,
    check: bool = False,
    advance: Callable[[int, int], None] | None = None,
) -> PlayedForce:
    """Simulate the chain under a force file, from rest at the scenario's initial tension, and write the rows.

    Parameters
    ----------
    scenario : Scenario
    level : Level
    profile : ForceProfile
    out : Path
        File to write: `time_s,force_N,tension_1_N,...,actuator_position_m,load_position_m`.
    check : bool
        Run with half the step as well and state the difference.
    advance : callable
        Told rows done and rows in all.

    Raises
    ------
    SolveError
        When a step cannot be solved; nothing is written then.
    """
    step = scenario.run.step_s
    total = profile.steps(step) + 1
    if total > 2_000_000_000:
        raise InputError(
            f"{profile.name}: {profile.time_s[-1]:g} s at step_s = {step:g} are {total} rows; use a larger step"
        )
    start_tension = initial_tension(scenario)
    chain = Chain.of(scenario.transmission, level)
    names = ["time_s", "force_N", *(f"tension_{k}_N" for k in range(1, chain.count + 2))]
    with open_csv(out, [*names, "actuator_position_m", "load_position_m"]) as stream:
        run = _Run(chain, profile, start_tension, step, check=check)
        run.write_first(stream)
        size = max(1, _CHUNK_VALUES // (chain.count + 5))
        for first in range(1, total, size):
            run.write_next(stream, np.arange(first, min(first + size, total)))
            if advance is not None:
                advance(min(first + size, total), total)
    warnings = []
    if (jump := abs(run.first_force - start_tension)) > 1e-6 * max(start_tension, 1.0):
        warnings.append(
            f"{profile.name} starts at {run.first_force:.6g} N, but the run starts at rest at {start_tension:.6g} N: "
            f"the force jumps by {jump:.3g} N at t = 0"
        )
    if run.slack_rows:
        warnings.append(
            f"the tendon goes slack at t = {run.first_slack_s:.6g} s, and in {100 * run.slack_rows / total:.2g} % of "
            "the rows some link carries no tension: raise the force there"
        )
    return PlayedForce(rows=total, warnings=tuple(warnings), check=run.error.text(step) if check else None)


class _Run:
    """A simulation on its way from chunk to chunk."""

    def __init__(
        self, chain: Chain, profile: ForceProfile, start_tension: float, step_s: float, *, check: bool
    ) -> None:
        self._chain, self._profile, self._step = chain, profile, step_s
        state = chain.rest_state(start_tension)
        self.first_force = float(profile.force_N[0])
        start = force_inputs(np.array([self.first_force]))[0]
        self._first = state.vector()
        self._simulator = Simulator(chain, step_s, state, start)
        self._half = Simulator(chain, step_s / 2, state, start) if check else None
        self.error = _Error()
        self.slack_rows = 0
        self.first_slack_s = math.nan

    def write_first(self, stream: CsvStream) -> None:
        """The row at rest."""
        tension = tensions_of(self._chain, self._first)[0]
        stream.write(np.concatenate([[0.0, self.first_force], tension, self._first[-2:]])[None, :])
        self._note_slack(tension[None, :], np.zeros(1))

    def write_next(self, stream: CsvStream, k: NDArray[np.int64]) -> None:
        """Rows k, which follow the last ones."""
        time = k.astype(np.float64) * self._step
        force = self._profile.at(time)
        rows = self._simulator.advance(force_inputs(force))
        good = len(rows.tension_N)
        if good < len(k):
            raise SolveError(describe_failure(self._chain, rows, float(time[good]), self._step))
        stream.write(np.column_stack([time, force, rows.tension_N, rows.ends_m]))
        self._note_slack(rows.tension_N, time)
        if self._half is not None:
            fine_time = np.arange(2.0 * k[0] - 1, 2.0 * k[-1] + 0.5, dtype=np.float64) * (self._step / 2)
            fine = self._half.advance(force_inputs(self._profile.at(fine_time)))
            if len(fine.tension_N) < len(fine_time):
                failed = float(fine_time[len(fine.tension_N)])
                raise SolveError(describe_failure(self._chain, fine, failed, self._step / 2))
            self.error.add(rows.tension_N[:, -1], fine.tension_N[1::2, -1])

    def _note_slack(self, tension: FloatArray, time: FloatArray) -> None:
        slack = (tension <= 0).any(axis=1)
        if slack.any() and not self.slack_rows:
            self.first_slack_s = float(time[int(np.argmax(slack))])
        self.slack_rows += int(slack.sum())
