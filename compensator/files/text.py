"""Text files of the user, and the error that every bad input becomes."""

import codecs
import gzip
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import IO, cast

from tendonff.models.errors import TendonffError

_BLOCK = 1 << 20


class InputError(TendonffError, ValueError):
    """A file or an argument given by the user cannot be used; the text names it and says what to do."""


def suggestion(name: str, valid: Sequence[str]) -> str:
    """`, did you mean "x"?` for the nearest valid name, else the list of all of them."""
    near = get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f', did you mean "{near[0]}"?'
    return f"; known: {', '.join(valid)}"


def encoding_of(path: Path) -> str:
    """Encoding of a text: UTF-16 by its first bytes, UTF-8, or else Windows' western one (cp1252)."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with _opened(path) as stream:
        block = stream.read(_BLOCK)
        if block.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return "utf-16"
        try:
            while block:
                decoder.decode(block)
                block = stream.read(_BLOCK)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return "cp1252"
    return "utf-8-sig"


def _opened(path: Path) -> IO[bytes]:
    return cast("IO[bytes]", gzip.open(path, "rb")) if path.suffix.lower() == ".gz" else path.open("rb")


def open_text(path: Path, encoding: str = "utf-8-sig") -> IO[str]:
    """Open a user's text file, packed or not, turning what can go wrong into an InputError."""
    if path.is_dir():
        raise InputError(f"{path} is a folder, not a file")
    try:
        if path.suffix.lower() == ".gz":
            return cast("IO[str]", gzip.open(path, "rt", encoding=encoding, newline=""))
        return path.open(encoding=encoding, newline="")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None


@contextmanager
def user_text(path: Path, encoding: str = "") -> Iterator[IO[str]]:
    """A user's text file while it is read, in the encoding that it is found to have unless one is given.

    What goes wrong on the way becomes an InputError too.
    """
    way_out = "save it as UTF-8; what can be read: text with a header, and what the manual lists under formats"
    try:
        if not encoding and path.is_file():
            encoding = encoding_of(path)
        with open_text(path, encoding or "utf-8-sig") as stream:
            yield stream
    except UnicodeDecodeError:
        raise InputError(f"{path.name} is not UTF-8 text; {way_out}") from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{path.name} cannot be unpacked ({error}); {way_out}") from None
    except OSError as error:
        raise InputError(f"{path.name} cannot be read: {error.strerror or error}") from None


def read_text(path: Path) -> str:
    """Whole text of a user's UTF-8 file."""
    with user_text(path, "utf-8-sig") as stream:
        return stream.read()
