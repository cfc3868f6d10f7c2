"""Writing what identification found, and what it suggests to log."""

import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.answer.figures import identification_figures, routine_figure
from tendonff.compensator.identification.answer.report import identification_report
from tendonff.compensator.identification.answer.result import AnyIdentification
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.loop_routine import MotorRoutine
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.identification.servo import write_chirp
from tendonff.compensator.identification.suggest import Excitation
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.scenario.sampled.sampling import initial_tension
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.works import function_of
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain

Routine: TypeAlias = Excitation | MotorRoutine | MotorsRoutine

_CHIRP = 0.25  # amplitude of a chirp of the drive, over the tension at rest
_CHIRP_STEP_S = 2e-3
_CHIRP_RAD = 0.1


def _suggested(routine: Routine) -> tuple[str, dict[str, Array], Figure]:
    """Name of the files of a routine, the columns of its table, and its figure."""
    columns: dict[str, Array]
    axes: dict[str, dict[str, Array]]
    if isinstance(routine, Excitation):
        name, columns = "suggested_force", {"force_N": routine.force_N}
        axes = {"actuator force [N]": {"force": routine.force_N}}
    elif isinstance(routine, MotorRoutine):
        name, columns = "suggested_motor", {"motor_rad": routine.motor_rad}
        joint, torque = routine.expected.angle_rad[:, 0], routine.expected.torque_N_m[:, 0]
        axes = {"angle [rad]": {"motor": routine.motor_rad, "joint, expected": joint}}
        axes["expected torque [N m]"] = {"torque": torque}
    else:
        motors = dict(zip(routine.names, routine.motor_rad.T, strict=True))
        name, columns = "suggested_motors", {f"motor_{motor}_rad": angle for motor, angle in motors.items()}
        axes = {"motor angle [rad]": motors}
        axes["joint angle [rad]"] = dict(zip(routine.joints, routine.joint_rad.T, strict=True))
    figure = routine_figure(routine.time_s, axes, routine.parts)
    return name, {"time_s": routine.time_s, **columns}, figure


def write_files(result: AnyIdentification, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `Identification.write`."""
    figures, tables = identification_figures(result), dict[str, dict[str, Array]]()
    if result.suggests:
        name, tables[name], figures[name] = _suggested(function_of("suggest", result.scenario)(result.scenario))
    with atomic_directory(folder) as partial:
        write_text(partial / "fitted.toml", result.scenario.text_in(folder))
        write_json(partial / "fit.json", result.as_json())
        files = {figure: save_figure(figure, partial / name, pdf=pdf)[0] for name, figure in figures.items()}
        for name, columns in tables.items():
            write_csv(partial / f"{name}.csv", columns)
        write_report(partial / "report.html", identification_report(result, figures), files)


def write_suggestion(scenario: Any, folder: Path, *, pdf: bool = False) -> Routine:
    """Write what a scenario suggests to command for a log, and a chirp for each drive; makes the folder."""
    routine: Routine = function_of("suggest", scenario)(scenario)
    name, columns, figure = _suggested(routine)
    with atomic_directory(folder) as partial:
        write_csv(partial / f"{name}.csv", columns)
        save_figure(figure, partial / name, pdf=pdf)
        if isinstance(routine, Excitation):
            _write_chirp(scenario, partial)
        elif isinstance(routine, MotorRoutine):
            write_chirp(partial / "suggested_drive.csv", "command_rad", _CHIRP_RAD, 0.0, scenario.run.step_s)
    return routine


def _write_chirp(scenario: Scenario, folder: Path) -> None:
    """Write a chirp of the drive alone, from which a log of command and answer tells its lag and delay."""
    t, tension = scenario.transmission, initial_tension(scenario)
    step = min(scenario.run.step_s, _CHIRP_STEP_S)
    if t.actuator.drive is Drive.POSITION:
        size = _CHIRP * tension * Chain.of(t, scenario.run.level).rest_state(1.0).near_position_m
        write_chirp(folder / "suggested_drive.csv", "command_m", size, 0.0, step)
    else:
        write_chirp(folder / "suggested_drive.csv", "command_N", _CHIRP * tension, tension, step)


def _columns(found: AnyIdentification) -> dict[str, list[object]]:
    """Every estimate: value, ends of its 95 % interval, and where the value comes from."""
    names = ("name", "value", "unit", "identifiable", "fitted", "scenario", "reason")
    columns: dict[str, list[object]] = {name: [getattr(each, name) for each in found.estimates] for name in names}
    low, high = np.array([each.interval or (np.nan, np.nan) for each in found.estimates]).T
    return columns | {"low_95": low.tolist(), "high_95": high.tolist()}


VIEWS = Views(write=write_files, columns=_columns, figures=identification_figures)
"""`identify`: numbers with confidence intervals, of one tendon or of the motors of any mechanism."""
