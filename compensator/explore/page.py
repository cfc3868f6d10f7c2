"""The interactive page: sliders, and curves that follow them. Served on this machine only.

The page is Bokeh's (an optional dependency); its scripts come from the server itself, nothing from the network.
"""

import errno
from html import escape
from math import log10
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.layouts import column, gridplot, row
from bokeh.models.formatters import CustomJSTickFormatter
from bokeh.models.sources import ColumnDataSource
from bokeh.models.ui.ui_element import UIElement
from bokeh.models.widgets import Checkbox, Div, Slider
from bokeh.plotting import figure
from bokeh.server.server import Server

from tendonff.compensator.explore.result import Course
from tendonff.compensator.explore.run import SHOWN, ExploreParameters, Explorer
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import TendonffError

ADDRESS = "127.0.0.1"
"""The only address that the page is served on."""

_DASHES = {":": "dotted", "-.": "dashdot", "-": "solid", "--": "dashed"}


class ExplorerPage:
    """One visitor's page.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario) -> None:
        self._explorer = Explorer(scenario)
        start = self._explorer.start
        self._document: Document | None = None
        self._waiting = False
        self._mu = _slider("friction coefficient mu [-]", start.mu, 0.0, max(0.5, 2 * start.mu), 0.005, "0.000")
        self._angle = _slider(
            "wrap angle [deg]", start.total_angle_deg, 0.0, max(360.0, 1.5 * start.total_angle_deg), 5.0, "0"
        )
        self._bristle = _log_slider("bristle stiffness [N/m]", start.bristle_stiffness_N_per_m, 1.5)
        self._relaxation = _log_slider("relaxation time [s]", start.relaxation_time_s, 1.5)
        self._rate = _log_slider("rate limit of the force [N/s]", start.force_rate_max_N_per_s, 3.0)
        self._knows = Checkbox(label="Redesign for these values (untick: keep the scenario's design)", active=True)
        self._scores = Div(text="", sizing_mode="stretch_width")
        self._sources = {
            c.name: ColumnDataSource(data={"time": [], "force": [], "output": [], "error": []}) for c in SHOWN
        }
        self._wanted = ColumnDataSource(data={"time": [], "tension": []})
        self._name = scenario.name
        self.update()

    def add_to(self, document: Document) -> None:
        """Put the page into a document of the server.

        Parameters
        ----------
        document : Document
        """
        self._document = document
        sliders = (self._mu, self._angle, self._bristle, self._relaxation, self._rate)
        for slider in sliders:
            slider.on_change("value", self._changed)
        self._knows.on_change("active", self._changed)
        heading = Div(text=f"<h1 style='font-size:1.2rem;margin:0'>{escape(self._name)}</h1>")
        controls = column(heading, *sliders, self._knows, self._scores, width=330)
        document.add_root(row(controls, self._figures(), sizing_mode="stretch_width"))
        document.title = f"tendonff: {self._name}"

    def _changed(self, _attribute: str, _old: object, _new: object) -> None:
        """Ask for an update; while one waits, further movements of a slider join it."""
        if self._document is None or self._waiting:
            return
        self._waiting = True
        self._document.add_next_tick_callback(self.update)

    def parameters(self) -> ExploreParameters:
        """Where the sliders stand."""
        return ExploreParameters(
            mu=float(self._mu.value),
            total_angle_deg=float(self._angle.value),
            bristle_stiffness_N_per_m=10.0 ** float(self._bristle.value),
            relaxation_time_s=10.0 ** float(self._relaxation.value),
            force_rate_max_N_per_s=10.0 ** float(self._rate.value),
        )

    def update(self) -> None:
        """Compute with the sliders where they stand, and show it; what cannot be computed is said in words."""
        self._waiting = False
        try:
            shown = self._explorer.at(self.parameters(), design_knows=bool(self._knows.active))
        except TendonffError as error:
            why = escape(str(error))
            self._scores.text = (
                f"<p role='alert'><b>Infeasible:</b> {why}</p><p>Curves show the last feasible values.</p>"
            )
            return
        lines = "".join(
            f"<tr><td style='color:{c.style.color}'>&#9632;</td><td>{escape(c.label)}</td>"
            f"<td style='text-align:right'>{escape(shown.courses[c.name].score.percent)} %</td></tr>"
            for c in SHOWN
        )
        notes = "".join(f"<p>{escape(note)}</p>" for note in shown.notes)
        self._scores.text = f"<table><caption>RMS error, % of reference range</caption>{lines}</table>{notes}"
        for name, course in shown.courses.items():
            self._sources[name].data = _columns(course)
        first = next(iter(shown.courses.values()))
        self._wanted.data = {"time": first.time_s, "tension": first.output_N - first.error_N}

    def _figures(self) -> UIElement:
        """Loop, profile, output and error; the three over time share their axis."""
        loop = figure(title="Tendon hysteresis", x_axis_label="force [N]", y_axis_label="output tension [N]")
        force = figure(title="Force profile", x_axis_label="time [s]", y_axis_label="force [N]")
        output = figure(
            title="Output tension (black: reference)",
            x_axis_label="time [s]",
            y_axis_label="tension [N]",
            x_range=force.x_range,
        )
        error = figure(title="Error", x_axis_label="time [s]", y_axis_label="error [N]", x_range=force.x_range)
        for panel, x, y in (
            (loop, "force", "output"),
            (force, "time", "force"),
            (output, "time", "output"),
            (error, "time", "error"),
        ):
            for compensator in SHOWN:
                panel.line(
                    x,
                    y,
                    source=self._sources[compensator.name],
                    color=compensator.style.color,
                    line_dash=_DASHES[compensator.style.linestyle],
                    line_width=1.5,
                )
        output.line("time", "tension", source=self._wanted, color="black", line_width=1)
        panels: list[list[UIElement | None]] = [[loop, force], [output, error]]
        return gridplot(panels, sizing_mode="stretch_width", height=300, toolbar_location=None)


def _columns(course: Course) -> dict[str, Any]:
    return {"time": course.time_s, "force": course.force_N, "output": course.output_N, "error": course.error_N}


def _slider(title: str, value: float, start: float, end: float, step: float, shown: str) -> Slider:
    return Slider(title=title, value=value, start=start, end=end, step=step, format=shown)


def _log_slider(title: str, value: float, decades: float) -> Slider:
    """Slider of the decimal logarithm, so many decades either way; it shows the value itself."""
    centre = log10(value)
    shown = CustomJSTickFormatter(code="return String(Number((10 ** tick).toPrecision(3)))")
    return Slider(title=title, value=centre, start=centre - decades, end=centre + decades, step=0.01, format=shown)


def make_server(scenario: Scenario, port: int) -> Server:
    """Server of the page, on this machine only; not started yet.

    Parameters
    ----------
    scenario : Scenario
    port : int
        0 for any that is free.

    Raises
    ------
    InputError
        If the port is taken.
    TendonffError
        If the scenario itself cannot be computed.
    """
    explorer = Explorer(scenario)
    explorer.at(explorer.start)  # what is wrong with the scenario is said here, not in the browser

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
    """Address of the page.

    Parameters
    ----------
    server : Server
    """
    return f"http://localhost:{server.port}/"
