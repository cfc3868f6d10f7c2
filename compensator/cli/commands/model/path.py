"""`tendonff path`: sections from the points of a centreline."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import OutFolderOption, PdfOption
from tendonff.compensator.cli.progress import say, warn


def path(
    points: Annotated[
        Path,
        typer.Argument(
            metavar="POINTS.csv", help="Columns x_m,y_m,z_m (or x_mm, ...) along the tendon.", show_default=False
        ),
    ],
    out: OutFolderOption = Path("path"),
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", metavar="RAD", help="Largest error of the angle up to any place by the sections."),
    ] = 0.05,
    pdf: PdfOption = False,
) -> None:
    """Find the wrap angles of a measured path.

    Its sections, with lengths, angles and intervals, to paste into a scenario.
    """
    from tendonff.compensator.files.writing import atomic_directory

    with atomic_directory(out) as folder:
        from tendonff.compensator.identification.measured.centreline.run import read_centreline

        result = read_centreline(points, tolerance_rad=tolerance)
        result.write(folder, pdf=pdf)
    say(*result.notes)
    warn(*result.warnings)
    typer.echo(result.toml(), nl=False)
    say(
        f"wrap angle {result.angle_rad:.4g} +- {result.uncertainty_rad:.2g} rad over {result.length_m[-1]:.4g} m in "
        f"{len(result.stretches)} sections; points scatter by {1000 * result.noise_m:.2g} mm, which had added "
        f"{result.inflation_rad:.2g} rad"
    )
