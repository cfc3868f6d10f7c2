"""Results: what every one of them can show, and the functions that a study registers to show it.

A result knows its numbers; the study that makes it registers what writes its files, draws its figures and lists its
main table.
"""

import base64
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.typeset import typeset
from tendonff.models.errors import ParameterError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """Functions of a result: its files, the columns of its main table, its figures by name."""

    write: Callable[..., None]
    columns: Callable[[Any], Mapping[str, Iterable[object]]]
    figures: Callable[[Any], Mapping[str, "Figure"]]


_VIEWS: dict[type, Views] = {}


def register_views(kind: type, views: Views) -> None:
    """State what writes and shows results of a kind; `write` takes the result, the folder and options by keyword."""
    _VIEWS[kind] = views


def views_of(kind: type) -> Views:
    """Return what writes and shows results of a kind.

    Raises
    ------
    TypeError
        If the study that makes them was not imported, as where a result was unpickled.
    """
    if kind not in _VIEWS:
        raise TypeError(
            f"cannot write or show a {kind.__name__}: the function that makes one was not imported; "
            "import it from tendonff first"
        )
    return _VIEWS[kind]


class Result:
    """Result of a study: a short `repr`, a view for notebooks, its main table and its figures.

    Attributes
    ----------
    scenario
        The scenario it was made for.
    headline : str
        The finding in a sentence or two.
    """

    __slots__ = ()

    if TYPE_CHECKING:

        @property
        def scenario(self) -> Any:
            """The scenario it was made for."""

        @property
        def headline(self) -> str:
            """The finding in a sentence or two."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self._name!r}: {self.headline}>"

    def _repr_html_(self) -> str:
        """Headline, what asks for action, and the first figure, as Jupyter shows it."""
        notes = [note for note in getattr(self, "warnings", ()) if not isinstance(note, Remark)]
        lines = "".join(f"<li>{escape(typeset(note))}</li>" for note in notes)
        figures = views_of(type(self)).figures(self)
        return (
            f"<p><strong>{escape(type(self).__name__)}: {escape(self._name)}</strong></p>"
            f"<p>{escape(typeset(self.headline))}</p>{f'<ul>{lines}</ul>' if lines else ''}"
            f"{_inline(next(iter(figures.values()))) if figures else ''}"
        )

    def to_frame(self) -> "pd.DataFrame":
        """The main table, as its file has it: a profile, a matrix, estimates, ...; units are in the column names."""
        import pandas as pd

        return pd.DataFrame(views_of(type(self)).columns(self))

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
        figures = views_of(type(self)).figures(self)
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
