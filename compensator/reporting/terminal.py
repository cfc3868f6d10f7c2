"""The table of scores on the terminal."""

from collections.abc import Iterable, Sequence

from rich.box import HEAVY_HEAD, SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from tendonff.compensator.files.typeset import typeset

_ROOM = 90  # columns of a terminal that hold the table with its frame


def print_scores(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], lines: Iterable[str]) -> None:
    """Print a table of names and numbers, and lines below it, whole."""
    console = Console()
    wide = console.width >= _ROOM
    table = Table(
        box=HEAVY_HEAD if wide else SIMPLE_HEAD,
        pad_edge=wide,
        collapse_padding=not wide,
        title=title,
        title_justify="left",
    )
    for k, column in enumerate(columns):
        table.add_column(column, justify="right" if k else "left")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    for line in lines:
        console.print(typeset(line), soft_wrap=True, markup=False, highlight=False)
