"""Writing what identification found: `fitted.toml`, `fit.json`, figures and the suggested excitation."""

import os
from dataclasses import dataclass
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.figures import draw, draw_suggestion
from tendonff.compensator.identification.report import identification_report
from tendonff.compensator.identification.result import IdentificationData
from tendonff.compensator.identification.suggest import Excitation, suggest
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.scenario.scenario import Scenario, scenario_to_toml


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification(IdentificationData):
    """An identification that can be written.

    Attributes
    ----------
    scenario : Scenario
        The scenario with the identified values.
    asked : Measurement
        How the files were to be read.
    conditions : dict of str to str
        Labels by file name.
    explain : Explain
        Channel that the model explains.
    described : bool
        The chosen law describes the device.
    estimates : tuple of Estimate
        Every value, fitted or kept.
    correlation_names : tuple of str
        Names of the fitted values.
    correlation : Array
        Shape (k, k); correlations of the fitted values.
    laws : tuple of CandidateLaw
        Candidate laws, compared.
    files : tuple of FileResult
        Error and data issues of each file.
    fit_percent, validation_percent : float, float or None
        RMS error over all files of that role in percent of their common range; None without validation files.
    replay_percent : float or None
        RMS error of `scenario`, simulated again over the fitted files, % of range; None where no law describes the
        device.
    sliding : tuple of SlidingRatio
        Logarithmic ratio of the tensions, by direction.
    warnings : tuple of str
        What the user should know.
    comparisons : tuple of PieceComparison
        Measurement and model of each piece.
    inputs : tuple of Path
        The measured files.
    by_file : tuple of ByFile
        Estimates by each of several files alone.
    output_delay_s : float or None
        How much later the output is read than the input.
    sections : tuple of SectionFriction
        Friction between tension cells, where there are more than two.
    comparable : bool
        The tensions are of the scenario's size; else no excitation is suggested.
    """

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, the suggested excitation and `report.html`, all or nothing; makes
        the folder.
        """
        with atomic_directory(folder) as partial:
            write_text(partial / "fitted.toml", scenario_to_toml(self.scenario, folder=folder))
            write_json(partial / "fit.json", self.as_json())
            pictures = draw(self, partial, pdf=pdf)
            if self.comparable:
                pictures["suggested_force"] = _write_excitation(suggest(self.scenario), partial, pdf=pdf)
            write_report(partial / "report.html", identification_report(self, pictures))


def write_suggestion(scenario: Scenario, folder: Path, *, pdf: bool = False) -> Excitation:
    """Write a suggested excitation for a scenario's rig."""
    excitation = suggest(scenario)
    with atomic_directory(folder) as partial:
        _write_excitation(excitation, partial, pdf=pdf)
    return excitation


def _write_excitation(excitation: Excitation, folder: Path, *, pdf: bool) -> Path:
    write_csv(folder / "suggested_force.csv", {"time_s": excitation.time_s, "force_N": excitation.force_N})
    return draw_suggestion(excitation, folder, pdf=pdf)
