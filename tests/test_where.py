"""The page "Where is what": every file, name and equation that it states is there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "where.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and ".py`" in line
]
LAYERS = ("models", "ocp", "compensator")


def defined(file: Path) -> set[str]:
    """Names of functions, classes and values at the top level of a module."""
    found = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
    return found


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_file_names_and_equations_are_there(row: list[str]) -> None:
    _, place, names, theory = row
    (shown, target) = re.findall(r"\[`([^`]+)`\]\(([^)]+)\)", place)[0]
    file = ROOT / shown
    assert (PAGE.parent / target).resolve() == file.resolve()
    assert re.findall(r"`(\w+)`", names)
    assert set(re.findall(r"`(\w+)`", names)) <= defined(file)
    for numbers, page in re.findall(r"\[([^]]+)\]\(([^)]+)\)", theory):
        text = (PAGE.parent / page).read_text(encoding="utf-8")
        assert [n for n in numbers.split(", ") if rf"\tag{{{n}}}" not in text] == []


def test_every_layer_and_every_page_of_theory_with_equations_is_named() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert {row[1].strip("[`").split("/")[0] for row in ROWS} == set(LAYERS)
    pages = [page for page in (PAGE.parent / "theory").glob("*.md") if r"\tag{" in page.read_text(encoding="utf-8")]
    assert [page.name for page in pages if f"(theory/{page.name})" not in text] == []


def test_contributing_and_the_readme_lead_there() -> None:
    for name in ("CONTRIBUTING.md", "README.md"):
        assert "(docs/where.md)" in (ROOT / name).read_text(encoding="utf-8")
