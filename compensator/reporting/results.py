"""Results: what every one of them can show.

A result knows its numbers and the module that shows them, whose `VIEWS` write its files, draw its figures and list its
main table.
"""

import base64
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.typeset import typeset
from tendonff.models.errors import ParameterError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """Functions of a result: its files, the columns of its main table, its figures by name, what a command prints."""

    write: Callable[..., None]
    columns: Callable[[Any], Mapping[str, Iterable[object]]]
    figures: Callable[[Any], Mapping[str, "Figure"]]
    show: Callable[..., None] = print


class Result:
    """Result of a study: a short `repr`, a view for notebooks, its main table and its figures.

    Attributes
    ----------
    shown_by : str
        Module below this package with its `VIEWS`, imported where something is shown: a loop over many results imports
        no figures.
    scenario
        The scenario it was made for.
    headline : str
        The finding in a sentence or two.
    """

    __slots__ = ()

    shown_by: ClassVar[str]

    if TYPE_CHECKING:

        @property
        def scenario(self) -> Any:
            """The scenario it was made for."""

        @property
        def headline(self) -> str:
            """The finding in a sentence or two."""

    @property
    def _views(self) -> Views:
        found: Views = import_module(f"tendonff.compensator.{self.shown_by}").VIEWS
        return found

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self._name!r}: {self.headline}>"

    def _repr_html_(self) -> str:
        """Headline, what asks for action, and the first figure, as Jupyter shows it."""
        notes = [note for note in getattr(self, "warnings", ()) if not isinstance(note, Remark)]
        lines = "".join(f"<li>{escape(typeset(note))}</li>" for note in notes)
        figures = self._views.figures(self)
        return (
            f"<p><strong>{escape(type(self).__name__)}: {escape(self._name)}</strong></p>"
            f"<p>{escape(typeset(self.headline))}</p>{f'<ul>{lines}</ul>' if lines else ''}"
            f"{_inline(next(iter(figures.values()))) if figures else ''}"
        )

    def to_frame(self) -> "pd.DataFrame":
        """The main table, as its file has it: a profile, a matrix, estimates, ...; units are in the column names."""
        import pandas as pd

        return pd.DataFrame(self._views.columns(self))

    def plot(self, name: str | None = None) -> "Figure":
        """A figure of the report.

        Parameters
        ----------
        name : str, optional
            Of the figure, as its file has it; default: the first one.

        Raises
        ------
        ParameterError
            If there is no figure of that name.
        """
        figures = self._views.figures(self)
        chosen = next(iter(figures), None) if name is None else name
        if chosen is None or chosen not in figures:
            raise ParameterError(f"name must be one of {', '.join(figures) or 'none'}, got {name!r}")
        return figures[chosen]

    @property
    def _name(self) -> str:
        return str(self.scenario.name)


def _inline(figure: "Figure") -> str:
    """A figure as an element of a page."""
    from tendonff.compensator.reporting.plots import draw_figure

    kind, content = draw_figure(figure)
    media = "svg+xml" if kind == "svg" else kind
    return f'<img style="max-width:100%" src="data:image/{media};base64,{base64.b64encode(content).decode()}">'
