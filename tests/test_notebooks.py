"""Notebooks are stored with their outputs: those of a fresh run, with words for their pictures."""

import contextlib
import io
import re
import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import nbformat
import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
LONG = {"6_the_second_day", "7_a_problem_of_your_own"}  # tests of `adapt` and of `examples/opti` make theirs too
STORE = runpy.run_path(str(ROOT / "notebooks" / "store.py"))
NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?")


def words(text: str) -> list[str]:
    """The text without its numbers, which may need more or fewer blanks."""
    return NUMBER.sub("", text).split()


def numbers(text: str) -> list[float]:
    return [float(found.replace(",", "")) for found in NUMBER.findall(text) if found.count(".") < 2]


def agree(cell: nbformat.NotebookNode, text: str, pictures: int) -> None:
    """Words alike, numbers to 2 % (other processors round otherwise); only words where numbers vary by nature."""
    assert words(text) == words(STORE["texts"](cell)), cell.source
    if STORE["VARIES"] not in cell.metadata.get("tags", ()):
        assert numbers(text) == pytest.approx(numbers(STORE["texts"](cell)), rel=0.02), cell.source
    assert pictures == len(STORE["pictures"](cell)), cell.source


@pytest.mark.compiler
@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore::DeprecationWarning", "ignore::UserWarning")
@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.nightly) if path.stem in LONG else path for path in NOTEBOOKS],
    ids=lambda path: path.stem,
)
def test_the_cells_print_what_is_stored_and_make_as_many_pictures(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run here one after the other, as Jupyter does, with nothing painted."""
    monkeypatch.chdir(path.parent)
    shown: list[int] = []

    def show() -> None:
        shown.extend(plt.get_fignums())
        plt.close("all")

    monkeypatch.setattr(plt, "show", show)
    names: dict[str, object] = {"__name__": "__main__"}
    plt.close("all")  # what another test left open is no picture of this notebook
    with mpl.rc_context():
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "code":
                said = io.StringIO()
                with contextlib.redirect_stdout(said):
                    exec(compile(cell.source.replace("%matplotlib inline\n", ""), path.stem, "exec"), names)  # noqa: S102
                show()
                agree(cell, said.getvalue(), len(shown))
                shown.clear()


@pytest.mark.nightly
@pytest.mark.compiler
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_in_jupyter_a_fresh_run_prints_and_draws_what_is_stored(path: Path) -> None:
    stored = nbformat.read(path, as_version=4)
    for old, new in zip(stored.cells, STORE["executed"](path).cells, strict=True):
        if old.cell_type == "code":
            agree(old, STORE["texts"](new), len(STORE["pictures"](new)))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_was_run_in_order_and_every_picture_is_described(path: Path) -> None:
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    shown = [
        (output.metadata["image/png"]["alt"], STORE["alt_text"](cell))
        for cell in cells
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert shown
    assert all(stored == said and len(said.split()) > 5 for stored, said in shown)
    assert not [output for cell in cells for output in cell.outputs if output.output_type == "error"]
    printed = "".join(STORE["texts"](cell) for cell in cells)
    assert not re.search(r"(?<![\w.])/\w+/", printed), "a path of this machine"


def test_titles_are_numbered_like_the_files() -> None:
    titles = [nbformat.read(path, as_version=4).cells[0].source.splitlines()[0] for path in NOTEBOOKS]
    assert [re.match(r"# (\d+)\. \S", title)[1] for title in titles] == [path.name.split("_")[0] for path in NOTEBOOKS]
    assert [int(path.name.split("_")[0]) for path in NOTEBOOKS] == list(range(1, len(NOTEBOOKS) + 1))
