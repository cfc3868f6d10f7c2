"""`tendonff design`: the main job."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    YesOption,
    looked_at,
    of_one_joint,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.ocp.integrate.method import Method

if TYPE_CHECKING:
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.joint.scenario.scenario import JointScenario

EXIT_SOLVE = 1  # what was written is the best that was found


def design(
    scenarios: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCENARIO...", help="Scenario file (TOML); of several one report over all.", show_default=False
        ),
    ],
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
    joint between tendons: motor angles that produce the desired joint angle. Several scenarios, a whole hand, get a
    folder each and one report over all.
    """
    if len(scenarios) > 1:
        if online or interactive or check is not None:
            raise InputError("--online, --interactive and --check are for one scenario; design that one alone")
        return _design_all(scenarios, out, strict=strict, pdf=pdf, yes=yes)
    scenario = scenarios[0]
    with opened(scenario, out, strict=strict, yes=yes) as (loaded, folder):
        from tendonff.compensator.scenario.scenario import Scenario

        if not isinstance(loaded, Scenario):
            if online or interactive:
                raise InputError(
                    f"{scenario.name}: --online and --interactive are for the tension of one tendon; leave them out"
                )
            if check is not None:
                of_one_joint(loaded, "--check integrates one tendon or one joint; leave it out")
            return _design_motors(loaded, folder, out, strict=strict, check=check)
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


def _design_all(scenarios: list[Path], out: Path, *, strict: bool, pdf: bool, yes: bool) -> int:
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.studies.design.several import AnyDesign, Designs, require_different

    require_different([path.stem for path in scenarios])
    loaded = [looked_at(path, strict=strict, yes=yes) for path in scenarios]
    with atomic_directory(out) as folder:
        from tendonff.compensator.finger.design import design_motors
        from tendonff.compensator.scenario.scenario import Scenario
        from tendonff.compensator.studies.design.run import design as design_profile

        results: dict[str, AnyDesign] = {}
        for each in loaded:
            with progress(f"designing {each.source.stem}") as advance:
                results[each.source.stem] = (
                    design_profile(each, strict=strict, progress=advance)
                    if isinstance(each, Scenario)
                    else design_motors(each, strict=strict, progress=advance)
                )
        found = Designs(results=results)
        with progress("writing"):
            found.write(folder, pdf=pdf)
    warn(*found.warnings)
    for name, result in results.items():
        say(f"{name}: {result.headline}")
    say(f"report: {out / 'report.html'}")
    usable = all(getattr(result, "is_usable", True) for result in results.values())
    return 0 if usable else EXIT_SOLVE


def _design_motors(
    loaded: "JointScenario | FingerScenario", folder: Path, out: Path, *, strict: bool, check: Method | None
) -> int:
    from tendonff.compensator.finger.design import design_motors
    from tendonff.compensator.joint.design.result import JointDesign

    with progress("designing") as advance:
        result = design_motors(loaded, strict=strict, progress=advance)
    with progress("writing"):
        result.write(folder)
    warn(*result.warnings)
    say(result.headline, result.fine_print)
    if isinstance(result, JointDesign) and result.feedback is not None:
        say(result.feedback.sentence)
    say(f"report: {out / 'report.html'}")
    if check is not None and isinstance(result, JointDesign):
        from tendonff.compensator.joint.design.check import check_joint_design

        with progress(f"simulating by {check}"):
            sentence = check_joint_design(result, check).sentence
        say(sentence)
    return 0
