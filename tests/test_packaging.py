"""What is in the tree is what gets installed."""

from importlib.resources import files
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TOP = ("models", "ocp", "compensator")


def test_every_folder_with_python_files_is_a_package() -> None:
    for top in TOP:
        for path in (ROOT / top).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} needs an __init__.py to be imported"


@pytest.mark.parametrize("top", TOP)
def test_the_tree_imports_under_its_public_name_without_an_installation(top: str) -> None:
    """Editors and type checkers follow the same way: a relative link, or in a Windows checkout without links a text."""
    link = ROOT / "tendonff" / top
    assert link.is_symlink()
    assert link.readlink() == Path("..") / top


@pytest.mark.parametrize("top", TOP)
def test_what_is_installed_is_what_is_in_the_tree(top: str) -> None:
    installed = Path(str(files(f"tendonff.{top}")))
    for path in (ROOT / top).rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
            twin = installed / path.relative_to(ROOT / top)
            assert twin.is_file(), f"{twin} is missing; install again with: pip install ."
            assert twin.read_bytes() == path.read_bytes(), f"{twin} is out of date; install again with: pip install ."
