"""MATLAB files before version 7.3; the fields of a struct are columns. Those of 7.3 are HDF5."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonff.compensator.files.formats.hdf5 import read_hdf5
from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_vectors
from tendonff.compensator.files.text import require_moderate


def _read(path: Path, expected: Sequence[str]) -> Table:
    from scipy.io import loadmat, whosmat

    try:
        require_moderate(path, sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)))
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
