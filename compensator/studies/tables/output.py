"""The files of a table: for spreadsheets, programs and controllers, and the report."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from tendonff.compensator.files.writing import atomic_directory, csv_text, write_json, write_text
from tendonff.compensator.reporting.page import Report, write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.reporting.results import Views


@dataclass(frozen=True, slots=True, kw_only=True)
class Pages:
    """Content of the files of a table.

    Attributes
    ----------
    columns : callable
        Of `table.csv`, one row per node.
    header : callable
        Text of `table.h` for a prefix.
    numbers : callable
        For other programs.
    file : str
        Name of their file.
    figures, report : callable
    """

    columns: Callable[[Any], Mapping[str, list[Any]]]
    header: Callable[[Any, str], str]
    numbers: Callable[[Any], Mapping[str, object]]
    file: str
    figures: Callable[[Any], dict[str, Figure]]
    report: Callable[[Any, dict[str, Figure]], Report]

    def write(self, result: Any, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
        """Write the files of `Tables.write`."""
        columns, figures = self.columns(result), self.figures(result)
        with atomic_directory(folder) as partial:
            write_text(partial / "table.csv", csv_text(columns, zip(*columns.values(), strict=True)))
            write_json(partial / self.file, self.numbers(result))
            write_text(partial / "table.h", self.header(result, prefix))
            files = {figure: save_figure(figure, partial / name, pdf=pdf)[0] for name, figure in figures.items()}
            write_report(partial / "report.html", self.report(result, figures), files)

    @property
    def views(self) -> Views:
        """As a result is shown."""
        return Views(write=self.write, columns=self.columns, figures=self.figures)
