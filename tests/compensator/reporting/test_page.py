"""The report as text; tests/test_reports_in_browser.py looks at it in a browser."""

import base64
import html
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.axes import Axes

from tendonff.compensator.files.notices import Danger, Remark
from tendonff.compensator.reporting.page import (
    FileNote,
    Picture,
    Provenance,
    Report,
    Section,
    Table,
    Text,
    column_decimals,
    figure_uri,
    format_cell,
    render_report,
    write_pages,
    write_report,
)
from tendonff.compensator.reporting.plots import draw_figure, figure_style, legend_below, new_figure
from tendonff.compensator.scenario.scenario import scenario_hash, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario


@pytest.fixture
def report(examples):
    figure, axes = new_figure()
    axes[0, 0].plot([0, 1], [1, 2])
    table = Table(caption="Errors", columns=("design", "rms [N]"), rows=(("none", 3.14159), ("inverse", None)))
    return Report(
        title="A design",
        summary="It works.",
        sections=(
            Section(title="What arrives", blocks=(Text("Look."), Picture(figure=figure, caption="A line."), table)),
        ),
        provenance=Provenance(scenario=load_scenario(examples / "finger.toml"), command="tendonff design finger.toml"),
        files=(FileNote(name="profile.csv", content="the forces"),),
    )


class _Page(HTMLParser):
    """What a page loads, and whether its tags close."""

    def __init__(self):
        super().__init__()
        self.open, self.loaded, self.tags = [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.loaded += [value for name, value in attrs if name in ("src", "srcset", "data", "action")]
        self.loaded += [value for name, value in attrs if tag == "link" and name == "href"]
        if tag not in ("meta", "link", "img", "br", "wbr", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def page_of(report):
    page = _Page()
    page.feed(render_report(report))
    assert not page.open
    return page


def test_the_page_carries_everything_and_loads_nothing(report):
    page = page_of(report)
    assert page.loaded
    assert all(source.startswith("data:") for source in page.loaded)
    assert "script" not in page.tags
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", render_report(report))


def test_the_page_says_how_to_make_it_again(report):
    text = render_report(report)
    scenario = report.provenance.scenario
    assert scenario_hash(scenario) in text
    assert scenario_to_toml(scenario) in html.unescape(text)
    assert "tendonff design finger.toml" in text
    assert re.search(r"casadi</th><td>3\.\d", text)
    assert str(scenario.source.parent) not in text


def test_what_a_user_wrote_is_shown_and_never_run(report):
    bad = '<script>alert("x")</script> & <img src=x onerror=alert(1)>'
    hostile = replace(
        report,
        title=bad,
        summary=bad,
        warnings=(bad,),
        sections=(Section(title=bad, blocks=(Text(bad), Table(caption=bad, columns=(bad,), rows=((bad,),)))),),
        provenance=replace(
            report.provenance, command=bad, scenario=replace(report.provenance.scenario, name=bad.replace('"', "'"))
        ),
        files=(FileNote(name=bad, content=bad),),
    )
    page = page_of(hostile)
    assert "script" not in page.tags
    assert page.tags.count("img") == 1  # the drawing
    assert all(address.startswith("data:") for address in page.loaded)


def test_equal_results_give_equal_pages(report):
    assert render_report(report) == render_report(report)


def test_warnings_stand_before_the_results(report):
    text = render_report(replace(report, warnings=("the tendon goes slack",)))
    assert text.index("the tendon goes slack") < text.index("What arrives")
    assert "No warnings." in render_report(report)


def test_input_files_are_named_with_their_hash(report, tmp_path):
    data = tmp_path / "run1.csv"
    data.write_bytes(b"abc")
    text = render_report(replace(report, provenance=replace(report.provenance, inputs=(data,))))
    assert "run1.csv" in text
    assert "ba7816bf8f01cfea" in text  # SHA-256 of "abc", as printed in FIPS 180-2
    assert str(tmp_path) not in text


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (None, "–"),
        (float("nan"), "–"),
        (0.0, "0"),
        (3.14159, "3.14"),
        (2.0, "2.00"),
        (0.012345, "0.0123"),
        (12345.6, "12346"),
        (1e-9, "1·10⁻⁹"),
        (-0.5, "−0.500"),
        (7, "7"),
        (True, "yes"),
        ("none", "none"),
    ],
)
def test_numbers_are_shown_to_three_digits(cell, text):
    assert format_cell(cell) == text


@pytest.mark.parametrize(
    ("column", "shown"),
    [
        ([24.5, 2.7, 0.0492], ["24.500", "2.700", "0.049"]),
        ([24.5, 2.7, 1e-5], ["24.500", "2.700", "< 0.001"]),
        ([9.6, -5.58], ["9.60", "−5.58"]),
        ([0.13, 587400.0], ["0.130", "587000"]),  # quantities of their own
        ([120.0, None], ["120", "–"]),
        ([3.68e-6], ["3.68·10⁻⁶"]),
    ],
)
def test_numbers_of_one_column_have_the_same_number_of_decimals(column, shown):
    least = 1e-3 if column[0] == 24.5 else 0.0
    assert [format_cell(cell, 3, column_decimals(column, 3, least)) for cell in column] == shown


def test_figures_are_numbered_through_all_sections(report):
    again = [replace(section, blocks=[replace(block) for block in section.blocks]) for section in report.sections]
    twice = replace(report, sections=(*report.sections, *again))
    assert re.findall(r"<b>(Figure \d+)", render_report(twice)) == ["Figure 1", "Figure 2", "Figure 3"]


def test_a_long_name_may_break_after_its_underscores_and_is_still_escaped(report):
    table = Table(caption="t", columns=("value", "estimate"), rows=(("bristle_<b>_N", 1.0),))
    text = render_report(replace(report, sections=(Section(title="s", blocks=(table,)),)))
    assert "bristle_<wbr>&lt;b&gt;_<wbr>N</th>" in text


def test_columns_of_one_quantity_have_the_same_decimals(report):
    table = Table(caption="t", columns=("a", "b", "c"), rows=(("x", 35.1, 0.012), ("y", 3.0, None)), one_quantity=True)
    text = render_report(replace(report, sections=(Section(title="s", blocks=(table,)),)))
    for shown in ("35.100", "3.000", "0.012"):
        assert f">{shown}</td>" in text


def test_a_table_whose_rows_do_not_fit_is_refused():
    with pytest.raises(ValueError, match="row 1 has 1 cells, the header 2"):
        Table(caption="t", columns=("a", "b"), rows=((1, 2), (1,)))


def test_a_dense_figure_becomes_pixels():
    rng = np.random.default_rng(0)
    figure, axes = new_figure()
    axes[0, 0].plot([0, 1], [0, 1])
    assert figure_uri(figure).startswith("data:image/svg+xml;base64,")
    axes[0, 0].scatter(rng.normal(size=30_000), rng.normal(size=30_000), s=1)
    media, _, content = figure_uri(figure).partition(",")
    assert media == "data:image/png;base64"
    assert base64.b64decode(content).startswith(b"\x89PNG")


def test_a_report_appears_whole(report, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, report)
    assert path.read_text(encoding="utf-8").endswith("</html>\n")
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_figure_is_drawn_once_for_its_file_and_the_page(report, tmp_path, monkeypatch):
    """Also once laid out: nothing is drawn to find the places of its panels."""
    drawn = []
    draw = Axes.draw
    monkeypatch.setattr(Axes, "draw", lambda axes, renderer: drawn.append(axes) or draw(axes, renderer))
    (picture,) = (block for section in report.sections for block in section.blocks if isinstance(block, Picture))
    write_pages(tmp_path, {}, {"what": picture.figure}, report)
    assert len([axes for axes in drawn if axes in picture.figure.axes]) == len(picture.figure.axes)
    content = (tmp_path / "what.svg").read_bytes()
    assert base64.b64encode(content).decode("ascii") in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.iterdir()} == {"summary.json", "report.html", "what.svg"}


def test_for_a_printed_page_there_is_a_pdf_beside_each_figure(report, tmp_path):
    figure, axes = new_figure()
    axes[0, 0].plot([0, 1], [0, 1])
    write_pages(tmp_path, {}, {"line": figure}, report, pdf=True)
    assert (tmp_path / "line.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "line.svg").is_file()


def test_panels_stay_where_the_first_drawing_put_them():
    """Labels find room beside them, whatever was drawn before."""
    figure, axes = new_figure(2, 1)
    axes[1, 0].set(ylabel="a label that\ntakes two lines", ylim=(-123456, 1))
    before = axes[1, 0].get_position().x0
    first = draw_figure(figure)
    assert axes[1, 0].get_position().x0 > before
    assert draw_figure(figure) == first


@pytest.mark.parametrize("length", [10, 40, 70])
def test_a_legend_is_never_wider_than_its_figure(length):
    with figure_style():
        figure, axes = new_figure(height_in=5.0)
        for name in "abcdef":
            axes[0, 0].plot([0, 1], [0, 1], label=length * name)
        legend_below(figure, axes[0, 0], columns=4)
    draw_figure(figure)
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width
    assert box.y1 < axes[0, 0].get_window_extent().y0


def test_dangers_come_first_and_what_asks_for_no_action_stands_below_the_first_figure(report):
    notices = ("plain", Remark("the reference was raised"), Danger("drive too small"), "plain")
    text = render_report(replace(report, warnings=notices))
    places = [text.index(part) for part in ("drive too small", "plain", "<img", "the reference was raised")]
    assert places == sorted(places)
    assert text.count("plain</li>") == 1
    assert text.count("the reference was raised") == 1


def test_the_first_figure_is_the_report_s_own_and_the_drawing_follows(report):
    text = render_report(report)
    assert text.index("A line.") < text.index("What the scenario describes")
