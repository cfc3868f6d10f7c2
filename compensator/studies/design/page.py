"""The page of a design, one for every kind of scenario: a further section for all stands here."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from tendonff.compensator.feedback.report import feedback_section
from tendonff.compensator.reporting.page import (
    Block,
    FileNote,
    Interactive,
    Picture,
    Report,
    Section,
    provenance_of,
)

if TYPE_CHECKING:  # one kind of design needs nothing of the other
    from tendonff.compensator.studies.design.motors.result import MotorDesign
    from tendonff.compensator.studies.design.result import Design


def design_page(
    result: "Design | MotorDesign",
    pictures: Mapping[str, Picture],
    view: Interactive | None,
    *,
    first: Section,
    robustness: Sequence[Block],
    own: Sequence[Section],
    fine_print: str,
    files: tuple[str, str],
) -> Report:
    """The page: what to expect, what all designs have, then the sections of its own.

    `files` are the contents of profile.csv and summary.json in words.
    """
    return Report(
        title=f"Design: {result.scenario.name}",
        summary=result.headline,
        fine_print=fine_print,
        warnings=result.warnings,
        sections=(
            first,
            *([] if view is None else [Section(title="Interactive view", blocks=(view,))]),
            Section(title="Robustness to parameter uncertainty", blocks=tuple(robustness)),
            *([] if result.feedback is None else [feedback_section(result.feedback, pictures)]),
            *own,
        ),
        provenance=provenance_of(result.scenario, "design"),
        files=tuple(
            FileNote(name=name, content=content)
            for name, content in zip(("profile.csv", "summary.json"), files, strict=True)
        ),
    )
