"""The interactive page: sliders, and curves that follow them. Served on this machine only.

The page is Bokeh's (an optional dependency); its scripts come from the server itself, nothing from the network.
"""

import errno
from collections.abc import Mapping
from html import escape
from math import log10
from typing import Any

import numpy as np
from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models.annotations import Legend, LegendItem
from bokeh.models.callbacks import CustomJS
from bokeh.models.formatters import CustomJSTickFormatter
from bokeh.models.ranges import Range1d
from bokeh.models.renderers import GlyphRenderer
from bokeh.models.sources import ColumnDataSource
from bokeh.models.tools import BoxZoomTool, HoverTool, PanTool, ResetTool, SaveTool, WheelZoomTool
from bokeh.models.widgets import Button, Checkbox, Div, Slider
from bokeh.plotting import figure
from bokeh.server.server import Server
from jinja2 import Template

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.reporting.interactive import DASHES
from tendonff.compensator.scenario.knobs import Knob
from tendonff.compensator.studies.explore.result import Curve, Exploration
from tendonff.compensator.studies.explore.run import Explorer
from tendonff.models.errors import TendonffError

ADDRESS = "127.0.0.1"  # the only address that the page is served on

_STALE = 0.25  # opacity of what was computed for other values
_EMPTY: dict[str, Any] = {"time": [], "given": [], "output": [], "error": []}
_TEMPLATE = """{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body { margin: 8px; font-family: system-ui, sans-serif; }</style>{% endblock %}"""
_DOWNLOAD = """
const text = source.data.text[0], link = document.createElement("a");
link.href = URL.createObjectURL(new Blob([text], {type: "application/toml"}));
link.download = name; link.click(); URL.revokeObjectURL(link.href);"""


class ExplorerPage:
    """Page of a visitor."""

    def __init__(self, subject: Explorer) -> None:
        self._subject = subject
        self._document: Document | None = None
        self._waiting = False
        self._curves = (*subject.fast, *subject.slow)
        self._sliders = {
            knob.key: _log_slider(knob) if knob.is_logarithmic else _slider(knob) for knob in subject.knobs
        }
        self._knows = Checkbox(label="Redesign for these values (unticked: keep the scenario's design)", active=False)
        self._slow = {curve.name: Checkbox(label=f"Show: {curve.label}", active=False) for curve in subject.slow}
        self._worst = Checkbox(label="State the worst case over [robust]", active=False)
        self._scores = Div(text="", sizing_mode="stretch_width")
        self._sources = {curve.name: ColumnDataSource(data=_EMPTY) for curve in self._curves}
        self._wanted = ColumnDataSource(data={"time": [], "wanted": []})
        self._toml = ColumnDataSource(data={"text": [""]})
        self._drawn: dict[str, list[GlyphRenderer[Any]]] = {curve.name: [] for curve in self._curves}
        self._percent: dict[str, str] = {}
        self._panels = self._figures()
        self.update()
        self.fit_scales()

    def add_to(self, document: Document) -> None:
        """Put the page into a document of the server."""
        self._document = document
        sliders = list(self._sliders.values())
        for slider in sliders:
            slider.on_change("value", self._changed)
        for box in (self._knows, self._worst, *self._slow.values()):
            box.on_change("active", self._changed)
        fit = Button(label="Fit the scales to the curves")
        fit.on_click(self.fit_scales)
        save = Button(label="Save these values as TOML")
        save.js_on_click(
            CustomJS(args={"source": self._toml, "name": f"explored_{self._subject.file}"}, code=_DOWNLOAD)
        )
        heading = Div(text=f"<h1 style='font-size:1.2rem;margin:0'>{escape(self._subject.name)}</h1>")
        boxes = [self._knows, self._worst, *self._slow.values(), fit]
        if self._toml.data["text"][0]:
            boxes.append(save)
        wide = {"flex": "1 1 300px", "min-width": "280px", "max-width": "420px"}
        controls = column(heading, *sliders, *boxes, self._scores, styles=wide, sizing_mode="stretch_width")
        panels = row(
            *self._panels.values(), sizing_mode="stretch_width", styles={"flex-wrap": "wrap", "flex": "3 1 340px"}
        )
        document.add_root(row(controls, panels, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"}))
        document.template = Template(_TEMPLATE)
        document.title = f"tendonff: {self._subject.name}"

    def _changed(self, _attribute: str, _old: object, _new: object) -> None:
        """Ask for an update; while one waits, further movements of a slider join it."""
        if self._document is None or self._waiting:
            return
        self._waiting = True
        self._document.add_next_tick_callback(self.update)

    def values(self) -> dict[str, float]:
        """Where the sliders stand, by key."""
        return {
            knob.key: 10.0 ** float(slider.value) if knob.is_logarithmic else float(slider.value)
            for knob, slider in zip(self._subject.knobs, self._sliders.values(), strict=True)
        }

    def update(self) -> None:
        """Compute with the present slider values and show the result, or a message where that fails."""
        self._waiting = False
        values, knows = self.values(), bool(self._knows.active)
        try:
            shown = self._subject.explore(values, design_knows=knows, curves=self._subject.fast)
        except TendonffError as error:
            for name in self._drawn:
                self._fade(name, stale=True)
            self._scores.text = (
                f"<p role='alert'><b>Infeasible:</b> {escape(str(error))}</p>"
                "<p>The pale curves show the last feasible values.</p>"
            )
            return
        self._show(shown, {})
        self._wanted.data = {"time": shown.time_s, "wanted": shown.wanted}
        self._toml.data = {"text": [self._subject.toml(values)]}
        wanted = [curve for curve in self._subject.slow if self._slow[curve.name].active]
        for curve in self._subject.slow:
            self._fade(curve.name, stale=True)
            if curve not in wanted:
                self._sources[curve.name].data = _EMPTY
        if not wanted and not self._worst.active:
            return
        if self._document is None:
            self._add_slow(shown, wanted)
        else:  # in the next round, so that the fast ones are seen meanwhile
            asked = [curve.label for curve in wanted] + ["worst case"] * bool(self._worst.active)
            self._scores.text += f"<p role='status'>Computing: {escape(', '.join(asked))}</p>"
            self._document.add_next_tick_callback(lambda: self._add_slow(shown, wanted, values))

    def _add_slow(self, fast: Exploration, wanted: list[Curve], asked: dict[str, float] | None = None) -> None:
        """Compute what takes a second, unless the sliders have moved on."""
        values = self.values()
        if asked is not None and (asked != values or self._waiting):
            return
        knows = bool(self._knows.active)
        try:
            self._show(self._subject.explore(values, design_knows=knows, curves=wanted), fast.courses)
            if self._worst.active:
                stated = self._subject.worst_case(values, design_knows=knows)
                self._scores.text += f"<p role='status'>{escape(stated)}</p>"
        except TendonffError as error:
            self._scores.text += f"<p role='alert'>{escape(str(error))}</p>"

    def _show(self, shown: Exploration, before: Mapping[str, Any]) -> None:
        """Curves and scores of what was computed, beside those that were before."""
        for name, course in shown.courses.items():
            self._sources[name].data = {
                "time": course.time_s,
                "given": course.given,
                "output": course.output,
                "error": course.error,
            }
            self._fade(name, stale=False)
        courses = {**before, **shown.courses}
        lines = "".join(
            f"<tr><td style='color:{curve.style.color}'>&#9632;</td><td>{escape(curve.label)}</td>"
            f"<td style='text-align:right'>{escape(courses[curve.name].score.percent)} %</td></tr>"
            for curve in self._curves
            if curve.name in courses
        )
        notes = "".join(f"<p>{escape(note)}</p>" for note in shown.notes)
        self._scores.text = f"<table><caption>RMS error, % of reference range</caption>{lines}</table>{notes}"

    def _fade(self, name: str, *, stale: bool) -> None:
        """Grey out a curve that was computed for other values."""
        for renderer in self._drawn[name]:
            renderer.glyph.line_alpha = _STALE if stale else 1.0

    def fit_scales(self) -> None:
        """Set scales that hold all curves; they are fixed until the next call, so that changes can be seen."""
        for key, panel in self._panels.items():
            x, y = self._subject.panels[key].x, self._subject.panels[key].y
            for axis, name in ((panel.x_range, x), (panel.y_range, y)):
                parts = [np.asarray(source.data[name], float) for source in self._sources.values()]
                if name == "output":
                    parts.append(np.asarray(self._wanted.data["wanted"], float))
                values = np.concatenate(parts)
                low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
                margin = 0.0 if name == "time" else 0.05 * max(high - low, 1e-6)
                axis.update(start=low - margin, end=high + margin, reset_start=low - margin, reset_end=high + margin)

    def _figures(self) -> dict[str, figure]:
        """Loop, profile, output and error; the three over time share their axis, all share the legend."""
        panels: dict[str, figure] = {}
        time = Range1d()
        for key, each in self._subject.panels.items():
            x, y, x_label, y_label = each.x, each.y, each.x_label, each.y_label
            panel = panels[key] = figure(
                title=each.title,
                x_axis_label=x_label,
                y_axis_label=y_label,
                x_range=time if x == "time" else Range1d(),
                y_range=Range1d(),
                tools=[PanTool(), BoxZoomTool(), WheelZoomTool(), ResetTool(), SaveTool()],
                toolbar_location="above",
                sizing_mode="stretch_width",
                height=360,
                frame_align=False,  # the legend takes its place from one panel alone
                styles={"flex": "1 1 330px", "min-width": "290px"},
            )
            for curve in self._curves:
                line = panel.line(
                    x,
                    y,
                    source=self._sources[curve.name],
                    color=curve.style.color,
                    line_dash=DASHES[curve.style.linestyle],
                    line_width=1.8,
                )
                tips = [("", curve.label), (x_label, f"@{x}{{0.000}}"), (y_label, f"@{y}{{0.000}}")]
                panel.add_tools(HoverTool(renderers=[line], tooltips=tips, visible=curve is self._curves[0]))
                for first in self._drawn[curve.name][:1]:  # the legend hides a compensator in every panel
                    first.js_link("visible", line, "visible")
                self._drawn[curve.name].append(line)
        panels["output"].line("time", "wanted", source=self._wanted, color="black", line_width=1)
        entries = [LegendItem(label=c.label, renderers=[self._drawn[c.name][0]]) for c in self._curves]
        legend = Legend(items=entries, click_policy="hide", ncols=2, label_text_font_size="9pt")
        next(iter(panels.values())).add_layout(legend, "below")
        return panels


def _slider(knob: Knob) -> Slider:
    return Slider(
        title=knob.title,
        value=knob.value,
        start=knob.start,
        end=knob.end,
        step=knob.step,
        format=knob.shown,
        sizing_mode="stretch_width",
    )


def _log_slider(knob: Knob) -> Slider:
    """Slider of the decimal logarithm; it shows the value itself."""
    centre = log10(knob.value)
    shown = CustomJSTickFormatter(code="return String(Number((10 ** tick).toPrecision(3)))")
    return Slider(
        title=knob.title,
        value=centre,
        start=centre + knob.start,
        end=centre + knob.end,
        step=knob.step,
        format=shown,
        sizing_mode="stretch_width",
    )


def make_server(subject: Explorer, port: int) -> Server:
    """Server of the page, on this machine only, at a port (0: any that is free); not started yet.

    InputError if the port is taken, TendonffError if the scenario itself cannot be computed.
    """
    start = {knob.key: knob.value for knob in subject.knobs}
    subject.explore(start, design_knows=True, curves=subject.fast)  # its errors are reported here, not in the browser

    def page(document: Document) -> None:
        ExplorerPage(subject).add_to(document)

    try:
        # Without a list of its own Bokeh accepts pages from localhost at its port, and from nowhere else.
        return Server({"/": Application(FunctionHandler(page))}, address=ADDRESS, port=port)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        raise InputError(f"--port {port} cannot be used ({error.strerror}); give another, or 0 for any") from None


def page_url(server: Server) -> str:
    """Address of the page."""
    return f"http://localhost:{server.port}/"
