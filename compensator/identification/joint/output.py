"""Writing what the identification of a joint found: `fitted.toml`, `fit.json`, figures and the suggested routine."""

import os
from dataclasses import dataclass
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.joint.figures import identification_figures, routine_figure
from tendonff.compensator.identification.joint.fitted import moved_files
from tendonff.compensator.identification.joint.report import identification_report
from tendonff.compensator.identification.joint.result import JointIdentificationData
from tendonff.compensator.identification.joint.routine import MotorRoutine, suggest_routine
from tendonff.compensator.joint.scenario import JointScenario, parse_joint_scenario
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.plots import save_figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointIdentification(JointIdentificationData):
    """An identification that can be written.

    Attributes
    ----------
    asked : JointScenario
        The scenario whose joint was to be identified.
    text : str
        `fitted.toml`: the scenario with the identified values.
    law : str
        Name of the chosen law.
    sensor : SensorFit or None
        Virtual sensor of the joint's angle, where an encoder was logged and the law does not describe the device.
    torque : TorqueFit or None
        Its torque by the same, where that was logged too.
    described : bool
        Whether the law describes the device.
    estimates : tuple of Estimate
        Numbers of the scenario, then what follows from them.
    looks : tuple of FirstLook
        Closed forms of each file.
    comparisons : tuple of JointComparison
        Measurement and model of each file.
    laws : tuple of (str, float, bool)
        Effects that were tried: name, gain of log-likelihood that each promised, and whether it was taken up.
    correlation_names, correlation : tuple of str and ndarray, shape (k, k)
        Of the fitted values.
    values : mapping
        Fitted values by number.
    warnings : tuple of str
        What the user should know.
    inputs : tuple of Path
        The measured files.
    """

    @property
    def scenario(self) -> JointScenario:
        """The scenario with what was identified put in."""
        return parse_joint_scenario(self.text, self.asked.source)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, the suggested routine and `report.html`, all or nothing; makes the
        folder.
        """
        routine = suggest_routine(self.scenario) if self.described else None
        figures = identification_figures(self, routine)
        with atomic_directory(folder) as partial:
            text = moved_files(self.text, self.asked.source, Path(folder))
            write_text(partial / "fitted.toml", text)
            write_json(partial / "fit.json", self.as_json())
            for name, figure in figures.items():
                save_figure(figure, partial / name, pdf=pdf)
            if routine is not None:
                _write_routine(routine, partial)
            write_report(partial / "report.html", identification_report(self, figures))


def write_routine(scenario: JointScenario, folder: Path, *, pdf: bool = False) -> MotorRoutine:
    """Write a suggested routine for a scenario's motor; makes the folder."""
    routine = suggest_routine(scenario)
    with atomic_directory(folder) as partial:
        _write_routine(routine, partial)
        save_figure(routine_figure(routine), partial / "suggested_motor", pdf=pdf)
    return routine


def _write_routine(routine: MotorRoutine, folder: Path) -> None:
    write_csv(folder / "suggested_motor.csv", {"time_s": routine.time_s, "motor_rad": routine.motor_rad})
