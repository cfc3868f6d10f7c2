"""`tendonff sweep`: designs and scores over a grid, or over units that differ."""

import math
from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    CompensatorsOption,
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    looked_at,
    names_of,
    option,
)
from tendonff.compensator.cli.progress import progress, say


def sweep(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("sweep"),
    over: Annotated[
        list[str] | None, option("--over", "KEY=FROM:TO:COUNT", "Vary a key of the scenario; may be repeated.")
    ] = None,
    samples: Annotated[
        int, typer.Option("--samples", metavar="N", min=0, help="Try the design on so many units drawn at random.")
    ] = 0,
    source: Annotated[
        str, typer.Option("--from", metavar="TABLE", help="Where the units' uncertainty is stated: robust.")
    ] = "robust",
    compensators: CompensatorsOption = None,
    scheduler: Annotated[
        str | None,
        option(
            "--scheduler",
            "ADDRESS",
            "Dask cluster to compute on, one you trust: jobs are pickled; default: here.",
        ),
    ] = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write the samples as a Parquet file too.")] = False,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Try a design on units that differ, or design over a grid.

    Started again on the same folder, it goes on where it was stopped.
    """
    if source != "robust":
        raise typer.BadParameter(f'must be "robust", got "{source}"', param_hint="--from")
    loaded = looked_at(scenario, yes=yes)
    from tendonff.compensator.files.interrupts import Interrupted
    from tendonff.compensator.files.writing import require_parquet
    from tendonff.compensator.studies.design.sweep.plan import Axis
    from tendonff.compensator.studies.design.sweep.result import kept_rows
    from tendonff.compensator.studies.design.sweep.run import executor_of
    from tendonff.compensator.studies.design.sweep.run import sweep as run_sweep

    if parquet:
        require_parquet()
    axes = [Axis.parse(text) for text in over or []]
    try:
        with executor_of(scheduler) as executor, progress("sweeping") as advance:
            result = run_sweep(
                loaded,
                out,
                over=axes,
                samples=samples,
                compensators=names_of(compensators) or (),
                executor=executor,
                progress=advance,
            )
            result.write(out, parquet=parquet, pdf=pdf)
    except KeyboardInterrupt:
        if not (kept := kept_rows(out)):
            raise
        units = samples or math.prod(len(axis.values) for axis in axes)
        raise Interrupted(f"{kept} of {units} units kept in {out}; start again to go on") from None
    say(result.headline)
    for name in result.compensators:
        say(
            f"{name}: error below 1 % of range in {100 * result.yield_of(name, 1.0):.3g} % of {len(result.rows)}, "
            f"below {max(result.quantiles(name)[-2], 1e-3):.3g} % in 95 %"
        )
