"""`tendonff new`: a commented scenario to start from."""

from pathlib import Path
from typing import Annotated

import typer


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Scenario file to write.", show_default=False)],
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
) -> None:
    """Write a commented scenario to start from."""
    from importlib.resources import files

    from tendonff.compensator.files.reading import InputError
    from tendonff.compensator.files.writing import write_text

    if file.exists() and not force:
        raise InputError(f"{file} exists; choose another name, or replace it with --force")
    template = files("tendonff.compensator.scenario").joinpath("scenario.toml").read_text(encoding="utf-8")
    write_text(file, template)
