"""Common style, colours and file format of every figure that tendonff draws.

Colours are Okabe and Ito's, which stay apart for colour-blind readers; curves that are compared differ in line style
as well, so that they stay apart in a black-and-white print. Figures carry no date: equal results give equal files.
"""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.style
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_file
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILION
from tendonff.compensator.reporting.layout import lay_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tendonff.models.path import JointMotion

CYCLE = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, INK)
LINE_STYLES = ("-", "--", "-.", ":")

PAGE_WIDTH_IN = 7.2  # width of two printed columns

_STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.prop_cycle": cycler(color=CYCLE),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "axes.titley": 1.0,  # not searched: nothing stands above a panel
    "figure.constrained_layout.use": True,
    "figure.dpi": 100,
    "figure.facecolor": "white",
    "font.family": "sans-serif",
    "font.size": 9,
    "grid.color": "#D9D9D9",
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "pdf.fonttype": 42,  # text stays text, and journals accept it
    "savefig.dpi": 200,
    "svg.fonttype": "none",
    "svg.hashsalt": "tendonff",  # the same identifiers in every run
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}


# metadata that matplotlib omits from a file, by its kind: dates and versions
UNDATED: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "ModDate": None},
    "svg": {"Date": None},
}
_LARGEST_SVG_BYTES = 1_000_000  # a dense curve costs more as a path than as pixels
_LETTER_IN = 0.066  # width of a letter of a legend
_HANDLE_IN = 0.55  # its line, and the gap to the next column
_SAME = 0.004  # of the drawn range: about the width of a line
_MOST_POINTS = 4000  # of a curve: more would not be seen


@contextmanager
def figure_style() -> Iterator[None]:
    """The look of our figures, for the block only."""
    with mpl.rc_context(), matplotlib.style.context("default"):
        mpl.rcParams.update(_STYLE)
        yield


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    height_in: float | None = None,
    share_x: bool = False,
    share_y: bool = False,
    height_ratios: Sequence[float] | None = None,
) -> tuple[Figure, "NDArray[np.object_]"]:
    """An empty figure in our style and its panels, without touching matplotlib's global state or a display.

    It is as wide as a printed page, and by default 2.2 in high for each row and another 0.4. Panels of one column may
    share the abscissa, panels of one row the ordinate.

    Returns
    -------
    axes : ndarray of Axes, shape (rows, columns)
    """
    with figure_style():
        figure = Figure(figsize=(PAGE_WIDTH_IN, 2.2 * rows + 0.4 if height_in is None else height_in))
        FigureCanvasAgg(figure)
        axes = figure.subplots(
            rows,
            columns,
            squeeze=False,
            sharex="col" if share_x else False,
            sharey="row" if share_y else False,
            gridspec_kw={} if height_ratios is None else {"height_ratios": list(height_ratios)},
        )
    return figure, axes


def blank_figure(height_in: float) -> Figure:
    """An empty figure as wide as a printed page, whose panels are placed by hand."""
    with figure_style():
        figure = Figure(figsize=(PAGE_WIDTH_IN, height_in))
        figure.set_layout_engine("none")
        FigureCanvasAgg(figure)
    return figure


def thinned(rows: int, most: int = _MOST_POINTS) -> slice:
    """Rows to draw: all of them, or an even selection where more would not be seen."""
    return slice(None, None, max(1, rows // most))


def coinciding(curves: "Mapping[str, NDArray[np.float64]]", span: float) -> dict[str, str]:
    """Curves, shape (n,), that would hide another one, each with the first that it lies on, in the order of drawing.

    What differs by less than 0.4 % of the drawn range looks the same.
    """
    found: dict[str, str] = {}
    names = list(curves)
    for k, name in enumerate(names):
        for earlier in names[:k]:
            if earlier not in found and float(abs(curves[name] - curves[earlier]).max()) < _SAME * span:
                found[name] = earlier
                break
    return found


def legend_below(figure: Figure, panel: Axes, columns: int = 5) -> None:
    """The legend of a panel under the figure, in at most so many columns and no more than its width has room for."""
    handles, labels = panel.get_legend_handles_labels()
    while columns > 1 and _legend_in(labels, columns) > figure.get_figwidth():
        columns -= 1
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _legend_in(labels: Sequence[str], columns: int) -> float:
    """Width of a legend, filled column by column [in]."""
    seen = [re.sub(r"[$_{}\\]", "", label) for label in labels]  # of formulas, what is printed
    lengths = np.array_split([len(label) for label in seen], columns)  # as matplotlib deals them out
    return sum(_LETTER_IN * max(column, default=0) + _HANDLE_IN for column in lengths)


def draw_joints(panel: Axes, motion: "JointMotion", time_s: "FloatArray") -> None:
    """The joint angles under what else a figure shows over time."""
    rows = thinned(len(time_s))
    for k, (name, angle) in enumerate(zip(motion.names, motion.at(time_s).T, strict=True)):
        style = LINE_STYLES[k % len(LINE_STYLES)]
        panel.plot(time_s[rows], angle[rows], color=(INK, GREY)[k % 2], linestyle=style, label=name)
    panel.set(ylabel="joints [rad]")
    panel.legend(loc="lower right", bbox_to_anchor=(1, 1), borderpad=0, ncols=len(motion.names))


def draw_figure(figure: Figure) -> tuple[str, bytes]:
    """Kind and content of a figure as reports show it: "svg", or "png" where its curves are dense."""
    content = _drawn(figure, "svg")
    return ("png", _drawn(figure, "png")) if len(content) > _LARGEST_SVG_BYTES else ("svg", content)


def _drawn(figure: Figure, kind: str) -> bytes:
    buffer = io.BytesIO()
    # A layout engine, even one that does nothing, has all of it drawn once more to find the places.
    with figure_style(), mpl.rc_context({"figure.constrained_layout.use": False}):
        lay_out(figure)
        figure.savefig(buffer, format=kind, metadata=UNDATED[kind])
    return buffer.getvalue()


def save_figure(figure: Figure, path: Path, formats: Sequence[str] = (), *, pdf: bool = False) -> list[Path]:
    """Write a figure as `DIR/name.svg` and so on, whole or not at all; equal figures give equal files.

    Without formats it is written as reports show it, see `draw_figure`, and with `pdf` for a printed page too.
    """
    drawn = [(kind, _drawn(figure, kind)) for kind in formats] if formats else [draw_figure(figure)]
    if pdf:
        drawn.append(("pdf", _drawn(figure, "pdf")))
    written = []
    for kind, content in drawn:
        target = path.with_name(f"{path.name}.{kind}")
        with atomic_file(target) as partial:
            partial.write_bytes(content)
        written.append(target)
    return written


def bode_figure(gains: "Mapping[str, NDArray[np.complex128]]", frequencies_Hz: FloatArray, *, ylabel: str) -> Figure:
    """Size and phase of complex gains over frequency [Hz], shape (n,), > 0, rising: one curve for each, by label.

    `ylabel` names the gain, with its unit.
    """
    with figure_style():
        figure, axes = new_figure(2, 1, share_x=True, height_in=4.4)
        for k, (label, response) in enumerate(gains.items()):
            style = LINE_STYLES[k % len(LINE_STYLES)]
            axes[0, 0].loglog(frequencies_Hz, np.abs(response), style, label=label)
            axes[1, 0].semilogx(frequencies_Hz, np.degrees(np.unwrap(np.angle(response))), style)
        axes[0, 0].set(ylabel=ylabel)
        for axis in (axes[0, 0].yaxis, axes[1, 0].xaxis):
            axis.set_major_formatter("{x:g}")
        axes[1, 0].set(ylabel="phase [deg]", xlabel="frequency [Hz]")
        legend_below(figure, axes[0, 0], columns=4)
    return figure
