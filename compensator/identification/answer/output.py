"""Writing what identification found: `fitted.toml`, `fit.json`, figures and the suggested excitation."""

import os
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.answer.figures import draw, draw_suggestion, identification_figures
from tendonff.compensator.identification.answer.report import identification_report
from tendonff.compensator.identification.answer.result import Identification, estimate_columns
from tendonff.compensator.identification.servo import write_chirp
from tendonff.compensator.identification.suggest import Excitation, suggest
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.scenario.sampled.sampling import initial_tension
from tendonff.compensator.scenario.scenario import Scenario, scenario_to_toml
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain

_CHIRP = 0.25  # amplitude of a chirp of the drive, over the tension at rest
_CHIRP_STEP_S = 2e-3


def write_files(result: Identification, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `Identification.write`."""
    with atomic_directory(folder) as partial:
        write_text(partial / "fitted.toml", scenario_to_toml(result.scenario, folder=folder))
        write_json(partial / "fit.json", result.as_json())
        pictures = draw(result, partial, pdf=pdf)
        if result.comparable:
            pictures["suggested_force"] = _write_excitation(suggest(result.scenario), partial, pdf=pdf)
        write_report(partial / "report.html", identification_report(result, pictures))


def write_suggestion(scenario: Scenario, folder: Path, *, pdf: bool = False) -> Excitation:
    """Write a suggested excitation for a scenario's rig."""
    excitation = suggest(scenario)
    with atomic_directory(folder) as partial:
        _write_excitation(excitation, partial, pdf=pdf)
        _write_chirp(scenario, partial)
    return excitation


def _write_chirp(scenario: Scenario, folder: Path) -> None:
    """Write a chirp of the drive alone, from which a log of command and answer tells its lag and delay."""
    t, tension = scenario.transmission, initial_tension(scenario)
    step = min(scenario.run.step_s, _CHIRP_STEP_S)
    if t.actuator.drive is Drive.POSITION:
        size = _CHIRP * tension * Chain.of(t, scenario.run.level).rest_state(1.0).near_position_m
        write_chirp(folder / "suggested_drive.csv", "command_m", size, 0.0, step)
    else:
        write_chirp(folder / "suggested_drive.csv", "command_N", _CHIRP * tension, tension, step)


def _write_excitation(excitation: Excitation, folder: Path, *, pdf: bool) -> Path:
    write_csv(folder / "suggested_force.csv", {"time_s": excitation.time_s, "force_N": excitation.force_N})
    return draw_suggestion(excitation, folder, pdf=pdf)


VIEWS = Views(
    write=write_files,
    columns=lambda found: estimate_columns(found.estimates),
    figures=identification_figures,
)
