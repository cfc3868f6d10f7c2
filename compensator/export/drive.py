"""Answers of exported code to calls drawn at random: what the shipped self test asks for beside its golden vectors.

Inputs are drawn in C, the same text in the self test and on the host that records the answers. Which answers
rounding can change is measured: with inputs that are nudged by little more than it.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.host import HostCode
from tendonff.compensator.files.reading import FloatArray
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment

ROWS, CHANNELS = 20, 7
"""Samples of a block, and sums that stand for its answers; the last is the work of the calls."""

_MORE_WORK = 4.5
"""By how much the work of a block may differ always: one evaluation more or less in three of its calls."""

_TEMPLATES = environment("tendonff.compensator.export", "templates/library")
_MOST_BLOCKS = 2000
_NUDGES = {Precision.DOUBLE: (1e-13, 1e-12), Precision.FLOAT: (3e-7, 3e-6)}
_SHARE = {Precision.DOUBLE: 1e-11, Precision.FLOAT: 1e-3}
"""Of the largest sum of a channel: differences that always pass."""
_MARGIN = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """Answers to calls at random.

    Attributes
    ----------
    sums, tolerances : ndarray
        Shape (blocks, CHANNELS); sums of answers with random weights, and by how much they may differ.
    words : ndarray of uint32
        Shape (blocks,); of all statuses of a block; 0 where rounding can change one.
    """

    sums: FloatArray
    tolerances: FloatArray
    words: NDArray[np.uint32]


def host_text(own: str, prefix: str, modules: Sequence[str]) -> str:
    """A drive as text for the host, around the drive of the modules in C, `own`."""
    headers = "".join(f'#include "{prefix}_{module}.h"\n' for module in modules)
    return f"#include <math.h>\n#include <string.h>\n{headers}{_common(prefix)}{own}{_text('drive_host', {})}"


def test_text(own: str, prefix: str, driven: Driven | None) -> str:
    """The same for the self test; nothing where nothing was recorded, for want of a compiler."""
    if driven is None:
        return ""
    values: Mapping[str, Any] = {
        "driven": driven,
        "exact_numbers": lambda table: _wrapped(table.ravel(), lambda v: literal(float(v), Precision.DOUBLE)),
        "short_numbers": lambda table: _wrapped(table.ravel(), lambda v: f"{v:.1e}"),
        "words": lambda words: _wrapped(words, "{}u".format),
    }
    return f"{_common(prefix)}{_text('drive_test', values)}{own}"


def drive_on_host(code: HostCode, precision: Precision) -> Driven:
    """Answers of compiled code that holds `host_text`."""
    reals = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    integers = np.ctypeslib.ndpointer(dtype=np.uint32, flags="C_CONTIGUOUS")
    run = code.function("drive_run", ctypes.c_double, ctypes.c_int, reals, integers, result=ctypes.c_int)

    def answers(nudge: float) -> tuple[FloatArray, NDArray[np.uint32]]:
        sums, words = np.zeros((_MOST_BLOCKS, CHANNELS)), np.zeros(_MOST_BLOCKS, dtype=np.uint32)
        blocks = run(nudge, _MOST_BLOCKS, sums, words)
        return sums[:blocks], words[:blocks]

    sums, words = answers(0.0)
    nudged = [answers(nudge) for nudge in _NUDGES[precision]]
    apart = np.max([np.abs(other - sums) for other, _ in nudged], axis=0)
    same = np.all([other == words for _, other in nudged], axis=0)
    usual = _SHARE[precision] * np.abs(sums).max(axis=0, initial=0.0)
    usual[-1] = _MORE_WORK
    tolerances = usual + _MARGIN * apart + 1e-300
    return Driven(sums=sums, tolerances=tolerances, words=np.where(same, words, 0).astype(np.uint32))


def _common(prefix: str) -> str:
    return _text("drive", {"prefix": prefix, "rows": ROWS, "channels": CHANNELS})


def _text(name: str, values: Mapping[str, Any]) -> str:
    return _TEMPLATES.get_template(f"{name}.c.j2").render(values)


def _wrapped(values: Any, text: Callable[[Any], str]) -> str:
    items = [text(value) for value in values]
    return ",\n".join(f"    {', '.join(items[k : k + 6])}" for k in range(0, len(items), 6))
