"""Functions of generated C, called by the names that their own prototypes give their arguments."""

import ctypes
import re
from typing import Any

import numpy as np

from tendonff.ocp.errors import CodeError

_SCALARS: dict[str, Any] = {"int": ctypes.c_int, "long": ctypes.c_long, "double": ctypes.c_double}


class _Array:
    """Contiguous array of one type, given by its address: a third of the time that numpy's `ndpointer` takes."""

    def __init__(self, kind: type[np.generic]) -> None:
        self._kind = np.dtype(kind)

    def from_param(self, values: object) -> ctypes.c_void_p:
        """Address for the function; TypeError where the array is another one."""
        if not isinstance(values, np.ndarray):
            raise TypeError(f"must be an ndarray, got {type(values).__name__}")
        if values.dtype != self._kind:
            raise TypeError(f"array must have data type {self._kind}, got {values.dtype}")
        if not values.flags.c_contiguous:
            raise TypeError("array must be contiguous")
        return ctypes.c_void_p(values.ctypes.data)


_ARRAYS = {"int": _Array(np.intc), "double": _Array(np.float64)}


class CFunction:
    """Function of a library, with types from its prototype.

    Numbers are converted, arrays must have the prototype's type and be contiguous, and what points to a record is given
    by reference. A call names every argument, so that none can stand in another's place.
    """

    def __init__(self, library: ctypes.CDLL, source: str, name: str) -> None:
        found = re.search(rf"^(\w+) {name}\(([^)]*)\)", source, flags=re.MULTILINE)
        if found is None:
            raise CodeError(f"generated C has no function {name}")
        self.name, self._function = name, getattr(library, name)
        given = [each.strip() for each in found[2].split(",") if each.strip() != "void"]
        self.arguments = tuple(re.split(r"[ *]+", each)[-1] for each in given)
        self._function.restype = _SCALARS.get(found[1])
        self._function.argtypes = [_type_of(each) for each in given]

    def __call__(self, /, **arguments: Any) -> Any:
        """Call it; TypeError names arguments that are missing or unknown."""
        if arguments.keys() != set(self.arguments):
            odd = ", ".join(sorted(arguments.keys() ^ set(self.arguments)))
            raise TypeError(f"{self.name} takes {', '.join(self.arguments)}; missing or unknown: {odd}")
        for name, kind in zip(self.arguments, self._function.argtypes, strict=True):
            if kind in _SCALARS.values() and np.ndim(arguments[name]) > 0:  # before 2.4 NumPy made it a number
                raise ctypes.ArgumentError(f"{name} must be a number, got an array")
        return self._function(*(arguments[name] for name in self.arguments))


def _type_of(argument: str) -> Any:
    kind, star, _ = re.sub(r"\bconst\b", "", argument).partition("*")
    word = kind.split()[0]
    if not star:
        return _SCALARS[word]
    return _ARRAYS.get(word, ctypes.c_void_p)
