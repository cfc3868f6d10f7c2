"""A scenario as a document: what reports and summaries show of it, whatever it describes."""

from pathlib import Path
from typing import Protocol


class Document(Protocol):
    """Content of a scenario that a report needs."""

    @property
    def name(self) -> str:
        """The rig, in words."""

    @property
    def source(self) -> Path:
        """The file it was read from."""

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files that it names besides its reference."""

    @property
    def is_complete(self) -> bool:
        """Whether its text states every default."""

    def to_toml(self) -> str:
        """Its text."""

    def digest(self) -> str:
        """Sixteen hexadecimal digits that change when a value, or the contents of a file that it names, change."""

    def reference_file(self) -> Path | None:
        """The file of a CSV reference, resolved; None for the other kinds."""
