"""Interface of a reader of a format."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tendonff.compensator.files.formats.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """A format of measured files.

    Parameters
    ----------
    name : str
        What the format is called.
    suffixes : tuple of str
        Endings of its files, small letters.
    read : callable
        Reads a file; the second argument names the columns that are looked for. It may raise what it likes.
    package : str
        Package that it needs beyond the usual ones; empty for none.
    extra : str
        Extra of this package that brings it.
    magic : tuple of bytes
        What its files begin with.
    folder : str
        Pattern of a file by which a folder of this format is known.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, Sequence[str]], Table]
    package: str = ""
    extra: str = ""
    magic: tuple[bytes, ...] = ()
    folder: str = ""
