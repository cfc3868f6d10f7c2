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

from tendonff.compensator.explore.run import FAST, SLOW, Curve, Exploration, ExploreParameters, Explorer
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.reporting.interactive import DASHES
from tendonff.compensator.scenario.scenario import Scenario, scenario_to_toml
from tendonff.models.errors import TendonffError

ADDRESS = "127.0.0.1"  # the only address that the page is served on

_STALE = 0.25  # opacity of what was computed for other values
_EMPTY: dict[str, Any] = {"time": [], "force": [], "output": [], "error": []}
_PANELS = {
    "loop": ("Tendon hysteresis", "force", "output", "force [N]", "output tension [N]"),
    "force": ("Force profile", "time", "force", "time [s]", "force [N]"),
    "output": ("Output tension (black: reference)", "time", "output", "time [s]", "tension [N]"),
    "error": ("Error", "time", "error", "time [s]", "error [N]"),
}
_TEMPLATE = """{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body { margin: 8px; font-family: system-ui, sans-serif; }</style>{% endblock %}"""
_DOWNLOAD = """
const text = source.data.text[0], link = document.createElement("a");
link.href = URL.createObjectURL(new Blob([text], {type: "application/toml"}));
link.download = name; link.click(); URL.revokeObjectURL(link.href);"""


class ExplorerPage:
    """Page of a visitor."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario, self._explorer = scenario, Explorer(scenario)
        start = self._explorer.start
        self._document: Document | None = None
        self._waiting = False
        self._sliders = {
            "mu": _slider("friction coefficient mu [-]", start.mu, 0.0, max(0.5, 2 * start.mu), 0.005, "0.000"),
            "total_angle_deg": _slider(
                "wrap angle [deg]", start.total_angle_deg, 0.0, max(360.0, 1.5 * start.total_angle_deg), 5.0, "0"
            ),
        }
        self._logarithmic = {
            "bristle_stiffness_N_per_m": _log_slider("bristle stiffness [N/m]", start.bristle_stiffness_N_per_m, 1.5),
            "relaxation_time_s": _log_slider("relaxation time [s]", start.relaxation_time_s, 1.5),
            "force_rate_max_N_per_s": _log_slider("rate limit of the force [N/s]", start.force_rate_max_N_per_s, 3.0),
            "load_stiffness_N_per_m": _log_slider("load stiffness [N/m]", start.load_stiffness_N_per_m, 1.0),
            "load_mass_kg": _log_slider("load mass [kg]", start.load_mass_kg, 1.0),
        }
        self._poses = {
            name: _slider(f"pose: {name} turned by [deg]", 0.0, -45.0, 45.0, 1.0, "0") for name in start.pose_deg
        }
        self._knows = Checkbox(label="Redesign for these values (unticked: keep the scenario's design)", active=False)
        self._slow = {curve.name: Checkbox(label=f"Show: {curve.label}", active=False) for curve in SLOW}
        self._worst = Checkbox(label="State the worst case over [robust]", active=False)
        self._scores = Div(text="", sizing_mode="stretch_width")
        self._sources = {curve.name: ColumnDataSource(data=_EMPTY) for curve in (*FAST, *SLOW)}
        self._wanted = ColumnDataSource(data={"time": [], "tension": []})
        self._toml = ColumnDataSource(data={"text": [""]})
        self._drawn: dict[str, list[GlyphRenderer[Any]]] = {curve.name: [] for curve in (*FAST, *SLOW)}
        self._percent: dict[str, str] = {}
        self._panels = self._figures()
        self.update()
        self.fit_scales()

    def add_to(self, document: Document) -> None:
        """Put the page into a document of the server."""
        self._document = document
        sliders = [*self._sliders.values(), *self._logarithmic.values(), *self._poses.values()]
        for slider in sliders:
            slider.on_change("value", self._changed)
        for box in (self._knows, self._worst, *self._slow.values()):
            box.on_change("active", self._changed)
        fit = Button(label="Fit the scales to the curves")
        fit.on_click(self.fit_scales)
        save = Button(label="Save these values as TOML")
        save.js_on_click(
            CustomJS(args={"source": self._toml, "name": f"explored_{self._scenario.source.name}"}, code=_DOWNLOAD)
        )
        heading = Div(text=f"<h1 style='font-size:1.2rem;margin:0'>{escape(self._scenario.name)}</h1>")
        boxes = (self._knows, self._worst, *self._slow.values(), fit, save)
        wide = {"flex": "1 1 300px", "min-width": "280px", "max-width": "420px"}
        controls = column(heading, *sliders, *boxes, self._scores, styles=wide, sizing_mode="stretch_width")
        panels = row(
            *self._panels.values(), sizing_mode="stretch_width", styles={"flex-wrap": "wrap", "flex": "3 1 340px"}
        )
        document.add_root(row(controls, panels, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"}))
        document.template = Template(_TEMPLATE)
        document.title = f"tendonff: {self._scenario.name}"

    def _changed(self, _attribute: str, _old: object, _new: object) -> None:
        """Ask for an update; while one waits, further movements of a slider join it."""
        if self._document is None or self._waiting:
            return
        self._waiting = True
        self._document.add_next_tick_callback(self.update)

    def parameters(self) -> ExploreParameters:
        """Where the sliders stand."""
        values = {name: float(slider.value) for name, slider in self._sliders.items()}
        values |= {name: 10.0 ** float(slider.value) for name, slider in self._logarithmic.items()}
        return ExploreParameters(**values, pose_deg={name: float(s.value) for name, s in self._poses.items()})

    def update(self) -> None:
        """Compute with the present slider values and show the result, or a message where that fails."""
        self._waiting = False
        parameters, knows = self.parameters(), bool(self._knows.active)
        try:
            shown = self._explorer.at(parameters, design_knows=knows)
        except TendonffError as error:
            for name in self._drawn:
                self._fade(name, stale=True)
            self._scores.text = (
                f"<p role='alert'><b>Infeasible:</b> {escape(str(error))}</p>"
                "<p>The pale curves show the last feasible values.</p>"
            )
            return
        self._show(shown, {})
        reference = shown.reference
        rows = slice(None, None, max(1, len(reference.time_s) // len(next(iter(shown.courses.values())).time_s)))
        self._wanted.data = {"time": reference.time_s[rows], "tension": reference.tension_N[rows]}
        self._toml.data = {"text": [scenario_to_toml(parameters.apply(self._scenario))]}
        wanted = [curve for curve in SLOW if self._slow[curve.name].active]
        for curve in SLOW:
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
            self._document.add_next_tick_callback(lambda: self._add_slow(shown, wanted, parameters))

    def _add_slow(self, fast: Exploration, wanted: list[Curve], asked: ExploreParameters | None = None) -> None:
        """Compute what takes a second, unless the sliders have moved on."""
        parameters = self.parameters()
        if asked is not None and (asked != parameters or self._waiting):
            return
        knows = bool(self._knows.active)
        self._show(self._explorer.at(parameters, design_knows=knows, curves=wanted), fast.courses)
        if self._worst.active:
            stated = self._explorer.worst_case(parameters, design_knows=knows)
            self._scores.text += f"<p role='status'>{escape(stated)}</p>"

    def _show(self, shown: Exploration, before: Mapping[str, Any]) -> None:
        """Curves and scores of what was computed, beside those that were before."""
        for name, course in shown.courses.items():
            self._sources[name].data = {
                "time": course.time_s,
                "force": course.force_N,
                "output": course.output_N,
                "error": course.error_N,
            }
            self._fade(name, stale=False)
        courses = {**before, **shown.courses}
        lines = "".join(
            f"<tr><td style='color:{curve.style.color}'>&#9632;</td><td>{escape(curve.label)}</td>"
            f"<td style='text-align:right'>{escape(courses[curve.name].score.percent)} %</td></tr>"
            for curve in (*FAST, *SLOW)
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
            _, x, y, *_ = _PANELS[key]
            for axis, name in ((panel.x_range, x), (panel.y_range, y)):
                parts = [np.asarray(source.data[name], float) for source in self._sources.values()]
                if name == "output":
                    parts.append(np.asarray(self._wanted.data["tension"], float))
                values = np.concatenate(parts)
                low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
                margin = 0.0 if name == "time" else 0.05 * max(high - low, 1e-6)
                axis.update(start=low - margin, end=high + margin, reset_start=low - margin, reset_end=high + margin)

    def _figures(self) -> dict[str, figure]:
        """Loop, profile, output and error; the three over time share their axis, all share the legend."""
        panels: dict[str, figure] = {}
        time = Range1d()
        for key, (title, x, y, x_label, y_label) in _PANELS.items():
            panel = panels[key] = figure(
                title=title,
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
            for curve in (*FAST, *SLOW):
                line = panel.line(
                    x,
                    y,
                    source=self._sources[curve.name],
                    color=curve.style.color,
                    line_dash=DASHES[curve.style.linestyle],
                    line_width=1.8,
                )
                tips = [("", curve.label), (x_label, f"@{x}{{0.000}}"), (y_label, f"@{y}{{0.000}}")]
                panel.add_tools(HoverTool(renderers=[line], tooltips=tips, visible=curve is FAST[0]))
                for first in self._drawn[curve.name][:1]:  # the legend hides a compensator in every panel
                    first.js_link("visible", line, "visible")
                self._drawn[curve.name].append(line)
        panels["output"].line("time", "tension", source=self._wanted, color="black", line_width=1)
        entries = [LegendItem(label=c.label, renderers=[self._drawn[c.name][0]]) for c in (*FAST, *SLOW)]
        panels["loop"].add_layout(
            Legend(items=entries, click_policy="hide", ncols=2, label_text_font_size="9pt"), "below"
        )
        return panels


def _slider(title: str, value: float, start: float, end: float, step: float, shown: str) -> Slider:
    return Slider(title=title, value=value, start=start, end=end, step=step, format=shown, sizing_mode="stretch_width")


def _log_slider(title: str, value: float, decades: float) -> Slider:
    """Slider of the decimal logarithm, so many decades either way; it shows the value itself."""
    centre = log10(value)
    shown = CustomJSTickFormatter(code="return String(Number((10 ** tick).toPrecision(3)))")
    start, end = centre - decades, centre + decades
    return Slider(title=title, value=centre, start=start, end=end, step=0.01, format=shown, sizing_mode="stretch_width")


def make_server(scenario: Scenario, port: int) -> Server:
    """Server of the page, on this machine only, at a port (0: any that is free); not started yet.

    InputError if the port is taken, TendonffError if the scenario itself cannot be computed.
    """
    explorer = Explorer(scenario)
    explorer.at(explorer.start)  # errors of the scenario are reported here, not in the browser

    def page(document: Document) -> None:
        ExplorerPage(scenario).add_to(document)

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
