"""The files of a two-motor test: a table for each level, summary, figures and report."""

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.page import write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.studies.experiment import numbers
from tendonff.compensator.studies.experiment.figures import experiment_figures
from tendonff.compensator.studies.experiment.report import experiment_report
from tendonff.compensator.studies.experiment.result import SECTIONS, ExperimentResult, ExperimentRun


def write_files(result: ExperimentResult, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `ExperimentResult.write`."""
    figures = experiment_figures(result)
    with atomic_directory(folder) as partial:
        for level, run in result.runs.items():
            write_run(run, partial / f"experiment_{level}.csv")
        write_pages(partial, summary(result), figures, experiment_report(result, figures), pdf=pdf)


def lead_columns(result: ExperimentResult) -> dict[str, Sequence[str | float]]:
    """The columns of the run on the machine's level."""
    return run_columns(result.runs[result.lead])


def run_columns(run: ExperimentRun) -> dict[str, Sequence[str | float]]:
    """Columns of one run: `time_s,state,tension_1_N..tension_7_N,motor_1_position_m,...,motor_2_force_N`."""
    columns: dict[str, Sequence[str | float]] = {
        "time_s": np.round(run.time_s, 12).tolist(),
        "state": run.state_names(),
    }
    columns |= {f"tension_{k + 1}_N": run.tension_N[:, k].tolist() for k in range(SECTIONS)}
    columns |= {f"motor_{k + 1}_position_m": run.position_m[:, k].tolist() for k in (0, 1)}
    return columns | {f"motor_{k + 1}_force_N": run.force_N[:, k].tolist() for k in (0, 1)}


def write_run(run: ExperimentRun, path: Path) -> None:
    """Write one run."""
    columns = run_columns(run)
    write_text(path, csv_text(columns, zip(*columns.values(), strict=True)))


def summary(result: ExperimentResult) -> dict[str, object]:
    """The contents of `summary.json`."""
    lead, measured = result.runs[result.lead], result.measured
    per_level = {
        level: {
            "range_N": run.range_N,
            "relaxation": {state: asdict(value) for state, value in numbers.relaxation(run).items()},
            "transient": {
                done.state.name: asdict(value)
                for done in numbers.reversals(run)
                if (value := numbers.transient(run, done)) is not None
            },
            "two_ended_law": asdict(numbers.law_deviation(run)),
        }
        | ({} if measured is None else {"measured": [asdict(d) for d in numbers.deviations(run, measured)]})
        for level, run in result.runs.items()
    }
    return {
        "schema": 1,
        "scenario": result.scenario.name,
        "level_of_the_machine": result.lead,
        "note": (
            "The paper shows this test in pictures and prints no numbers; its Fig. 7 cannot be read, so the states are "
            "chosen. All levels receive the schedule of the machine's level."
        ),
        **({} if measured is None else {"measured_file": measured.name}),
        "states": [
            {
                "state": done.state.name,
                "purpose": done.state.purpose,
                "motor_1": done.state.modes[0],
                "motor_2": done.state.modes[1],
                "start_s": round(float(lead.time_s[done.first_row]), 9),
                "end_s": round(float(lead.time_s[done.last_row]), 9),
                "ended_by": str(done.state.until) if done.met else "time",
            }
            for done in lead.passes
        ],
        "levels": per_level,
        "largest_switch_percent_of_range": max(map(numbers.largest_switch, result.runs.values())),
        "quasi_static_elastic": {
            "bristle_stiffness_factor": result.quasi_static_factor,
            "two_ended_law": asdict(numbers.law_deviation(result.quasi_static)),
        },
        "refinement": asdict(numbers.refinement(lead, result.fine)),
        "sections": SECTIONS,
        "warnings": numbers.warnings_of(result),
    }


VIEWS = Views(write=write_files, columns=lead_columns, figures=experiment_figures)
