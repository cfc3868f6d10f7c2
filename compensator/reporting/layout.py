"""Places of panels and legends of a figure, from one look at their sizes.

matplotlib's constrained layout looks twice, because tick labels may change with the places; that is the dearest
part of a figure. The first look here is from nearly the right places.
"""

import numpy as np
from matplotlib.figure import Figure

_PAD_IN = 0.042  # around a panel with its labels
_GUESS_IN = (0.6, 0.1)  # room for labels before and behind a row of panels


def lay_out(figure: Figure) -> None:
    """Find the places, once for all files; the figure keeps them."""
    engine = figure.get_layout_engine()
    if engine is None:
        return
    if all(panel.get_subplotspec() is not None for panel in figure.axes):
        _fit_grid(figure)
    else:  # a colour bar
        engine.execute(figure)
    figure.set_layout_engine(None)


def _fit_grid(figure: Figure) -> None:
    """Put the panels of a grid as close as their labels and the legends above and below allow."""
    grid = figure.axes[0].get_subplotspec().get_gridspec()  # type: ignore[union-attr]
    dpi, size = figure.dpi, np.array(figure.bbox.size)
    pad, (before, behind) = _PAD_IN * dpi, (each * dpi for each in _GUESS_IN)
    low, high = _legends(figure)
    figure.set_layout_engine(None)
    figure.subplots_adjust(
        left=before / size[0],
        right=1 - behind / size[0],
        bottom=(low + before / 1.5) / size[1],
        top=1 - (high + before / 2.5) / size[1],
    )
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    margins = [np.zeros((count, 2)) for count in (grid.ncols, grid.nrows)]  # of columns, of rows from above
    for panel in figure.axes:
        box, spec = panel.get_tightbbox(renderer, for_layout_only=True), panel.get_subplotspec()
        if box is None or spec is None:
            continue
        place = panel.get_window_extent(renderer)
        sides = (
            (spec.colspan, place.x0 - box.x0, box.x1 - place.x1),
            (spec.rowspan, box.y1 - place.y1, place.y0 - box.y0),
        )
        for margin, (span, first, last) in zip(margins, sides, strict=True):
            margin[span.start, 0] = max(margin[span.start, 0], first)
            margin[span.stop - 1, 1] = max(margin[span.stop - 1, 1], last)
    across = _edges(margins[0] + pad, size[0], grid.get_width_ratios())
    down = _edges(margins[1] + pad, size[1] - low - high, grid.get_height_ratios())
    for panel in figure.axes:
        if (spec := panel.get_subplotspec()) is None:
            continue
        left, right = across[spec.colspan.start, 0], across[spec.colspan.stop - 1, 1]
        top, bottom = (size[1] - high - y for y in (down[spec.rowspan.start, 0], down[spec.rowspan.stop - 1, 1]))
        panel.set_position((left / size[0], bottom / size[1], (right - left) / size[0], (top - bottom) / size[1]))


def _legends(figure: Figure) -> tuple[float, float]:
    """Heights that legends of the figure take below and above its panels [px]."""
    taken = [0.0, 0.0]
    for legend in figure.legends:
        box = legend.get_window_extent()
        above = int(box.y0 + box.y1 > figure.bbox.height)
        gap = figure.bbox.height - box.y1 if above else box.y0
        taken[above] = max(taken[above], box.height + gap)
    return taken[0], taken[1]


def _edges(margins: "np.ndarray[tuple[int, int], np.dtype[np.float64]]", size: float, ratios: object) -> np.ndarray:
    """Begin and end of each panel along one direction, shape (panels, 2) [px]."""
    share = np.asarray(ratios, dtype=np.float64)
    inner = (size - margins.sum()) * share / share.sum()
    begin = np.cumsum(margins[:, 0]) + np.concatenate([[0.0], np.cumsum(inner + margins[:, 1])[:-1]])
    return np.column_stack([begin, begin + inner])
