"""`tendonff example`: the scenarios that come with the tool."""

import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.progress import say
from tendonff.compensator.files.text import InputError, suggestion


def example(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Example to write; without it, list them.", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder to write into.")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """Write a shipped example scenario, or list them."""
    from tendonff.compensator.files.writing import write_text

    shipped = files("tendonff").joinpath("examples")
    scenarios = {file.name.removesuffix(".toml"): file for file in shipped.iterdir() if file.name.endswith(".toml")}
    if name is None:
        for known in sorted(scenarios):
            typer.echo(f"{known:16} {tomllib.loads(scenarios[known].read_text(encoding='utf-8'))['name']}")
        return
    if name.removesuffix(".toml") not in scenarios:
        raise InputError(f'no example "{name}"{suggestion(name, sorted(scenarios))}')
    scenario = scenarios[name.removesuffix(".toml")]
    text = scenario.read_text(encoding="utf-8")
    used = [file for value in _texts(tomllib.loads(text)) if (file := shipped.joinpath(value)).is_file()]
    targets = {out / file.name: file for file in (scenario, *used)}
    if taken := [target for target in targets if target.exists() and not force]:
        raise InputError(f"{taken[0]} exists; choose another folder with --out, or replace it with --force")
    for target, file in targets.items():
        write_text(target, file.read_text(encoding="utf-8"))
    path = out / scenario.name
    say(f"{', '.join(map(str, targets))} written; next: tendonff design {path} --out out")


def _texts(value: object) -> Iterator[str]:
    """Every text in nested tables and lists: some of them name files."""
    if isinstance(value, str) and value and "/" not in value and "\\" not in value:
        yield value
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)
