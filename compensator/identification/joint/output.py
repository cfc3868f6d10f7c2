"""Writing what the identification of a joint found: `fitted.toml`, `fit.json`, figures and the suggested routine."""

import os
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.answer.result import estimate_columns
from tendonff.compensator.identification.joint.figures import identification_figures, routine_figure
from tendonff.compensator.identification.joint.fitted import moved_files
from tendonff.compensator.identification.joint.report import identification_report
from tendonff.compensator.identification.joint.result import JointIdentification
from tendonff.compensator.identification.joint.routine import MotorRoutine, suggest_routine
from tendonff.compensator.identification.servo import write_chirp
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.scenario.driven.joint import JointScenario

_CHIRP_RAD = 0.1


def write_files(result: JointIdentification, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `JointIdentification.write`."""
    routine = suggest_routine(result.scenario) if result.described else None
    figures = identification_figures(result, routine)
    with atomic_directory(folder) as partial:
        text = moved_files(result.text, result.asked.source, Path(folder))
        write_text(partial / "fitted.toml", text)
        write_json(partial / "fit.json", result.as_json())
        for name, figure in figures.items():
            save_figure(figure, partial / name, pdf=pdf)
        if routine is not None:
            _write_routine(routine, partial)
        write_report(partial / "report.html", identification_report(result, figures))


def write_routine(scenario: JointScenario, folder: Path, *, pdf: bool = False) -> MotorRoutine:
    """Write a suggested routine for a scenario's motor; makes the folder."""
    routine = suggest_routine(scenario)
    with atomic_directory(folder) as partial:
        _write_routine(routine, partial)
        write_chirp(partial / "suggested_drive.csv", "command_rad", _CHIRP_RAD, 0.0, scenario.run.step_s)
        save_figure(routine_figure(routine), partial / "suggested_motor", pdf=pdf)
    return routine


def _write_routine(routine: MotorRoutine, folder: Path) -> None:
    write_csv(folder / "suggested_motor.csv", {"time_s": routine.time_s, "motor_rad": routine.motor_rad})


VIEWS = Views(
    write=write_files,
    columns=lambda found: estimate_columns(found.estimates),
    figures=lambda found: identification_figures(found, None),
)
