"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.models.fidelity import Level

ScenarioArgument = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (TOML).", show_default=False)]
LevelOption = Annotated[
    Level | None,
    typer.Option("--level", help="Fidelity level of the chain; default: the scenario's own.", show_default=False),
]
OutFolderOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for the results.", show_default=False)
]
