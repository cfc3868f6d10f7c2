"""Writing what the identification of joints found: `fitted.toml`, `fit.json`, figures, report, suggested routines."""

import os
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.answer.result import estimate_columns
from tendonff.compensator.identification.motors.figures import identification_figures, routine_figure, routines_figure
from tendonff.compensator.identification.motors.fitted import moved_files
from tendonff.compensator.identification.motors.loop_routine import MotorRoutine, is_loop, suggest_routine
from tendonff.compensator.identification.motors.report import identification_report
from tendonff.compensator.identification.motors.result import MotorsIdentification
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.identification.motors.run import suggest_motor_routine
from tendonff.compensator.identification.servo import write_chirp
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario

_CHIRP_RAD = 0.1


def write_files(result: MotorsIdentification, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `MotorsIdentification.write`."""
    fitted = result.scenario
    routine = suggest_routine(fitted) if result.described and is_loop(fitted.mechanism) else None  # type: ignore[arg-type]
    figures = identification_figures(result, routine)
    with atomic_directory(folder) as partial:
        write_text(partial / "fitted.toml", moved_files(result.text, result.asked.source, Path(folder)))
        write_json(partial / "fit.json", result.as_json())
        for name, figure in figures.items():
            save_figure(figure, partial / name, pdf=pdf)
        if routine is not None:
            _write_motor(routine, partial)
        write_report(partial / "report.html", identification_report(result, figures))


def write_routine(
    scenario: JointScenario | FingerScenario, folder: Path, *, pdf: bool = False
) -> MotorRoutine | MotorsRoutine:
    """Write suggested motor angles; makes the folder."""
    routine = suggest_motor_routine(scenario)
    with atomic_directory(folder) as partial:
        if isinstance(routine, MotorRoutine):
            _write_motor(routine, partial)
            write_chirp(partial / "suggested_drive.csv", "command_rad", _CHIRP_RAD, 0.0, scenario.run.step_s)
            save_figure(routine_figure(routine), partial / "suggested_motor", pdf=pdf)
            return routine
        columns = {"time_s": routine.time_s}
        columns |= {f"motor_{name}_rad": angle for name, angle in zip(routine.names, routine.motor_rad.T, strict=True)}
        write_csv(partial / "suggested_motors.csv", columns)
        save_figure(routines_figure(routine), partial / "suggested_motors", pdf=pdf)
    return routine


def _write_motor(routine: MotorRoutine, folder: Path) -> None:
    write_csv(folder / "suggested_motor.csv", {"time_s": routine.time_s, "motor_rad": routine.motor_rad})


VIEWS = Views(
    write=write_files,
    columns=lambda found: estimate_columns(found.estimates),
    figures=lambda found: identification_figures(found, None),
)
