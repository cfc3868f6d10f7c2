"""`tendonff new`: a commented scenario to start from."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import option
from tendonff.compensator.files.text import InputError, require_suffix


class Rig(StrEnum):
    """Rigs with a scenario of their own to start from."""

    TENDON = "tendon"
    BOWDEN = "bowden"
    SURGICAL = "surgical"
    EXOSUIT = "exosuit"
    HAND = "hand"
    INSTRUMENT = "instrument"
    FINGER = "finger"
    UNDERACTUATED = "underactuated"


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Scenario file to write.", show_default=False)],
    rig: Annotated[Rig | None, option("--for", None, "Rig whose usual ranges of values the file gives.")] = None,
    joint: Annotated[
        str | None, option("--joint", "NAME", "Name of the joint of a hand or an instrument; default: the rig's own.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
) -> None:
    """Write a commented scenario to start from, and a drawing of what it describes (FILE.svg)."""
    from importlib.resources import files

    from tendonff.compensator.files.writing import write_text
    from tendonff.compensator.reporting.drawing import described_figure
    from tendonff.compensator.reporting.plots import save_figure
    from tendonff.compensator.scenarios import parse_any

    require_suffix(file, ".toml")
    for target in (file, file.with_suffix(".svg")):
        if target.exists() and not force:
            raise InputError(f"{target} exists; choose another name, or replace it with --force")
    folder = files("tendonff.compensator.scenario")
    template = folder.joinpath("scenario.toml") if rig is None else folder.joinpath("templates", f"{rig}.toml")
    text = template.read_text(encoding="utf-8")
    if joint is not None:
        if rig not in (Rig.HAND, Rig.INSTRUMENT):
            raise InputError("--joint is for --for hand and --for instrument: the other rigs have none or several")
        if not joint.isidentifier():
            raise InputError(f'--joint must be letters, digits and underscores, got "{joint}"; --joint index_base')
        text = re.sub(r"^\[joints\.\w+\]", f"[joints.{joint}]", text, flags=re.MULTILINE)
        text = re.sub(r'^name = "(.*)"', f'name = "{joint}, \\1"', text, count=1, flags=re.MULTILINE)
    system = parse_any(text, file).system
    write_text(file, text)
    save_figure(described_figure(system), file.with_suffix(""), ("svg",))
