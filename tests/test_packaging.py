"""What is in the tree is what gets installed, from a checkout with links or without."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LINKED = ("models", "ocp", "compensator", "examples")


def tree() -> set[str]:
    """Files that a wheel must hold, under their names in it."""
    own = {f"tendonff/{path.name}" for path in (ROOT / "tendonff").iterdir() if path.is_file()}
    linked = {
        f"tendonff/{path.relative_to(ROOT).as_posix()}"
        for top in LINKED
        for path in (ROOT / top).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    return own | linked


def test_every_folder_with_python_files_is_a_package() -> None:
    for top in ("models", "ocp", "compensator"):
        for path in (ROOT / top).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} needs an __init__.py to be imported"


@pytest.mark.parametrize("top", LINKED)
def test_the_tree_imports_under_its_public_name_without_an_installation(top: str) -> None:
    """Editors and type checkers follow relative links."""
    link = ROOT / "tendonff" / top
    assert link.is_symlink()
    assert link.readlink() == Path("..") / top


def test_a_wheel_built_without_links_holds_the_whole_tree(tmp_path: Path) -> None:
    """Git writes a link as a text file where the system has none, as on Windows without developer mode."""
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / "tendonff", tmp_path / "tendonff", symlinks=True)
    for top in LINKED:
        shutil.copytree(ROOT / top, tmp_path / top)
        (tmp_path / "tendonff" / top).unlink()
        (tmp_path / "tendonff" / top).write_text(f"../{top}", encoding="utf-8")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    [wheel] = (tmp_path / "dist").glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == tree()
