"""What is in the tree is what gets installed, from a checkout with links or without."""

import ast
import graphlib
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OF_A_CHECKOUT = tuple(f"tendonff/examples/{name}/" for name in ("mujoco_finger", "own", "opti", "gallery"))
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


def imported(file: Path) -> set[Path]:
    """Files of the tree that a file imports anywhere: at its top, in a function, or for type checkers alone."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    places = {ROOT.joinpath(*name.split(".")[1:]) for name in names if name.startswith("tendonff.")}
    return {f for place in places for f in (place.with_suffix(".py"), place / "__init__.py") if f.is_file()} - {file}


def test_no_module_imports_itself_in_a_circle_not_even_within_functions() -> None:
    code = [file for top in ("models", "ocp", "compensator") for file in (ROOT / top).rglob("*.py")]
    graph = {file: imported(file) for file in code}
    assert sum(map(len, graph.values())) > 2 * len(graph)  # or the test would look at nothing
    graphlib.TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("top", LINKED)
def test_the_tree_imports_under_its_public_name_without_an_installation(top: str) -> None:
    """Editors and type checkers follow relative links."""
    link = ROOT / "tendonff" / top
    assert link.is_symlink()
    assert link.readlink() == Path("..") / top


def build(target: str, folder: Path) -> set[str]:
    """Names in a wheel of the tree as git writes it where there are no links: each is a text file."""
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    shutil.copytree(ROOT / "tendonff", folder / "tendonff", symlinks=True)
    for top in LINKED:
        shutil.copytree(ROOT / top, folder / top)
        (folder / "tendonff" / top).unlink()
        (folder / "tendonff" / top).write_text(f"../{top}", encoding="utf-8")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", target], cwd=folder, check=True)
    [wheel] = (folder / "dist").glob("*.whl")
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def test_a_wheel_built_without_links_holds_the_whole_tree(tmp_path: Path) -> None:
    """As on Windows without developer mode; the finger of MuJoCo is to be run from a checkout."""
    assert build("wheel", tmp_path) == {name for name in tree() if not name.startswith(OF_A_CHECKOUT)}


def test_an_editable_installation_copies_nothing(tmp_path: Path) -> None:
    """A copy would go stale, and type checkers would read it instead of the tree."""
    assert build("wheel:editable", tmp_path) == {"_tendonff.pth"}


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_readme_of_a_wheel_leads_to_the_repository_and_every_file_it_names_is_there() -> None:
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    text, source = (ROOT / "README.md").read_text(encoding="utf-8"), "https://repository.invalid/tendonff"
    made = runpy.run_path(str(ROOT / "hatch_build.py"))["absolute"](text, source)
    assert f"]({source}/raw/main/docs/finger.png)" in made
    targets = re.findall(r"\]\(([^)]+)\)", made)
    assert all(target.startswith(("http", "#")) for target in targets)
    named = [t.removeprefix(f"{source}/").split("/", 2)[2] for t in targets if t.startswith(source)]
    assert [path for path in named if not (ROOT / path.split("#")[0]).exists()] == []


def test_the_readme_of_a_wheel_without_an_address_links_to_none() -> None:
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    made = runpy.run_path(str(ROOT / "hatch_build.py"))["unlinked"](text)
    assert all(target.startswith("http") for target in re.findall(r"\]\(([^)]+)\)", made))
    assert "a hand's joint" in made


def test_the_address_of_the_project_is_the_same_everywhere() -> None:
    """And none is stated that does not exist."""
    home = PROJECT.get("urls", {}).get("Homepage")
    for name in ("CITATION.cff", "conda/meta.yaml", "pyproject.toml", "README.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert "example.org" not in text
        stated = re.findall(r"^ *(?:url|repository-code|home|Homepage)\b.*", text, re.MULTILINE)
        assert bool(stated) == (home is not None and name != "README.md"), f"{name} must follow [project.urls]"
        assert all(home in line for line in stated)


def test_what_an_installer_shows_of_the_package_is_complete() -> None:
    for key in ("name", "description", "authors", "license", "keywords", "classifiers", "requires-python"):
        assert PROJECT[key], key


def test_the_paper_is_cited_alike() -> None:
    readme, citation = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "CITATION.cff"))
    [entry] = re.findall(r"@inproceedings\{.*?\n\}", readme, re.DOTALL)
    fields = dict(re.findall(r"(\w+) += \{(.*?)\},?\n", entry))
    assert f'title: "{fields["title"]}"' in citation
    assert f"year: {fields['year']}" in citation
    assert fields["booktitle"] in citation
    names = re.findall(r"family-names: (\w+)\n +given-names: (\w+)", citation)
    assert fields["author"] == " and ".join(f"{family}, {given}" for family, given in names)


def test_the_version_to_cite_is_that_of_the_package() -> None:
    stated = runpy.run_path(str(ROOT / "tendonff" / "_version.py"))["__version__"]
    assert f"\nversion: {stated}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_the_conda_recipe_requires_what_the_package_requires() -> None:
    recipe = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    run = recipe.split("  run:\n")[1].split("\n\n")[0]
    listed = {re.sub(r"^\s*- ", "", line).replace(" ", "").replace("-base", "") for line in run.splitlines()}
    assert listed == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}
