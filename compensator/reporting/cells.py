"""Cells of a table as text: numbers of one column with the same number of decimals."""

import math
import re
from collections.abc import Sequence

Cell = str | float | int | bool | None
"""What a table holds; None shows as a dash."""

_FIGURE = re.compile(r"[<−-]? ?\d.{0,20}$")
_DECADES = 4  # that one number of decimals serves


def is_number(cell: Cell) -> bool:
    """Whether a cell holds a number; yes and no are none."""
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def is_aligned(column: Sequence[Cell]) -> bool:
    """Whether a column is set to the right: numbers, and short texts that begin with one, such as "4.6 ± 0.1"."""
    shown = [cell for cell in column if cell is not None and cell != ""]
    return bool(shown) and all(is_number(c) or (isinstance(c, str) and _FIGURE.match(c) is not None) for c in shown)


def column_decimals(cells: Sequence[Cell], digits: int = 3, least: float = 0.0) -> int | None:
    """Decimals that a column of numbers is shown with; None where its magnitudes span too much for one choice.

    The smallest number shows two digits, with three decimals at most; below `least` numbers need not be told apart.
    """
    sizes = [max(abs(c), least) for c in cells if isinstance(c, float) and math.isfinite(c) and c != 0]
    if not sizes or any(isinstance(c, str) for c in cells):
        return None
    low, high = (math.floor(math.log10(size)) for size in (min(sizes), max(sizes)))
    if high - low > _DECADES or low < -_DECADES:
        return None
    return max(0, digits - 1 - high, min(3, 1 - low))


def format_cell(cell: Cell, digits: int = 3, decimals: int | None = None) -> str:
    """Text of a table cell, with so many significant digits or the decimals of its column."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if not isinstance(cell, float):
        return str(cell)
    if decimals is not None and math.isfinite(cell):
        smallest = 10.0**-decimals
        if 0 < abs(cell) < smallest / 2:
            return f"< {smallest:.{decimals}f}"
        return f"{cell:.{decimals}f}".replace("-", "−")
    if cell == 0:
        return "0"
    if 1e-3 <= abs(cell) < 10.0 ** max(digits, 7):
        places = max(0, digits - 1 - math.floor(math.log10(abs(cell))))
        rounded = float(f"{cell:.{digits}g}") if abs(cell) >= 10.0 ** max(digits, 5) else cell
        return f"{rounded:.{places}f}".replace("-", "−")  # keeps trailing zeros, no exponent
    return f"{cell:.{digits}g}".replace("-", "−")
