"""`tendonff design`: the main job."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    YesOption,
    looked_at,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.ocp.integrate.method import Method

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
        if interactive or check is not None:
            raise InputError("--interactive and --check are for one scenario; design that one alone")
        return _design_all(scenarios, out, strict=strict, pdf=pdf, yes=yes)
    scenario = scenarios[0]
    with opened(scenario, out, strict=strict, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        with progress("designing") as advance:
            result = door.design(loaded, strict=strict, progress=advance)
        with progress("writing"):
            result.write(folder, interactive=interactive, pdf=pdf)
    warn(*result.warnings)
    result.show(out)
    if check is not None:
        with progress(f"simulating by {check}"):
            sentence = result.check(check).sentence
        say(sentence)
    return 0 if result.is_usable else EXIT_SOLVE


def _design_all(scenarios: list[Path], out: Path, *, strict: bool, pdf: bool, yes: bool) -> int:
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.studies.design.several import Designs, require_different

    require_different([path.stem for path in scenarios])
    loaded = [looked_at(path, strict=strict, yes=yes) for path in scenarios]
    with atomic_directory(out) as folder:
        from tendonff.compensator import door

        results = {}
        for each in loaded:
            with progress(f"designing {each.source.stem}") as advance:
                results[each.source.stem] = door.design(each, strict=strict, progress=advance)
        found = Designs(results=results)
        with progress("writing"):
            found.write(folder, pdf=pdf)
    warn(*found.warnings)
    for name, result in results.items():
        say(f"{name}: {result.headline}")
    say(f"report: {out / 'report.html'}")
    return 0 if all(result.is_usable for result in results.values()) else EXIT_SOLVE
