"""`tendonff design`: the main job."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
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
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if is_joint_file(scenario):
        return _design_joint(scenario, out, strict=strict, online=online or interactive, check=check, yes=yes)
    with opened(scenario, out, strict=strict, yes=yes) as (loaded, folder):
        from tendonff.compensator.studies.design.output import print_scores
        from tendonff.compensator.studies.design.run import design as design_profile

        if online:
            from tendonff.compensator.studies.design.online import require_path_at_rest, study_online

            require_path_at_rest(loaded)
        with progress("designing") as advance:
            result = design_profile(loaded, strict=strict, progress=advance)
        with progress("writing"):
            result.write(folder, interactive=interactive, pdf=pdf)
        if online:
            with progress("filters of a live reference"):
                optimum = result.on_level("optimal", result.level).score.rmse_percent_of_range
                study = study_online(loaded, optimum)
                study.write(folder, pdf=pdf)
            say(study.sentence)
    warn(*result.warnings)
    print_scores(result, out)
    if check is not None:
        from tendonff.compensator.studies.design.check import check_design

        with progress(f"simulating by {check}"):
            sentence = check_design(result, check).sentence
        say(sentence)
    return 0 if result.is_usable else EXIT_SOLVE


def _design_joint(scenario: Path, out: Path, *, strict: bool, online: bool, check: Method | None, yes: bool) -> int:
    if online:
        raise InputError(
            f"{scenario.name}: --online and --interactive are for the tension of one tendon; leave them out"
        )
    loaded = joint_looked_at(scenario, yes=yes)
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.joint.design.run import design_joint

    with atomic_directory(out) as folder:
        with progress("designing") as advance:
            result = design_joint(loaded, strict=strict, progress=advance)
        with progress("writing"):
            result.write(folder)
    warn(*result.warnings)
    say(result.headline, result.fine_print, f"report: {out / 'report.html'}")
    if check is not None:
        from tendonff.compensator.joint.design.check import check_joint_design

        with progress(f"simulating by {check}"):
            sentence = check_joint_design(result, check).sentence
        say(sentence)
    return 0
