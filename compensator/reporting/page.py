"""The report: one self-contained HTML page for a result, which opens from disk, prints, and reads on a phone.

A command fills a `Report` and writes it beside its other files, inside the folder that appears whole or not at all.
Figures come from `plots.new_figure`; the page carries them inside, as vector graphics. Nothing on the page is loaded
from elsewhere, no script runs except that of a requested interactive view, and whatever a scenario or a file
name holds is shown as text. The page carries no date: equal results give equal pages.
"""

import base64
import hashlib
import math
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from tendonff._version import __version__
from tendonff.compensator.files.notices import Remark, by_urgency
from tendonff.compensator.files.reading import open_text
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.files.typeset import typeset
from tendonff.compensator.files.writing import write_json, write_text
from tendonff.compensator.reporting.drawing import caption_of, described_figure
from tendonff.compensator.reporting.plots import draw_figure, save_figure
from tendonff.compensator.scenario.document import Document

if TYPE_CHECKING:
    from markupsafe import Markup

Cell = str | float | int | bool | None  # what a table holds; None shows as a dash

_FIGURE = re.compile(r"[<−-]? ?\d.{0,20}$")
_OPTION = re.compile(r"(?<!\S)(--[a-z][a-z-]*|export-[a-z]+)")
_DECADES = 4  # that one number of decimals serves


def is_number(cell: Cell) -> bool:
    """Whether a cell holds a number; yes and no are none."""
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def is_aligned(column: Sequence[Cell]) -> bool:
    """Whether a column is set to the right: numbers, and short texts that begin with one, such as "4.6 ± 0.1"."""
    shown = [cell for cell in column if cell is not None and cell != ""]
    return bool(shown) and all(is_number(c) or (isinstance(c, str) and _FIGURE.match(c) is not None) for c in shown)


def column_decimals(cells: Sequence[Cell], digits: int = 3, least: float = 0.0) -> int | None:
    """Decimals that a column of numbers is shown with; None where its magnitudes span too much for one choice.

    The smallest number shows two digits, with three decimals at most; below `least` numbers need not differ.
    """
    sizes = [max(abs(c), least) for c in cells if isinstance(c, float) and math.isfinite(c) and c != 0]
    if not sizes or any(isinstance(c, str) for c in cells):
        return None
    low, high = (math.floor(math.log10(size)) for size in (min(sizes), max(sizes)))
    if high - low > _DECADES or low < -_DECADES:
        return None
    return max(0, digits - 1 - high, min(3, 1 - low))


def format_cell(cell: Cell, digits: int = 3, decimals: int | None = None) -> str:
    """Text of a table cell, with so many significant digits or the decimals of its column."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if not isinstance(cell, float):
        return typeset(str(cell))
    if decimals is not None and math.isfinite(cell):
        smallest = 10.0**-decimals
        if 0 < abs(cell) < smallest / 2:
            return f"< {smallest:.{decimals}f}"
        return f"{cell:.{decimals}f}".replace("-", "−")
    if cell == 0:
        return "0"
    if 1e-3 <= abs(cell) < 10.0 ** max(digits, 7):
        places = max(0, digits - 1 - math.floor(math.log10(abs(cell))))
        rounded = float(f"{cell:.{digits}g}") if abs(cell) >= 10.0 ** max(digits, 5) else cell
        return f"{rounded:.{places}f}".replace("-", "−")  # keeps trailing zeros, no exponent
    return typeset(f"{cell:.{digits}g}")


_PACKAGES = ("casadi", "numpy", "scipy", "matplotlib", "control", "pandas", "pydantic")


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    text: str  # plain text; no markup is understood


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows under named columns; the first column names the row."""

    caption: str  # what it shows, with the unit where all columns share one
    columns: Sequence[str]  # headers, with units
    # numbers are aligned to the right, those of one column with the same number of decimals; None is a dash
    rows: Sequence[Sequence[Cell]]
    digits: int = 3  # significant digits of a float
    least: float = 0.0  # smaller floats are shown as less than it, and set no decimals. Default 0: all differ
    one_quantity: bool = False  # all columns of numbers hold it, so all have the same decimals

    def __post_init__(self) -> None:
        for k, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(f"{self.caption}: row {k} has {len(row)} cells, the header {len(self.columns)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure."""

    figure: Figure  # from `plots.new_figure`
    caption: str  # what to see in it, in words; also read out to those who cannot see it


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureFile:
    """A figure that was written already; its content is taken into the page."""

    path: Path  # SVG or PNG file
    caption: str  # what to see in it, in words


@dataclass(frozen=True, slots=True, kw_only=True)
class Interactive:
    """Panels that can be zoomed; the only block with a script."""

    html: str  # from `interactive.interactive_view`
    caption: str


Block = Text | Table | Picture | PictureFile | Interactive


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Heading and its content."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileNote:
    """A file that lies beside the report."""

    name: str  # relative to the report
    content: str  # what it holds, in words


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Data needed to reproduce the result."""

    scenario: Document  # shown whole, with its hash
    command: str = ""  # command line, without the folders of this machine: "tendonff design finger.toml --out DIR"
    # further files that went in (force, measured data); named with the first digits of their SHA-256
    inputs: Sequence[Path] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Page for a result."""

    title: str
    summary: str  # the answer in one or two sentences: it stands on top
    sections: Sequence[Section]
    provenance: Provenance
    # what the reader must know before trusting the result, the most urgent first; remarks below the first figure
    warnings: Sequence[str] = ()
    files: Sequence[FileNote] = ()  # files beside the report
    fine_print: str = ""  # what qualifies the summary, in small print under it


def pictures_of(figures: Mapping[str, Figure], captions: Mapping[str, str]) -> dict[str, Picture]:
    """Figures with their captions, by name."""
    return {name: Picture(figure=figure, caption=captions[name]) for name, figure in figures.items()}


def provenance_of(scenario: Document, command: str, options: str = "") -> Provenance:
    """Provenance of a command that was given a scenario and a folder."""
    inputs = tuple(path for path in scenario.inputs if path != scenario.reference_file())
    written = f"tendonff {command} {as_argument(scenario.source)} --out DIR {options}".strip()
    return Provenance(scenario=scenario, command=written, inputs=inputs)


def write_report(path: Path, report: Report, files: Mapping[Figure, Path] = MappingProxyType({})) -> None:
    """Write the page, whole or not at all; figures that are in files already are taken from there."""
    write_text(path, render_report(report, files))


def render_report(report: Report, files: Mapping[Figure, Path] = MappingProxyType({})) -> str:
    """The page as HTML text; figures that are in files already are taken from there."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    # The name of the loader's package is the one this module was imported under.
    environment = Environment(
        loader=PackageLoader(__package__ or "tendonff.compensator.reporting", "templates"),
        autoescape=True,  # by file name it would leave .j2 alone
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["with_whole_options"] = _with_whole_options
    provenance, figures, scenario = report.provenance, count(1), report.provenance.scenario
    caption = "Complete scenario, including defaults" if scenario.is_complete else "Scenario file"
    reference = provenance.scenario.reference_file()
    inputs = [*([] if reference is None else [reference]), *provenance.inputs]
    drawing = Picture(figure=described_figure(scenario.system), caption=caption_of(scenario.system))
    described = Section(title="What the scenario describes", blocks=(drawing,))
    every = [*report.sections[:1], described, *report.sections[1:]]
    blocks = [block for section in report.sections for block in section.blocks]
    lead = next((block for block in blocks if isinstance(block, (Picture, PictureFile))), drawing)
    warnings = by_urgency(report.warnings)
    return environment.get_template("report.html.j2").render(
        report=report,
        warnings=[typeset(text) for text in warnings if not isinstance(text, Remark)],
        remarks=[typeset(text) for text in warnings if isinstance(text, Remark)],
        summary=typeset(report.summary),
        fine_print=typeset(report.fine_print),
        lead=_prepared(lead, figures, files),
        interactive=any(isinstance(block, Interactive) for block in blocks),
        sections=[
            {"title": section.title, "blocks": [_prepared(block, figures, files) for block in left]}
            for section in every
            if (left := [block for block in section.blocks if block is not lead])
        ],
        scenario_caption=caption,
        scenario_text=scenario.to_toml(),
        scenario_file=provenance.scenario.source.name,
        scenario_hash=provenance.scenario.digest(),
        inputs=[(path.name, file_hash(path)) for path in inputs],
        versions=versions(),
    )


def _with_whole_options(text: str) -> "Markup":
    """A text as HTML in which no line ends inside an option or a command, where a browser breaks after a hyphen."""
    from markupsafe import Markup, escape

    parts = _OPTION.split(text)  # options are every second one
    return Markup("").join(
        Markup('<span class="option">{}</span>').format(each) if k % 2 else escape(each) for k, each in enumerate(parts)
    )


def _prepared(block: Block, numbers: Iterator[int], files: Mapping[Figure, Path]) -> dict[str, object]:
    """Template data of a block; figures take the next number."""
    match block:
        case Text():
            return {"kind": "text", "text": typeset(block.text)}
        case Table():
            columns = [[row[k] for row in block.rows] for k in range(len(block.columns))]
            numeric = [is_aligned(column) for column in columns]
            decimals = [column_decimals(column, block.digits, block.least) for column in columns]
            if block.one_quantity:
                cells = [cell for column in columns for cell in column if not isinstance(cell, str)]
                decimals = [column_decimals(cells, block.digits, block.least)] * len(columns)
            rows = [
                [
                    (format_cell(cell, block.digits, places), right)
                    for cell, places, right in zip(row, decimals, numeric, strict=True)
                ]
                for row in block.rows
            ]
            return {
                "kind": "table",
                "caption": typeset(block.caption),
                "header": list(zip(block.columns, numeric, strict=True)),
                "rows": rows,
            }
        case Picture():
            written = files.get(block.figure)
            source = figure_uri(block.figure) if written is None else _file_uri(written)
            return {"kind": "picture", "caption": block.caption, "source": source, "number": next(numbers)}
        case Interactive():
            return {"kind": "interactive", "caption": block.caption, "html": block.html}
        case PictureFile():
            source = _file_uri(block.path)
            return {"kind": "picture", "caption": block.caption, "source": source, "number": next(numbers)}


def figure_uri(figure: Figure) -> str:
    """A figure as an address that carries its content."""
    return _uri(*draw_figure(figure))


def _file_uri(path: Path) -> str:
    return _uri(path.suffix.removeprefix("."), path.read_bytes())


def _uri(kind: str, content: bytes) -> str:
    media = {"svg": "image/svg+xml", "png": "image/png"}[kind]
    return f"data:{media};base64,{base64.b64encode(content).decode('ascii')}"


def file_hash(path: Path) -> str:
    """First sixteen hexadecimal digits of a file's SHA-256; of a folder (a bag) that of its files and their names."""
    if path.is_dir():
        whole = hashlib.sha256()
        for each in sorted(path.rglob("*")):
            if each.is_file():
                whole.update(f"{each.relative_to(path).as_posix()} {file_hash(each)}\n".encode())
        return whole.hexdigest()[:16]
    with open_text(path):  # one kind of message for a file that cannot be read
        pass
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Names and versions of what computed the result."""
    found = [("Python", platform.python_version()), ("tendonff", __version__)]
    for package in _PACKAGES:
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:  # run from a source folder that was not installed
            found.append((package, "not installed"))
    found.append(("system", f"{platform.system()} {platform.machine()}"))
    return tuple(found)


def summary_head(scenario: Document) -> dict[str, object]:
    """Common first keys of every `summary.json`."""
    return {
        "schema": 1,
        "scenario": scenario.name,
        "scenario_hash": scenario.digest(),
        "tool": f"tendonff {__version__}",
    }


def write_pages(
    folder: Path, summary: Mapping[str, object], figures: Mapping[str, Figure], report: Report, *, pdf: bool = False
) -> None:
    """Write `summary.json`, every figure, by file name without a suffix, and `report.html` into an existing folder."""
    write_json(folder / "summary.json", summary)
    files = {figure: save_figure(figure, folder / name, pdf=pdf)[0] for name, figure in figures.items()}
    write_report(folder / "report.html", report, files)
