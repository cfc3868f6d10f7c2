"""Text files of the user, and the error that every bad input becomes."""

import codecs
import gzip
import io
import shlex
import stat
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import IO, cast

from tendonff.models.errors import TendonffError

_BLOCK = 1 << 20


class InputError(TendonffError, ValueError):
    """A file or an argument given by the user cannot be used; the text names it and says what to do.

    Parameters
    ----------
    text : str
        The message.
    discreet : str, optional
        The message without anything that stands in a file; default: the text has nothing of the kind.
    """

    def __init__(self, text: str = "", *, discreet: str | None = None) -> None:
        super().__init__(text)
        self.discreet = text if discreet is None else discreet


@contextmanager
def discreetly() -> Iterator[None]:
    """Refuse files without quoting them: those that a scenario names, which may come from others."""
    try:
        yield
    except InputError as error:
        raise InputError(error.discreet) from None


MOST_BYTES = 200_000_000
"""Bytes that a packed file may unpack to."""


def is_moderate(size: int) -> bool:
    """Whether so many bytes can be meant."""
    return size <= MOST_BYTES


def require_moderate(path: Path, size: int, part: int = 1) -> None:
    """Refuse a packed file that unpacks to more bytes than can be meant, before it is unpacked.

    A format that is read slowly may have a `part`-th of the others' bytes.
    """
    if not is_moderate(part * size):
        most = f"{MOST_BYTES / part / 1e6:.0f} MB"
        raise InputError(f"{path.name} unpacks to more than {most}; give the part that is needed, or unpack it first")


class _Bounded(gzip.GzipFile):
    """A packed file that is read up to a bound, whatever it unpacks to."""

    def read(self, size: int | None = -1) -> bytes:
        return self._within(super().read(MOST_BYTES + 1 if size is None or size < 0 else size))

    def read1(self, size: int = -1) -> bytes:
        return self._within(super().read1(size))

    def _within(self, data: bytes) -> bytes:
        require_moderate(Path(str(self.name)), self.tell())
        return data


def require_file(path: Path) -> None:
    """Refuse folders, and pipes and devices, which may never end; a missing file is for `open` to name."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    if stat.S_ISDIR(mode):
        raise InputError(f"{path} is a folder, not a file")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path} is a pipe or a device, not a file; write what it gives into a file first")


def require_suffix(path: Path, *suffixes: str) -> None:
    """Refuse a name to write that ends as another kind of file; folders are for who writes to name."""
    if path.suffix.lower() not in suffixes and not path.is_dir():
        raise InputError(
            f"{path.name} must end in {' or '.join(suffixes)}, as what is written is; try {path.stem}{suffixes[0]}"
        )


def open_bytes(path: Path) -> IO[bytes]:
    """Open a user's file, unpacked on the way where it is packed; OSError or ValueError where it cannot be."""
    require_file(path)
    return cast("IO[bytes]", _Bounded(path)) if path.suffix.lower() == ".gz" else path.open("rb")


def as_argument(path: Path) -> str:
    """Path as a command in the working folder names it, quoted for a shell: relative below it, elsewhere its name."""
    whole, here = path.resolve(), Path.cwd()
    return shlex.quote(whole.relative_to(here).as_posix() if whole.is_relative_to(here) else path.name)


def suggestion(name: str, valid: Sequence[str]) -> str:
    """`, did you mean "x"?` for the nearest valid name, else the list of all of them."""
    near = get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f', did you mean "{near[0]}"?'
    return f"; known: {', '.join(valid)}"


def encoding_of(path: Path) -> str:
    """Encoding of a text: UTF-16 by its first bytes, UTF-8, or else Windows' western one (cp1252)."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with open_bytes(path) as stream:
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


def require_named(path: Path, asker: str) -> None:
    """Refuse a file that is named elsewhere and is not there; InputError says by whom, and where it was looked for."""
    if not path.exists():
        raise InputError(f"{asker} names {path.name}, which is not in {path.parent.absolute()}")


def open_text(path: Path, encoding: str = "utf-8-sig") -> IO[str]:
    """Open a user's text file, packed or not, turning what can go wrong into an InputError."""
    try:
        return io.TextIOWrapper(open_bytes(path), encoding=encoding, newline="")
    except InputError:
        raise
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
    """Whole text of a user's file in UTF-8, or in UTF-16 with its mark."""
    marked = path.is_file() and encoding_of(path) == "utf-16"
    with user_text(path, "utf-16" if marked else "utf-8-sig") as stream:
        return stream.read()
