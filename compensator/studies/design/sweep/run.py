"""Designs and scores over a grid of parameters, or over units that the uncertainty admits."""

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonff.compensator.compensators.every import AnyScenario, answering, compensator_of, problem_of
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.studies.design.sweep.plan import Axis, Unit, grid_units, random_keys, random_units
from tendonff.compensator.studies.design.sweep.result import Row, Store, Sweep
from tendonff.models.errors import TendonffError
from tendonff.models.turns import in_turn
from tendonff.ocp.tendon.batch import run_jobs


@contextmanager
def executor_of(address: str | None) -> Iterator[Executor | None]:
    """An executor on the cluster at an address such as tcp://host:8786, which stays up; None for this machine.

    InputError if Dask is not installed, or no cluster responds.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError('--scheduler needs Dask: pip install "tendonff[distributed]"') from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: no Dask cluster answers there: {error}") from None
    with client:
        yield client.get_executor()


_UNITS_OF_JOB = 4
_JOBS_OF_WAVE = 32  # then the rows are stored


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Some units, in one piece for one worker."""

    units: tuple[Unit, ...]
    compensators: tuple[str, ...]
    profiles: tuple[Any, ...] | None  # profiles to try on every unit; None: design anew for each


@in_turn
def run_job(job: Job) -> tuple[Row, ...]:
    """Score every compensator on the units of a job; what fails is NaN."""
    return tuple(_score(unit, job) for unit in job.units)


def _score(unit: Unit, job: Job) -> Row:
    nothing = (math.nan,) * len(job.compensators)
    try:
        problem = problem_of(unit.scenario)
    except TendonffError:
        return Row(index=unit.index, values=unit.values, percent=nothing, peak=nothing)
    scores = []
    for k, name in enumerate(job.compensators):
        try:
            each = compensator_of(problem, name)
            profile = problem.answer(each) if job.profiles is None else job.profiles[k]
            found = problem.score(profile)
            scores.append((found.rmse_percent_of_range, found.peak_error))
        except TendonffError:
            scores.append((math.nan, math.nan))
    percent, peak = zip(*scores, strict=True)
    return Row(index=unit.index, values=unit.values, percent=percent, peak=peak)


@in_turn
def sweep(
    scenario: AnyScenario,
    folder: str | os.PathLike[str],
    *,
    over: Sequence[Axis] = (),
    samples: int = 0,
    compensators: Sequence[str] = (),
    executor: Executor | None = None,
    progress: Progress = silent,
) -> Sweep:
    """Design and score over a grid, or score the scenario's design on units drawn from its uncertainty.

    Over keys and values the profiles are made for every point; on samples they are those of the scenario, as `design`
    makes them. Rows are kept in the folder as they come; a sweep that was killed goes on there. Units are computed by
    the executor, by default on all cores. InputError if neither or both of `over` and `samples` are given, or the
    folder holds another sweep.
    """
    if bool(over) == (samples > 0):
        raise InputError("a sweep needs either --over KEY=FROM:TO:COUNT or --samples N, and not both")
    problem = problem_of(scenario)
    usual = [each.name for each in answering(problem) if each.is_swept]
    known = {name: compensator_of(scenario, name) for name in compensators or usual}
    names = tuple(known)
    random = samples > 0
    keys = random_keys(scenario) if random else tuple(axis.key for axis in over)
    units = random_units(scenario, samples) if random else grid_units(scenario, tuple(over))
    axes = [[axis.key, axis.values[0], axis.values[-1], len(axis.values)] for axis in over]
    plan: dict[str, object] = {
        "scenario_hash": scenario.digest(),
        "samples": samples,
        "over": axes,
        "compensators": list(names),
    }
    store = Store(Path(folder), plan)
    done = store.read(len(keys))
    left = [unit for unit in units if unit.index not in done]
    progress(len(done), len(units))
    profiles, expectation = None, None
    if random:  # those that `design` makes
        profiles = tuple(problem.answer(each) for each in known.values())
        expectation = problem.expect(dict(zip(names, profiles, strict=True)))
    pieces = [left[k : k + _UNITS_OF_JOB] for k in range(0, len(left), _UNITS_OF_JOB)]
    for start in range(0, len(pieces), _JOBS_OF_WAVE):
        jobs = [
            Job(units=tuple(piece), compensators=names, profiles=profiles)
            for piece in pieces[start : start + _JOBS_OF_WAVE]
        ]
        found = [row for result in run_jobs(run_job, jobs, executor=executor) for row in result.require()]
        store.add(found)
        done |= {row.index: row for row in found}
        progress(len(done), len(units))
    options = f"--samples {samples} --from robust"
    if not random:
        options = " ".join(f"--over {a.key}={a.values[0]:g}:{a.values[-1]:g}:{len(a.values)}" for a in over)
    return Sweep(
        scenario=scenario,
        options=options,
        keys=keys,
        compensators=names,
        rows=tuple(done[unit.index] for unit in units),
        expectation=expectation,
    )
