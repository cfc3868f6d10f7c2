"""`tendonff design`: the main job."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.ocp.integrate.method import Method

EXIT_SOLVE = 1  # what was written is the best that was found


def design(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("out"),
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a reference out of reach instead of coming closest to it.")
    ] = False,
    online: Annotated[
        bool, typer.Option("--online", help="Also draw and pick the filter of a reference that arrives live.")
    ] = False,
    interactive: Annotated[
        bool, typer.Option("--interactive", help="Put a view that zooms into the report; needs Bokeh, 1 MB more.")
    ] = False,
    pdf: PdfOption = False,
    check: Annotated[
        Method | None,
        option("--check", None, "Simulate the recommended profile by this method too and state the difference."),
    ] = None,
    yes: YesOption = False,
) -> int:
    """Design and verify the force, or the motor angle of a joint.

    Computes force profiles that produce the desired output tension, by every compensator, and simulates each. For a
    joint between tendons: motor angles that produce the desired joint angle.
    """
    with opened(scenario, out, strict=strict, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        study_online = door.function_of("online", loaded)(loaded) if online else None
        if check is not None:
            door.function_of("check", loaded)
        with progress("designing") as advance:
            result = door.design(loaded, strict=strict, progress=advance)
        with progress("writing"):
            result.write(folder, interactive=interactive, pdf=pdf)
        if study_online is not None:
            with progress("filters of a live reference"):
                study = study_online(result)
                study.write(folder, pdf=pdf)
            say(study.sentence)
    warn(*result.warnings)
    door.show(result, out)
    if check is not None:
        with progress(f"simulating by {check}"):
            sentence = door.check(result, check).sentence
        say(sentence)
    return 0 if result.is_usable else EXIT_SOLVE
