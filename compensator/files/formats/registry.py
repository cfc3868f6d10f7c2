"""All formats of measured files beside text."""

from collections.abc import Sequence
from pathlib import Path

from tendonff.compensator.files.formats.hdf5 import HDF5
from tendonff.compensator.files.formats.matlab import MATLAB
from tendonff.compensator.files.formats.mdf import MDF4
from tendonff.compensator.files.formats.numpy_arrays import NPZ
from tendonff.compensator.files.formats.parquet import PARQUET
from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.rosbag import ROSBAG
from tendonff.compensator.files.formats.spreadsheet import XLS, XLSX
from tendonff.compensator.files.formats.table import Table
from tendonff.compensator.files.formats.yarp import YARP
from tendonff.compensator.files.text import InputError, require_file

READERS: tuple[Reader, ...] = (XLSX, XLS, PARQUET, MATLAB, HDF5, NPZ, MDF4, ROSBAG, YARP)

READABLE = "text with a header (separated by commas, semicolons, tabs, bars or blanks; also .gz), " + ", ".join(
    reader.name for reader in READERS
)

_LOOKED_AT = 4096
_BOMS_16 = (b"\xff\xfe", b"\xfe\xff")


def reader_of(path: Path) -> Reader | None:
    """The reader of a file, by its ending or its first bytes; None for text.

    InputError for a binary file of another kind, with the list of what is read.
    """
    if path.is_dir():
        found = next((r for r in READERS if r.folder and any(path.glob(r.folder))), None)
        if found is None:
            raise InputError(f"{path} is a folder, and no measured file; what can be read: {READABLE}")
        return found
    require_file(path)
    suffix = path.suffix.lower()
    if (found := next((r for r in READERS if suffix in r.suffixes), None)) is not None or suffix == ".gz":
        return found
    try:
        with path.open("rb") as stream:
            head = stream.read(_LOOKED_AT)
    except (OSError, ValueError):  # the reader of text says what is wrong
        return None
    if (found := next((r for r in READERS if head.startswith(r.magic)), None)) is not None:
        return found
    if b"\0" in head and not head.startswith(_BOMS_16):
        raise InputError(f"{path.name} is not text, nor of a known format; what can be read: {READABLE}")
    return None


def damaged(path: Path, error: Exception) -> InputError:
    """Why a file cannot be read: what its reader says, which may quote the file."""
    way = f"what can be read: {READABLE}"
    return InputError(f"{path.name} cannot be read ({error}); {way}", discreet=f"{path.name} cannot be read; {way}")


def read_packed(reader: Reader, path: Path, expected: Sequence[str]) -> Table:
    """The table of a file that is no text; InputError where it cannot be read."""
    try:
        found = reader.read(path, expected)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except ImportError:
        wanted = f"tendonff[{reader.extra}]" if reader.extra else reader.package
        raise InputError(
            f'{path.name}: {reader.name} needs the package {reader.package} (pip install "{wanted}"); or save it as CSV'
        ) from None
    except Exception as error:  # noqa: BLE001 - these readers raise what they like on a damaged file
        raise damaged(path, error) from None
    if not found.columns and not found.offered:
        raise InputError(f"{path.name} holds no vectors; save time and tensions as vectors of one length")
    return found
