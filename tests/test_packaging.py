"""What is in the tree is what gets installed."""

import tomllib
from importlib.resources import files
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
TOP = ("models", "ocp", "compensator")


def test_every_folder_with_python_files_is_a_package() -> None:
    for top in TOP:
        for path in (ROOT / top).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} needs an __init__.py to be installed"


def test_every_data_file_has_a_suffix_that_is_packaged() -> None:
    patterns = SETUPTOOLS["package-data"]["*"]
    ignored = {".py", ".pyc", ".pyi"}
    for top in TOP:
        for path in (ROOT / top).rglob("*"):
            if path.is_file() and path.suffix not in ignored:
                name = PurePosixPath(path.relative_to(ROOT).as_posix())
                assert any(name.match(pattern.replace("**/", "")) for pattern in patterns), f"{name} is not packaged"


@pytest.mark.parametrize("top", TOP)
def test_what_is_installed_is_what_is_in_the_tree(top: str) -> None:
    installed = Path(str(files(f"tendonff.{top}")))
    for path in (ROOT / top).rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
            twin = installed / path.relative_to(ROOT / top)
            assert twin.is_file(), f"{twin} is missing; install again with: pip install ."
            assert twin.read_bytes() == path.read_bytes(), f"{twin} is out of date; install again with: pip install ."
