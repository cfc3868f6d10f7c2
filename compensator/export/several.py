"""C project of several tensions: a folder for each, names that go together, and one `make test` over all."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tendonff.compensator.export.c_project import Exported, export_project
from tendonff.compensator.files.text import InputError
from tendonff.compensator.files.writing import write_folder
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedTensions:
    """Exports of several tensions, before they are written.

    Attributes
    ----------
    exports : mapping of str to Exported
        By the name of their folder; every C name of it begins with the prefix and this name.
    """

    exports: Mapping[str, Exported]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {', '.join(self.exports)}>"

    @property
    def files(self) -> dict[str, str]:
        """Text by file name, with a Makefile over all folders."""
        folders = " ".join(self.exports)
        make = (
            f"# make        libraries of all tensions       make test     compile and run their self tests\n"
            f"FOLDERS = {folders}\n\n"
            "all test clean:\n\tset -e; for folder in $(FOLDERS); do $(MAKE) -C $$folder $@; done\n\n"
            ".PHONY: all test clean\n"
        )
        each = {
            f"{folder}/{name}": text for folder, export in self.exports.items() for name, text in export.files.items()
        }
        return {"Makefile": make} | each

    @property
    def warnings(self) -> tuple[str, ...]:
        """Advice for the user, tension by tension."""
        return self._of("warnings")

    @property
    def notes(self) -> tuple[str, ...]:
        """Parameters that the tuners can identify, tension by tension."""
        return self._of("notes")

    @property
    def lines(self) -> tuple[str, ...]:
        """The judgements for the terminal."""
        return tuple(line for name, each in self.exports.items() for line in (f"{name}:", *each.lines))

    def _of(self, what: str) -> tuple[str, ...]:
        return tuple(f"{name}: {text}" for name, each in self.exports.items() for text in getattr(each, what))

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write every file, all or nothing; makes the folder."""
        write_folder(self.files, folder)


@in_turn
def export_tensions(
    scenario: Scenario,
    *,
    further: Sequence[Scenario] = (),
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    force_export: bool = False,
) -> Exported | ExportedTensions:
    """Print the folder of one tension, or a project of several; see `export_project`.

    InputError where two scenarios have one name, or a profile is given for several.
    """
    if not further:
        return export_project(
            scenario,
            precision=precision,
            prefix=prefix,
            level=level,
            force_export=force_export,
        )
    every = dict[str, Scenario]()
    for each in (scenario, *further):
        name = name_of(each)
        if name in every:
            raise InputError(
                f"{every[name].source} and {each.source}: two tensions of one project come from files of one name; "
                f"rename one, for each gives its folder and C names ({name})"
            )
        every[name] = each
    return ExportedTensions(
        exports={
            name: export_project(
                each, precision=precision, prefix=f"{prefix}_{name}", level=level, force_export=force_export
            )
            for name, each in every.items()
        }
    )


def name_of(scenario: Scenario) -> str:
    """Name of a scenario's file as a part of C names."""
    return re.sub(r"\W+|__+", "_", scenario.source.stem, flags=re.ASCII).strip("_").lower() or "tendon"
