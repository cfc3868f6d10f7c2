"""Model level that a joint needs: every compensator, designed on each level, simulated on every level."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import expectation_of
from tendonff.compensator.compensators.motors.registry import MotorCompensator, chosen, task_of
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.files.notices import by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory
from tendonff.compensator.reporting.page import Report, pictures_of, provenance_of, write_pages
from tendonff.compensator.reporting.plots import figure_style
from tendonff.compensator.reporting.results import Views, register_views
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.studies.compare.figures import errors_figure, matrix_figure
from tendonff.compensator.studies.compare.matrix import (
    REFINEMENTS,
    Entry,
    MatrixData,
    Simple,
    entry_of,
    noise_warnings,
    recommend,
    require_levels,
)
from tendonff.compensator.studies.compare.output import matrix_columns, matrix_summary, write_matrix
from tendonff.compensator.studies.compare.report import CAPTIONS, FILES, matrix_sections
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.tendon.crosscheck import NUDGE

_PLANTS = tuple(level.value for level in Level)
_SIMPLE = (
    Simple(name="linear", words="The ratio alone"),
    Simple(name="static", words="The quasi-static law"),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class JointComparison(MatrixData):
    """A comparison for a joint that can be written.

    Attributes
    ----------
    scenario : JointScenario or FingerScenario
        The scenario it was made for.
    time_s, wanted : numpy.ndarray, shape (n,)
        Reference.
    unit : Unit
        Of the reference and its errors.
    plants : tuple of str
        Names of the plants.
    static : str
        Name of the compensator by the capstan law.
    compensators : tuple of Designed
        In the order in which they are shown.
    entries : tuple of Entry
        Compensator by compensator, design level by design level, plant by plant.
    outputs : dict of tuple[str, Level, str] to numpy.ndarray
        Shape (n,); what is delivered by name of the compensator, design level and plant, at the rows of the reference.
    bands : dict of tuple[str, Level] to ErrorBand
        Errors of each design over what may be the real system, on the most detailed level.
    expectation : Expectation
        Of the designs on the recommended level.
    recommended_level : Level
        Simplest level that is good enough on the most detailed plant.
    recommendation : str
        One sentence.
    warnings : tuple of str
        What the user should know before relying on it, one sentence each.
    """

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `matrix.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = _figures(self)
        with atomic_directory(folder) as partial:
            write_matrix(partial, self)
            summary = {**matrix_summary(self), "warnings": list(self.warnings)}
            write_pages(partial, summary, figures, _report(self, figures), pdf=pdf)


def _figures(result: JointComparison) -> dict[str, Figure]:
    with figure_style():
        return {"matrix": matrix_figure(result), "errors": errors_figure(result)}


register_views(JointComparison, Views(write=JointComparison.write, columns=matrix_columns, figures=_figures))


@in_turn
def compare_joint(
    scenario: JointScenario | FingerScenario,
    *,
    compensators: Sequence[MotorCompensator | str] | None = None,
    progress: Progress = silent,
) -> JointComparison:
    """Compare the fidelity levels with each other on a scenario of driven joints.

    Arguments and errors as of `tendonff.compare`.
    """
    tasks = {level: task_of(scenario, level) for level in Level}
    own = tasks[Level.PRESLIDING]
    tried = chosen(own, compensators)
    require_levels(tried)
    parts = Parts(progress, len(Level) * (len(_PLANTS) + 1))
    commands: dict[tuple[str, Level], FloatArray] = {}
    entries: list[Entry] = []
    outputs: dict[tuple[str, Level, str], FloatArray] = {}
    seen: dict[tuple[bytes, str], tuple[Entry, FloatArray]] = {}
    warnings = list(own.warnings)
    for level, task in tasks.items():
        for each in tried:
            commands[each.name, level] = each.command_rad(task)
        warnings += [f"designed on {level}: {note}" for note in task.notes]
        parts.done()
        for plant in _PLANTS:
            for each in tried:
                command = commands[each.name, level]
                key = (command.tobytes(), plant)
                if key not in seen:  # what does not know the level is simulated once
                    what = f"{each.name} on {plant}"
                    seen[key] = entry_of(
                        _outputs(task, Level(plant), command, what, warnings),
                        task.wanted,
                        scenario.run.step_s,
                        name=each.name,
                        level=level,
                        plant=plant,
                    )
                found, outputs[each.name, level, plant] = seen[key]
                entries.append(replace(found, compensator=each.name, design_level=level, plant_level=plant))
            parts.done()
    bands = own.bands(commands)
    text, best = recommend(entries, tried, bands, str(own.doubt), _SIMPLE, own.unit)
    order = {each.name: k for k, each in enumerate(tried)}
    entries.sort(key=lambda entry: order[entry.compensator])  # stable: levels and plants keep their order
    on_level = {name: band for (name, level), band in bands.items() if level is best}
    return JointComparison(
        scenario=scenario,
        time_s=own.time_s,
        wanted=own.wanted,
        unit=own.unit,
        plants=_PLANTS,
        static="static" if "static" in order else "linear",
        compensators=tried,
        entries=tuple(entries),
        outputs=outputs,
        bands=bands,
        expectation=expectation_of(own.doubt, Level.PRESLIDING, on_level, share_of=own.share_of, unit=own.unit),
        recommended_level=best,
        recommendation=text,
        warnings=by_urgency((*warnings, *noise_warnings(entries))),
    )


def _outputs(
    task: MotorTask, level: Level, command: FloatArray, what: str, warnings: list[str]
) -> Iterator[FloatArray]:
    """Response of a plant with ever larger steps, then to commands that are a little different."""
    for refinement, factor in (*((each, 1.0) for each in REFINEMENTS), (REFINEMENTS[0], 1 + NUDGE)):
        found = task.respond(task.system, factor * command, level=level, refinement=refinement)
        if refinement == REFINEMENTS[0] and factor == 1 and found.slack:
            warnings.append(f"{what}: {found.slack}")
        yield task.values_of(found)


def _report(result: JointComparison, figures: dict[str, Figure]) -> Report:
    return Report(
        title=f"Comparison of levels: {result.scenario.name}",
        summary=f"{result.recommendation} {result.headline}",
        warnings=result.warnings,
        sections=matrix_sections(result, pictures_of(figures, CAPTIONS)),
        provenance=provenance_of(result.scenario, "compare"),
        files=FILES,
    )
