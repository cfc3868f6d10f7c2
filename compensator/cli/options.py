"""Parts common to commands: arguments and options, opening a scenario and a folder for results."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonff.compensator.cli.progress import warn
from tendonff.compensator.files.dialect import is_number
from tendonff.compensator.files.text import InputError
from tendonff.models.fidelity import Level
from tendonff.ocp.integrate.method import Method

if TYPE_CHECKING:
    from tendonff.compensator.scenario.driven.finger import FingerScenario
    from tendonff.compensator.scenario.driven.joint import JointScenario
    from tendonff.compensator.scenario.scenario import Scenario


def option(name: str, metavar: str | None, text: str) -> Any:
    """Option whose default is stated in its text, if at all."""
    return typer.Option(name, metavar=metavar, help=text, show_default=False)


def named_numbers(
    name: str, texts: Sequence[str], form: str, example: str, *, is_named: bool = False
) -> list[tuple[str, float]]:
    """Name before the last "=" of each text of an option, and the number after it; the name may be missing."""
    found = []
    for text in texts:
        before, _, number = text.rpartition("=")
        if not is_number(number) or (is_named and not before):
            raise InputError(f'{name} must be {form}, got "{text}"; {name} {example}')
        found.append((before.strip(), float(number)))
    return found


def names_of(text: str | None) -> tuple[str, ...] | None:
    """Names separated by commas; None where none are given."""
    return None if text is None else tuple(name.strip() for name in text.split(","))


ScenarioArgument = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (TOML).", show_default=False)]
LevelOption = Annotated[Level | None, option("--level", None, "Model level of the chain; default: the scenario's own.")]
MethodOption = Annotated[
    Method, option("--method", None, "How to advance in time: the fixed step of tendonff, or an integrator of CasADi.")
]
OutFolderOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
PdfOption = Annotated[bool, typer.Option("--pdf", help="Write each figure as PDF too, for a printed page.")]
CompensatorsOption = Annotated[
    str | None,
    option("--compensators", "NAME,...", "Compensators to try; default: all but what takes longest."),
]
PrefixOption = Annotated[str, typer.Option("--prefix", metavar="NAME", help="Prefix of every C name and file.")]
ForceOption = Annotated[
    bool, typer.Option("--force-export", help="Export modules all the same that are worse than no compensation.")
]
YesOption = Annotated[bool, typer.Option("--yes", help="Go on where a value looks like another unit.")]


def looked_at(
    scenario: Path, *, follows_reference: bool = True, strict: bool = False, yes: bool = False
) -> "Scenario | JointScenario | FingerScenario":
    """Read a scenario and say at once what to ask about it, before a command imports what it computes with.

    A scenario that is not valid, a value that looks like another unit (unless `yes`), and a reference (where the
    command follows it) that is infeasible, if `strict` out of reach, are refused.
    """
    from tendonff.compensator.door import look_at
    from tendonff.compensator.scenarios import load_scenario

    loaded = load_scenario(scenario)
    warn(*look_at(loaded, follows_reference=follows_reference, strict=strict, accept=yes))
    return loaded


@contextmanager
def opened(
    scenario: Path, out: Path, *, follows_reference: bool = True, strict: bool = False, yes: bool = False
) -> Iterator[tuple["Scenario | JointScenario | FingerScenario", Path]]:
    """Scenario, as `looked_at`, and result folder.

    A folder that cannot be written is refused at once; it appears when the block ends without an error.
    """
    from tendonff.compensator.files.writing import atomic_directory

    loaded = looked_at(scenario, follows_reference=follows_reference, strict=strict, yes=yes)
    with atomic_directory(out) as folder:
        yield loaded, folder
