"""The paper's experiment: ten states, two motors, seven tensions, three models.

Rooms: `experiment_machine` (the states as data), `experiment_rig` (two motors on the chain), `experiment_run` (the
machine on one level, its schedule on the others), `experiment_numbers` and `experiment_figures` (what they show).
"""

from pathlib import Path

import numpy as np

from tendonff.compensator.experiment.machine import plan_experiment
from tendonff.compensator.experiment.numbers import summary_of
from tendonff.compensator.experiment.run import SECTIONS, ExperimentResult, ExperimentRun, run_experiment
from tendonff.compensator.files.writing import atomic_directory, atomic_file, write_json
from tendonff.compensator.scenario.scenario import Scenario

__all__ = ["ExperimentResult", "ExperimentRun", "experiment", "write_experiment"]


def experiment(scenario: Scenario) -> ExperimentResult:
    """Run the two-motor test of a scenario on the three levels.

    Parameters
    ----------
    scenario : Scenario
        Its [experiment] table may be missing.

    Raises
    ------
    InputError
        The table asks for tensions or rates beyond the actuator's.
    SolveError
        A step could not be solved.
    """
    return run_experiment(plan_experiment(scenario), scenario.run.level, scenario.experiment.fine_segments)


def write_experiment(result: ExperimentResult, folder: Path, scenario: Scenario) -> dict[str, object]:
    """Write `experiment_<level>.csv`, `summary.json`, the figures and `report.html`, all or nothing.

    Parameters
    ----------
    result : ExperimentResult
    folder : Path
    scenario : Scenario
        That it was made for.

    Returns
    -------
    dict
        Contents of `summary.json`.
    """
    from tendonff.compensator.experiment.figures import experiment_figures
    from tendonff.compensator.experiment.report import experiment_report
    from tendonff.compensator.reporting.page import write_report
    from tendonff.compensator.reporting.plots import save_figure

    summary = summary_of(result, scenario.name)
    figures = experiment_figures(result)
    with atomic_directory(folder) as partial:
        for level, run in result.runs.items():
            write_run(run, partial / f"experiment_{level}.csv")
        for name, figure in figures.items():
            save_figure(figure, partial / name)
        write_report(partial / "report.html", experiment_report(result, scenario, figures))
        write_json(partial / "summary.json", summary)
    return summary


def write_run(run: ExperimentRun, path: Path) -> None:
    """Write one run: `time_s,state,tension_1_N..tension_7_N,motor_1_position_m,...,motor_2_force_N`.

    Parameters
    ----------
    run : ExperimentRun
    path : Path
    """
    import pandas as pd

    columns: dict[str, object] = {"time_s": np.round(run.time_s, 12), "state": run.state_names()}
    columns |= {f"tension_{k + 1}_N": run.tension_N[:, k] for k in range(SECTIONS)}
    columns |= {f"motor_{k + 1}_position_m": run.position_m[:, k] for k in (0, 1)}
    columns |= {f"motor_{k + 1}_force_N": run.force_N[:, k] for k in (0, 1)}
    with atomic_file(path) as partial:
        pd.DataFrame(columns).to_csv(partial, index=False, lineterminator="\n")
