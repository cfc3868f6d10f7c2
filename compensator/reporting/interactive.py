"""A view with zoom, hover and a legend that hides curves, inside a report: Bokeh's, with its script in the page."""

from collections.abc import Mapping

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import InputError
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.reporting.page import Interactive

_MOST_POINTS = 2000
DASHES = {":": "dotted", "-.": "dashdot", "-": "solid", "--": "dashed"}

Curves = Mapping[str, tuple[FloatArray, Style]]


def zoomed(time_s: FloatArray, panels: Mapping[str, Curves], said: str) -> Interactive:
    """The block of a report with these panels, and what is said of them."""
    hint = "Drag a box to zoom, hover for values, click a name in a legend to hide its curve."
    return Interactive(html=interactive_view(time_s, panels), caption=f"{hint} {said}")


def interactive_view(time_s: FloatArray, panels: Mapping[str, Curves]) -> str:
    """HTML of panels over one time axis, by the label of the vertical axis; nothing in it is loaded from elsewhere.

    Curves are shape (n,), by their names in the legend. InputError if Bokeh is not installed.
    """
    try:
        from bokeh.embed import components
        from bokeh.layouts import column
        from bokeh.models.ranges import Range1d
        from bokeh.models.sources import ColumnDataSource
        from bokeh.models.tools import BoxZoomTool, HoverTool, PanTool, ResetTool, WheelZoomTool
        from bokeh.plotting import figure
        from bokeh.resources import Resources
    except ModuleNotFoundError as error:
        if error.name != "bokeh":
            raise
        raise InputError("the interactive view needs Bokeh, which is not installed: pip install bokeh") from None
    rows = slice(None, None, max(1, len(time_s) // _MOST_POINTS))
    shared, drawn = Range1d(start=float(time_s[0]), end=float(time_s[-1])), []
    for label, curves in panels.items():
        panel = figure(
            height=340,
            sizing_mode="stretch_width",
            toolbar_location="above",
            frame_align=False,
            x_range=shared,
            x_axis_label="time [s]",
            y_axis_label=label,
            tools=[PanTool(), BoxZoomTool(), WheelZoomTool(), ResetTool()],
        )
        for name, (values, style) in curves.items():
            source = ColumnDataSource(data={"time": np.asarray(time_s)[rows], "value": np.asarray(values)[rows]})
            line = panel.line(
                "time",
                "value",
                source=source,
                color=style.color,
                line_dash=DASHES[style.linestyle],
                line_width=1.8,
                legend_label=name,
            )
            tips = [("", name), ("time [s]", "@time{0.000}"), (label, "@value{0.000}")]
            panel.add_tools(HoverTool(renderers=[line], tooltips=tips, visible=len(panel.renderers) == 1))
        panel.add_layout(panel.legend[0], "below")
        panel.legend.update(click_policy="hide", label_text_font_size="8pt", ncols=2, border_line_alpha=0.0)
        panel.legend.update(location="top_left", spacing=0, margin=0, padding=0)
        panel.legend.update(label_width=118, label_standoff=3, glyph_width=12)  # fits beside the axis on a phone
        drawn.append(panel)
    script, place = components(column(*drawn, sizing_mode="stretch_width"))
    own = Resources(mode="inline", components=["bokeh"])  # no widgets, no WebGL
    return f"{own.render_js()}\n{script}\n{place}"
