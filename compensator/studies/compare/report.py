"""The report of a comparison."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from tendonff.compensator.reporting.page import (
    Block,
    FileNote,
    Picture,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)
from tendonff.compensator.studies.compare.figures import cell_texts
from tendonff.compensator.studies.compare.matrix import Designed
from tendonff.compensator.studies.compare.result import Comparison
from tendonff.models.fidelity import Level

_CAPTIONS = {
    "matrix": "RMS error of every design on every plant, % of reference range; dark is bad. Read along a row: what a "
    "design costs on a plant that it was not made for.",
    "errors": "Below: errors of the exact inverse designed on each level, and of the capstan law, on the most detailed "
    "plant; bottom: enlarged.",
    "levels": "Left: output over force in a slow cycle; the width of the loop is friction, its corners are the "
    "reversals. Right: stress relaxation while the actuator holds its position.",
    "bode": "From small changes of the force to small changes of the output tension, around rest. A sticking tendon "
    "transmits little of a small change: the gain is far below 1.",
}


def _expected(result: Comparison) -> Table:
    """Worst error of every design over what may be the real system."""
    first = next(iter(Level))

    def worst(c: Designed, level: Level) -> float | None:
        band = result.bands.get((c.name, level))
        return band.worst.rmse_percent_of_range if band and (c.knows_the_level or level is first) else None

    return Table(
        caption=f"Worst RMS error on the presliding level, % of reference range, for {result.expectation.doubt}",
        columns=("profile", *(f"designed on {level}" for level in Level)),
        rows=[(c.label, *(worst(c, level) for level in Level)) for c in result.compensators],
        one_quantity=True,
    )


def _matrix_sections(
    result: Comparison, pictures: Mapping[str, Picture], more: Sequence[Block] = ()
) -> tuple[Section, ...]:
    """Sections of every comparison: expected errors with more below them, matrix, errors over time."""
    rows, unit = result.rows, result.unit
    heads = ("design", *(f"on {plant}" for plant in result.plants))
    errors = Table(
        caption="RMS error, % of reference range (± spread)",
        columns=heads,
        rows=[(label, *texts) for (label, _), texts in zip(rows, cell_texts(result), strict=True)],
    )
    peaks = Table(
        caption=f"Largest error [{unit.shown}] and lag [ms]",
        columns=heads,
        rows=[
            (label, *(f"{unit.factor * e.peak_error:.2f} {unit.shown}, {_milliseconds(e.lag_s)}" for e in row))
            for label, row in rows
        ],
    )
    static = ", the capstan law included" if len(result.plants) > len(Level) else ""
    text = Text(
        f"A design is a profile made with one model; a plant is the model that it is simulated on{static}, here with "
        "the scenario's own parameters. Each simulation takes a quarter of the step, so that no design profits from "
        "sharing its plant's rounding; the spread is the largest RMS difference to simulations with half the step, "
        "the whole step, and a profile that differs in the ninth digit. Errors that differ by less than their spreads "
        "are equal."
    )
    return (
        Section(title="What to expect on a rig", blocks=(_expected(result), *more)),
        Section(title="Every design on every plant", blocks=(text, pictures["matrix"], errors, peaks)),
        Section(title="Errors over time", blocks=(pictures["errors"],)),
    )


def compare_report(result: Comparison, figures: dict[str, Figure]) -> Report:
    """The page of a comparison."""
    joints, moving = "", []
    if result.ignored is not None:
        joints = " Second panel: the joint angles."
        note = "The capstan law as a plant takes the wrap angles with all joints at zero."
        moving = [Text(f"{result.ignored.text} {note}")]
    pictures = pictures_of(figures, {**_CAPTIONS, "errors": _CAPTIONS["errors"] + joints})
    return Report(
        title=f"Comparison of levels: {result.scenario.name}",
        summary=f"{result.recommendation} {result.headline}",
        warnings=result.warnings,
        sections=(
            *_matrix_sections(result, pictures, moving),
            *(_level_sections(result, pictures) if result.traits else ()),
        ),
        provenance=provenance_of(result.scenario, "compare"),
        files=(
            FileNote(name="matrix.csv", content="the matrix, one row for each design and plant"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )


def _level_sections(result: Comparison, pictures: Mapping[str, Picture]) -> tuple[Section, ...]:
    """Differences between the levels."""
    differences = Table(
        caption="Traits of the levels",
        columns=("level", "deadband [N]", "width of a reversal [N]", "loop area [%]", "relaxation in a hold [%]"),
        rows=[
            (name, t.deadband_N, t.reversal_width_N, t.loop_area_percent, max(round(t.relaxation_percent, 6), 0.0))
            for name, t in result.traits.items()
        ],
    )
    return (
        Section(
            title="How the levels differ",
            blocks=(
                pictures["levels"],
                differences,
                Text(
                    "Deadband: how far the force falls after pulling before the output follows. Width of a "
                    "reversal: how much further until it follows at its full rate; 0 is a corner. Loop area: of "
                    "the rectangle around the loop. Relaxation in a hold: fall of the tension at the actuator "
                    "while its position is held."
                ),
                pictures["bode"],
            ),
        ),
    )


def _milliseconds(time_s: float) -> str:
    return f"{round(1e3 * time_s)} ms".replace("-", "\N{MINUS SIGN}")
