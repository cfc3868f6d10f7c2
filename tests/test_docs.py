"""The documentation builds without a warning, holds every public name, and its examples run."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tendonff as tf

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("mkdocstrings", reason="mkdocstrings is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "DISABLE_MKDOCS_2_WARNING": "true"}
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def public_definitions(package):
    """Full names of the classes and functions of a package and of all packages in it, those of `__init__` included."""
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if "cli" in parts or path.stem == "__main__":  # described under commands
            continue
        module = ".".join(("tendonff", *parts)).removesuffix(".__init__")
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                yield f"{module}.{node.name}"


@pytest.mark.parametrize("package", ["models", "ocp", "compensator"])
def test_every_public_class_and_function_is_documented(site, package):
    page = (site / "api" / f"{package}.html").read_text(encoding="utf-8")
    wanted = list(public_definitions(package))
    assert any(name.count(".") >= 3 for name in wanted) or package == "models"  # sub-packages are looked into
    assert not [name for name in wanted if f'id="{name}"' not in page]


def test_every_public_name_is_on_the_page_of_public_names(site):
    page = (site / "api" / "index.html").read_text(encoding="utf-8")
    assert not [name for name in tf.__all__ if name[0] != "_" and f'id="tendonff.{name}"' not in page]


def test_the_pages_load_nothing_from_the_network(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(r'<(?:script|img|link)[^>]*?(?:src|href)="([^"]+)"', page.read_text(encoding="utf-8"))
        assert not [address for address in loaded if address.startswith(("http:", "https:", "//"))]


def examples_of(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


EXAMPLES = [
    pytest.param(code, id=f"{page.relative_to(ROOT)}-{k}")
    for page in PAGES
    for k, code in enumerate(examples_of(page), start=1)
]


@pytest.mark.parametrize("code", EXAMPLES)
def test_the_examples_of_the_documentation_run(code, tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_command_is_in_the_documentation():
    from tendonff.compensator.cli import app

    commands = {command.name or command.callback.__name__.replace("_", "-") for command in app.registered_commands}
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert not [name for name in commands if f"tendonff {name} " not in text]


def test_the_figure_of_the_readme_can_be_drawn_again(tmp_path):
    script, target = ROOT / "docs" / "readme_figure.py", tmp_path / "finger.png"
    subprocess.run([sys.executable, str(script), str(target)], check=True, timeout=300)
    assert target.read_bytes().startswith(b"\x89PNG")
    assert (ROOT / "docs" / "finger.png").is_file()
