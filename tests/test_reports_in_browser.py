"""Reports and the interactive page in a real browser: Chromium without a screen."""

import re
import threading
from contextlib import contextmanager

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.reporting.interactive import interactive_view
from tendonff.compensator.reporting.page import (
    FileNote,
    Interactive,
    Picture,
    Provenance,
    Report,
    Section,
    Table,
    Text,
    write_report,
)
from tendonff.compensator.reporting.plots import new_figure
from tendonff.compensator.scenarios import load_scenario

selenium = pytest.importorskip("selenium", reason="selenium is not installed")
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402

PHONE_WIDTH = 375
READABLE_PX = 12


@contextmanager
def phone(browser):
    """The viewport of a phone for the block."""
    size = {"width": PHONE_WIDTH, "height": 700, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    yield
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def complaints(browser):
    return [entry for entry in browser.get_log("browser") if entry["level"] in ("WARNING", "SEVERE")]


@pytest.fixture(scope="module")
def page(tmp_path_factory, examples):
    """Address of a report that holds every kind of block."""
    figure, axes = new_figure()
    time = np.linspace(0, 4, 4001)
    axes[0, 0].plot(time, np.sin(time), label="a line")
    axes[0, 0].set(xlabel="time [s]", ylabel="tension [N]")
    dense, dense_axes = new_figure()
    dense_axes[0, 0].scatter(np.sin(7 * np.arange(30_000)), np.cos(11 * np.arange(30_000)), s=1)
    wide = Table(
        caption="A wide table",
        columns=("design", *(f"a plant with a name too long for one line {k}" for k in range(8))),
        rows=(("inverse", *(1.0 / (k + 1) for k in range(8))),),
    )
    report = Report(
        title="A design with <b>odd</b> & long names_without_any_place_to_break_that_go_on_and_on_and_on_and_on",
        summary=f"The profile leaves 0.12 % of range. Next: {' '.join(['tendonff x --suggest --out excite'] * 9)}",
        warnings=("<script>document.title='broken into'</script>",),
        sections=(
            Section(title="Pictures", blocks=(Text("Look."), Picture(figure=figure, caption="A sine."))),
            Section(title="More", blocks=(Picture(figure=dense, caption="Dots."), wide)),
        ),
        provenance=Provenance(scenario=load_scenario(examples / "finger.toml"), command="tendonff design finger.toml"),
        files=(FileNote(name="profile.csv", content="the forces"),),
    )
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, report)
    return path.as_uri()


def test_a_report_opens_from_disk_without_a_complaint(browser, page):
    browser.get(page)
    assert browser.title.startswith("A design")  # and no script of the warning's ran
    assert complaints(browser) == []


def test_every_figure_of_a_report_is_drawn(browser, page):
    browser.get(page)
    sizes = browser.execute_script(
        "return [...document.images].map(i => [i.complete, i.naturalWidth, i.clientWidth, i.clientHeight])"
    )
    assert len(sizes) == 3  # its own, and the drawing of the scenario
    for complete, natural, width, height in sizes:
        assert complete
        assert natural > 0
        assert width > 300
        assert height > 50
    dark = browser.execute_script(
        """const i = document.images[0], c = document.createElement('canvas');
        c.width = 200; c.height = 80;
        const g = c.getContext('2d'); g.drawImage(i, 0, 0, 200, 80);
        return [...g.getImageData(0, 0, 200, 80).data].filter((v, k) => k % 4 < 3 && v < 200).length"""
    )
    assert dark > 100  # something is drawn on the white


@pytest.mark.parametrize(("width", "height", "screens"), [(1280, 800, 1), (390, 844, 2)])
def test_the_first_figure_of_a_report_is_seen_at_once(browser, output, width, height, screens):
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    for command in ("design", "compare"):
        browser.get((output(command, "finger").folder / "report.html").as_uri())
        lowest = browser.execute_script("return document.images[0].getBoundingClientRect().bottom")
        assert 0 < lowest <= screens * height, command
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_report_is_readable_on_a_phone(browser, page):
    """Nothing reaches beyond the screen but what moves sideways, and no text is small."""
    with phone(browser):
        browser.get(page)
        inner, whole = browser.execute_script("return [window.innerWidth, document.documentElement.scrollWidth]")
        assert whole <= inner <= PHONE_WIDTH
        smallest = browser.execute_script(
            """return Math.min(...[...document.querySelectorAll('body *')]
                .filter(e => [...e.childNodes].some(n => n.nodeType == 3 && n.textContent.trim()))
                .map(e => parseFloat(getComputedStyle(e).fontSize)))"""
        )
        assert smallest >= READABLE_PX
        # A figure fits the screen; a tap gives it the size at which its smallest text, 8 pt on 7.2 in, is readable.
        assert browser.execute_script("return document.images[0].clientWidth") <= PHONE_WIDTH
        browser.find_element("css selector", "figure label").click()
        assert 8 * browser.execute_script("return document.images[0].clientWidth") / (7.2 * 72) >= 8
        # A row of a table is a card: each number beside the name of its column.
        assert browser.execute_script("return getComputedStyle(document.querySelector('.cards thead')).width") == "1px"
        cells = browser.execute_script("return [...document.querySelectorAll('.cards td')].map(e => e.dataset.column)")
        assert cells
        assert all(cells)
        assert not browser.execute_script(
            "return [...document.querySelectorAll('.cards td')].filter(e => e.scrollWidth > e.clientWidth).length"
        )
        # No line ends inside an option of a command.
        lines = browser.execute_script(
            "return [...document.querySelectorAll('.option')].map(e => e.getClientRects().length)"
        )
        assert len(lines) == 18
        assert set(lines) == {1}
        scrollable = browser.execute_script(
            """return [...document.querySelectorAll('.wide')].filter(e => e.scrollWidth > e.clientWidth)
                .every(e => getComputedStyle(e).overflowX == 'auto')"""
        )
        assert scrollable


def test_a_report_prints_all_of_itself(browser, page):
    browser.get(page)
    printed = browser.print_page()
    assert len(printed) > 50_000  # base64 of a PDF that holds the figures
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        cut = browser.execute_script(
            "return [...document.images].some(i => i.getBoundingClientRect().right > window.innerWidth + 1)"
        )
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert not cut


@pytest.fixture
def made(examples, output, tmp_path):
    """Folder of a command's results on the finger; `identify` gets what `simulate` measured."""

    def folder(command):
        if command != "identify":
            return output(command, "finger", *(("--level", "presliding") if command == "table" else ())).folder
        scenario, force, played, data = (tmp_path / name for name in ("finger.toml", "f.csv", "played.csv", "data.csv"))
        scenario.write_text((examples / "finger.toml").read_text("utf-8"), encoding="utf-8")
        force.write_text("time_s,force_N\n0,30\n1,80\n2,15\n3,60\n4,20\n5,30\n", encoding="utf-8")
        assert run(["simulate", str(scenario), "--force", str(force), "--out", str(played)]) == 0
        columns = read_csv(played, ("time_s", "tension_1_N", "tension_7_N", "actuator_position_m", "load_position_m"))
        names = ("time_s", "input_tension_N", "output_tension_N", "input_position_m", "output_position_m")
        write_csv(data, dict(zip(names, columns.values(), strict=True)))
        out = tmp_path / "out"
        assert run([command, str(scenario), "--data", str(data), "--static", "--out", str(out)]) == 0
        return out

    return folder


@pytest.mark.compiler
@pytest.mark.parametrize("command", ["design", "compare", "experiment", "table", "identify"])
def test_the_report_of_every_command_opens_and_is_readable(browser, made, command):
    folder = made(command)
    with phone(browser):
        browser.get((folder / "report.html").as_uri())
        assert complaints(browser) == []
        inner, whole = browser.execute_script("return [window.innerWidth, document.documentElement.scrollWidth]")
        assert whole <= inner
        drawn = browser.execute_script("return [...document.images].map(i => i.complete && i.naturalWidth > 0)")
        assert drawn
        assert all(drawn)
        text = browser.execute_script("return document.body.innerText")
    assert f"tendonff {command} finger.toml" in text
    assert not re.search(r"\b(nan|None|inf)\b|<[a-z]+>|\{\{", text)
    assert str(folder.parent) not in text
    for link in browser.execute_script("return [...document.links].map(a => a.getAttribute('href'))"):
        assert link.startswith("#") or (folder / link).is_file()


def test_an_interactive_view_draws_from_disk_loads_nothing_and_stays_out_of_print(browser, tmp_path, examples):
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    time = np.linspace(0, 4, 4001)
    styles = Style(color="#0072B2", linestyle="-"), Style(color="#D55E00", linestyle="--")
    curves = {"inverse": (np.sin(time), styles[0]), "optimal": (np.cos(time), styles[1])}
    view = Interactive(html=interactive_view(time, {"force [N]": curves}), caption="Zoom.")
    provenance = Provenance(scenario=load_scenario(examples / "finger.toml"))
    report = Report(
        title="T", summary="S", sections=(Section(title="Look closer", blocks=(view,)),), provenance=provenance
    )
    write_report(tmp_path / "report.html", report)
    browser.get((tmp_path / "report.html").as_uri())
    drawn = "return window.Bokeh !== undefined && Bokeh.documents.length == 1 && document.querySelector('.bk-Column')"
    WebDriverWait(browser, 30).until(lambda b: b.execute_script(drawn))
    assert complaints(browser) == []
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith(("data:", "blob:"))] == []
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    shown = browser.execute_script("return getComputedStyle(document.getElementById('section-1')).display")
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert shown == "none"


@pytest.fixture(scope="module")
def explorer(examples):
    """Address of a running interactive page."""
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    import asyncio

    from tendonff.compensator.studies.explore.page import make_server, page_url
    from tendonff.compensator.studies.explore.run import Explorer

    ready, done = threading.Event(), threading.Event()
    found = {}

    def serve():
        asyncio.set_event_loop(asyncio.new_event_loop())
        server = make_server(Explorer(load_scenario(examples / "finger.toml")), 0)
        server.start()
        found["url"], found["stop"] = page_url(server), lambda: server.io_loop.add_callback(server.io_loop.stop)
        found["addresses"] = {s.getsockname()[0] for s in server._http._sockets.values()}
        server.io_loop.call_later(0, ready.set)
        server.io_loop.start()
        server.stop()
        server.io_loop.close()
        done.set()

    threading.Thread(target=serve, daemon=True).start()
    assert ready.wait(60)
    yield found
    found["stop"]()
    assert done.wait(30)


def scores(browser):
    """Errors that the page shows, as text."""
    return browser.execute_script(
        "return [...Bokeh.documents[0]._all_models.values()].filter(m => m.type == 'Div').map(m => m.text).join(' ')"
    )


def move(browser, title, value):
    browser.execute_script(
        """for (const m of Bokeh.documents[0]._all_models.values())
            if (m.type == 'Slider' && m.title.startsWith(arguments[0])) m.value = arguments[1]""",
        title,
        value,
    )


def tick(browser, label, *, on):
    browser.execute_script(
        """for (const m of Bokeh.documents[0]._all_models.values())
            if (m.type == 'Checkbox' && m.label.startsWith(arguments[0])) m.active = arguments[1]""",
        label,
        on,
    )


def ranges(browser):
    """Ends of all axes."""
    return browser.execute_script(
        "return [...Bokeh.documents[0]._all_models.values()]"
        ".filter(m => m.type == 'Range1d').map(m => [m.start, m.end])"
    )


def opacities(browser):
    """Of the compensators' curves."""
    found = browser.execute_script(
        "return [...Bokeh.documents[0]._all_models.values()].filter(m => m.type == 'Figure')"
        ".flatMap(m => m.renderers.slice(0, 3)).map(r => r.glyph.line_alpha.value)"
    )
    return set(found)


def test_the_interactive_page_fits_a_phone(browser, explorer):
    with phone(browser):
        browser.get(explorer["url"])
        WebDriverWait(browser, 30).until(
            lambda b: b.execute_script("return window.Bokeh && Bokeh.documents.length > 0")
        )
        assert browser.execute_script("return document.documentElement.clientWidth") == PHONE_WIDTH
        assert browser.execute_script("return document.documentElement.scrollWidth") <= PHONE_WIDTH + 1


@pytest.mark.compiler
def test_the_interactive_page_follows_its_sliders(browser, explorer):
    assert explorer["addresses"] == {"127.0.0.1"}
    browser.get(explorer["url"])
    wait = WebDriverWait(browser, 30)
    wait.until(
        lambda b: b.execute_script("return window.Bokeh && Bokeh.documents.length > 0 && Bokeh.index.roots.length")
    )
    before = scores(browser)
    assert "exact inverse" in before
    scales = ranges(browser)
    move(browser, "friction", 0.3)
    wait.until(lambda b: scores(b) != before)
    assert "Infeasible" not in scores(browser)
    assert ranges(browser) == scales  # they stay, so that changes are seen
    tick(browser, "Show", on=True)
    wait.until(lambda b: "self-tuning" in scores(b) and "optimal" in scores(b))
    assert opacities(browser) == {1.0}
    tick(browser, "Show", on=False)
    tick(browser, "Redesign", on=True)
    move(browser, "wrap angle", 360.0)
    move(browser, "friction", 0.5)
    wait.until(lambda b: "Infeasible" in scores(b))  # in words, not as a dead page
    assert max(opacities(browser)) < 0.5  # and what was computed before is pale
    move(browser, "wrap angle", 180.0)
    move(browser, "friction", 0.2)
    tick(browser, "Redesign", on=False)
    wait.until(lambda b: scores(b) == before)
    drawn = browser.execute_script(
        "return [...Bokeh.documents[0]._all_models.values()].filter(m => m.type == 'ColumnDataSource')"
        ".map(m => m.data[Object.keys(m.data)[0]].length)"
    )
    assert sorted(drawn)[5] > 1000  # all but the four that were not asked for, and the text to be saved
    assert complaints(browser) == []
