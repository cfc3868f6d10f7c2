"""`import tendonff as tf`: the public names, lazily, the same for the interpreter and for type checkers."""

import ast
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.score import verify

ROOT = Path(__file__).resolve().parents[1]
FACE = ast.parse((ROOT / "tendonff" / "__init__.py").read_text(encoding="utf-8"))
HEAVY = {"casadi", "scipy", "pandas", "matplotlib", "control", "numpy"}


def imported(tree: ast.AST) -> list[tuple[str, str, str]]:
    """Module, name there and name here of every `from ... import ...`."""
    found = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return [(node.module or "", name.name, name.asname or name.name) for node in found for name in node.names]


@pytest.mark.parametrize("name", tf.__all__)
def test_every_public_name_exists_and_is_listed(name: str) -> None:
    assert getattr(tf, name) is not None
    assert name in dir(tf)


def test_type_checkers_are_told_the_same_names_from_the_same_places() -> None:
    [block] = [node for node in FACE.body if isinstance(node, ast.If) and "_HOMES" not in ast.dump(node)][:1]
    homes = {public: (module, defined) for module, defined, public in imported(block)}
    assert homes == tf._HOME_OF
    assert sorted([*homes, "__version__"]) == sorted(tf.__all__)


def test_the_import_alone_loads_nothing_heavy() -> None:
    code = "import sys, json, tendonff; print(json.dumps(list(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = set(json.loads(done.stdout))
    assert not HEAVY & modules
    assert not [name for name in modules if name.startswith(("tendonff.models", "tendonff.ocp", "tendonff.comp"))]


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'desing'; public names: .*design"):
        tf.desing  # type: ignore[attr-defined]  # noqa: B018


def test_what_is_no_choice_or_no_number_is_refused_by_the_base_class_of_all_errors() -> None:
    """Before anything is computed."""
    scenario = tf.load_scenario(ROOT / "examples" / "finger.toml")
    refused = {
        'Precision must be one of "double", "float", got "half"': lambda: tf.export_c(scenario, precision="half"),
        'Level must be one of .*, got "elastik"': lambda: tf.opti(scenario, level="elastik"),
        "mass_kg must be a number, got '3'": lambda: replace(scenario.transmission.load, mass_kg="3"),
    }
    for message, call in refused.items():
        with pytest.raises(tf.TendonffError, match=message):
            call()


def test_the_version_is_stated_once() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not re.search(r"^version *=", project, re.MULTILINE)
    stated = [
        path.relative_to(ROOT).as_posix()
        for top in ("tendonff", "models", "ocp", "compensator")
        for path in (ROOT / top).rglob("*.py")
        if re.search(rf"[\"']{re.escape(tf.__version__)}[\"']", path.read_text(encoding="utf-8"))
    ]
    assert set(stated) == {"tendonff/_version.py"}
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: {re.escape(tf.__version__)}$", citation, re.MULTILINE)


def python_of_readers() -> list[object]:
    """The README's Python, and that of each notebook."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    found: list[object] = [
        pytest.param(code, id=f"README-{k}")
        for k, code in enumerate(re.findall(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL), start=1)
    ]
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        lines = [line for cell in cells if cell["cell_type"] == "code" for line in "".join(cell["source"]).split("\n")]
        found.append(pytest.param("\n".join(line for line in lines if not line.startswith("%")), id=path.name))
    return found


@pytest.mark.parametrize("code", python_of_readers())
def test_readers_are_shown_the_public_names_only(code: str) -> None:
    tree = ast.parse(code)
    modules = [name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names]
    assert [name for name in modules if name.startswith("tendonff")] == ["tendonff"]
    assert not [module for module, _, _ in imported(tree) if module.startswith("tendonff")]
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "tf"
    }
    assert used <= set(tf.__all__)


def test_the_first_paragraph_of_the_readme_holds_for_every_example_of_a_tension() -> None:
    found = []
    for path in (ROOT / "examples").glob("*.toml"):
        scenario = tf.load_scenario(path)
        if not isinstance(scenario, tf.Scenario):
            continue
        problem = Problem.of(scenario)
        direct = Profile(force_N=problem.reference.tension_N)
        plant = Plant(problem.transmission, problem.level)
        found.append(verify(plant, "none", direct, problem.reference).score.rmse_percent_of_range)
    for page in ("README.md", "docs/index.md"):
        [stated] = re.findall(r"(\d+) to (\d+) % of", (ROOT / page).read_text(encoding="utf-8"))
        assert tuple(map(int, stated)) == (round(min(found)), round(max(found)))
