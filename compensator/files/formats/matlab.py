"""MATLAB files before version 7.3; the fields of a struct are columns. Those of 7.3 are HDF5."""

import math
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tendonff.compensator.files.formats.hdf5 import read_hdf5
from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_vectors
from tendonff.compensator.files.text import is_moderate, require_moderate

_HEADER, _TAG, _PACKED = 128, 8, 15  # bytes of a file's head and of an element's; type of a packed element
_PART = 1 << 20


def _unpacked_size(path: Path) -> int:
    """Bytes of all elements, unpacked; counting ends beyond what is read. What is no such file counts as none."""
    size = 0
    with path.open("rb") as file:
        order: Literal["little", "big"] = "little" if file.read(_HEADER)[-2:] == b"IM" else "big"
        while len(tag := file.read(_TAG)) == _TAG and is_moderate(size):
            kind, length = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind != _PACKED:
                size += length
                file.seek(length, os.SEEK_CUR)
                continue
            packed, unpacking = file.read(length), zlib.decompressobj()
            while packed and is_moderate(size):
                size += len(unpacking.decompress(packed, _PART))
                packed = unpacking.unconsumed_tail
    return size


def _read(path: Path, expected: Sequence[str]) -> Table:
    from scipy.io import loadmat, whosmat

    try:
        named = whosmat(path)  # tells a file of version 7.3
        require_moderate(path, max(_unpacked_size(path), sum(8 * math.prod(shape) for _, shape, _ in named)))
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        return read_hdf5(path, expected)
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        parts = {f: getattr(value, f) for f in value._fieldnames} if hasattr(value, "_fieldnames") else {name: value}
        if not name.startswith("__"):
            vectors |= {k: v for k, v in parts.items() if isinstance(v, np.ndarray) and v.dtype.kind in "fiub"}
    return of_vectors(vectors)


MATLAB = Reader(name=".mat", suffixes=(".mat",), read=_read, package="h5py", extra="logs", magic=(b"MATLAB",))
