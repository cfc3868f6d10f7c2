"""Numbers as text in compiled C, for files of millions of numbers; see `number_text.c`."""

import ctypes
import functools
from collections.abc import Callable
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine, resolve_engine

BYTES_PER_NUMBER = 26
BYTES_MORE = 64

Writer = Callable[[NDArray[np.float64], NDArray[np.uint8]], int]


@functools.cache
def compiled_writer() -> Writer | None:
    """Function that writes rows of numbers as CSV lines into a buffer and returns the bytes used.

    The buffer must hold `BYTES_PER_NUMBER` a number and `BYTES_MORE`. Every number reads back as the same double.

    Returns
    -------
    callable or None
        None where no C compiler works, or it knows no integers of 128 bits.
    """
    if resolve_engine(Engine.AUTO) is not Engine.COMPILED:
        return None
    try:
        library = load_library(
            resources.files("tendonff.compensator.files").joinpath("number_text.c").read_text("utf-8")
        )
    except (RuntimeError, OSError):
        return None
    library.tff_csv_text.restype = ctypes.c_long

    def write(block: NDArray[np.float64], out: NDArray[np.uint8]) -> int:
        rows, columns = block.shape
        if out.size < BYTES_PER_NUMBER * block.size + BYTES_MORE:
            raise ValueError(f"the buffer holds {out.size} bytes, too few for {block.size} numbers")
        return int(
            library.tff_csv_text(
                ctypes.c_void_p(block.ctypes.data),
                ctypes.c_long(rows),
                ctypes.c_long(columns),
                ctypes.c_void_p(out.ctypes.data),
            )
        )

    return write
