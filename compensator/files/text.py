"""Text files of the user, and the error that every bad input becomes."""

import gzip
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import IO, cast

from tendonff.models.errors import TendonffError


class InputError(TendonffError, ValueError):
    """A file or an argument given by the user cannot be used; the text names it and says what to do."""


def suggestion(name: str, valid: Sequence[str]) -> str:
    """`, did you mean "x"?` for the nearest valid name, else the list of all of them."""
    near = get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f', did you mean "{near[0]}"?'
    return f"; known: {', '.join(valid)}"


def open_text(path: Path) -> IO[str]:
    """Open a user's text file, packed or not, turning what can go wrong into an InputError."""
    if path.is_dir():
        raise InputError(f"{path} is a folder, not a file")
    try:
        if path.suffix.lower() == ".gz":
            return cast("IO[str]", gzip.open(path, "rt", encoding="utf-8-sig", newline=""))
        return path.open(encoding="utf-8-sig", newline="")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None


READABLE = "text with a header (separated by commas, semicolons, tabs; also .gz), .xlsx, .parquet, .mat"


@contextmanager
def user_text(path: Path, way_out: str = f"save it as UTF-8; what can be read: {READABLE}") -> Iterator[IO[str]]:
    """A user's text file while it is read; what goes wrong on the way becomes an InputError too."""
    with open_text(path) as stream:
        try:
            yield stream
        except UnicodeDecodeError:
            raise InputError(f"{path.name} is not UTF-8 text; {way_out}") from None
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise InputError(f"{path.name} cannot be unpacked ({error}); {way_out}") from None
        except OSError as error:
            raise InputError(f"{path.name} cannot be read: {error.strerror or error}") from None


def read_text(path: Path) -> str:
    """Whole text of a user's UTF-8 file."""
    with user_text(path, "save it as UTF-8") as stream:
        return stream.read()
