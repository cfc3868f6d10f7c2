"""Writing what identification found: `fitted.toml`, `fit.json`, figures and the suggested excitation."""

from collections.abc import Sequence
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.figures import draw, draw_suggestion
from tendonff.compensator.identification.report import identification_report
from tendonff.compensator.identification.result import Identification
from tendonff.compensator.identification.suggest import Excitation, suggest
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.scenario.scenario import Scenario, scenario_to_toml


def write_identification(found: Identification, folder: Path, inputs: Sequence[Path] = ()) -> None:
    """Write every result, or nothing.

    Parameters
    ----------
    found : Identification
    folder : Path
    inputs : sequence of Path, optional
        The measured files, which the report names with their hashes.
    """
    with atomic_directory(folder) as partial:
        write_text(partial / "fitted.toml", scenario_to_toml(found.scenario, folder=folder))
        write_json(partial / "fit.json", found.as_json())
        draw(found, partial)
        if found.comparable:
            _write_excitation(suggest(found.scenario), partial)
        write_report(partial / "report.html", identification_report(found, partial, inputs))


def write_suggestion(scenario: Scenario, folder: Path) -> Excitation:
    """Write a suggested excitation for a scenario's rig.

    Parameters
    ----------
    scenario : Scenario
    folder : Path
    """
    excitation = suggest(scenario)
    with atomic_directory(folder) as partial:
        _write_excitation(excitation, partial)
    return excitation


def _write_excitation(excitation: Excitation, folder: Path) -> None:
    write_csv(folder / "suggested_force.csv", {"time_s": excitation.time_s, "force_N": excitation.force_N})
    draw_suggestion(excitation, folder)
