"""HDF5, which MATLAB 7.3 writes as well: datasets are columns, named by their path or the last part of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_vectors, resolved
from tendonff.compensator.files.text import InputError, is_moderate, require_moderate

_MATRIX = 2


def read_hdf5(path: Path, expected: Sequence[str]) -> Table:
    """The datasets of numbers of a file, those that are looked for under the names that were asked for.

    Of a large file only these.
    """
    import h5py

    found: dict[str, Any] = {}
    with h5py.File(path) as file:

        def note(name: str, item: object) -> None:
            # MATLAB keeps its own bookkeeping under "#", and texts as numbers.
            if not isinstance(item, h5py.Dataset) or name.startswith("#") or item.attrs.get("MATLAB_class") == b"char":
                return
            if item.external or item.is_virtual:
                raise InputError(f"{path.name}: {name} keeps its numbers in other files; copy them into this one")
            if item.dtype.names:
                found.update({f"{name}.{field}": (item, field) for field in item.dtype.names})
            elif item.dtype.kind in "fiub" and item.size > 1 and sum(n > 1 for n in item.shape) <= _MATRIX:
                found[name] = (item, ())

        file.visititems(note)
        names = {long: wanted for wanted, long in resolved(expected, list(found)).items()}
        if not is_moderate(sum(item.nbytes for item, _ in found.values())):
            found = {name: place for name, place in found.items() if name in names}
        require_moderate(path, sum(item.nbytes for item, _ in found.values()))
        vectors = {name: item[part] for name, (item, part) in found.items()}
        units = {name: _unit(file[name]) for name in vectors if name in file}
    return of_vectors(
        {names.get(name, name): array for name, array in vectors.items()},
        {names.get(name, name): unit for name, unit in units.items()},
    )


def _unit(dataset: Any) -> str:
    unit = next((dataset.attrs[key] for key in ("unit", "units", "Unit", "Units") if key in dataset.attrs), "")
    return unit.decode() if isinstance(unit, bytes) else str(unit)


HDF5 = Reader(
    name="HDF5 (.h5, .hdf5, MATLAB 7.3)",
    suffixes=(".h5", ".hdf5"),
    read=read_hdf5,
    package="h5py",
    extra="logs",
    magic=(b"\x89HDF\r\n\x1a\n",),
)
