"""Archives of NumPy arrays; the fields of a structured one are columns."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_vectors, unpacked_size
from tendonff.compensator.files.text import require_moderate


def _read(path: Path, _: Sequence[str]) -> Table:
    require_moderate(path, unpacked_size(path))
    vectors: dict[str, Any] = {}
    with np.load(path, allow_pickle=False) as content:
        for name in content.files:
            array = content[name]
            vectors |= {k: array[k] for k in array.dtype.names} if array.dtype.names else {name: array}
    return of_vectors({k: v for k, v in vectors.items() if v.dtype.kind in "fiub"})


NPZ = Reader(name=".npz", suffixes=(".npz",), read=_read)
