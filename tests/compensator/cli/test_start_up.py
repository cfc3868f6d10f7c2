"""What is loaded before a command knows that it has work to do."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = {"casadi", "scipy", "pandas", "matplotlib", "control"}
COMMANDS = (
    ("simulate", "--force", "f.csv", "--out", "o.csv"),
    ("design", "--out", "o"),
    ("experiment", "--out", "o"),
    ("compare", "--out", "o"),
    ("explore", "--no-browser"),
    ("identify", "--data", "d.csv", "--out", "o"),
    ("table", "--out", "o"),
    ("export-c", "--out", "o"),
    ("export-fmu", "--out", "o"),
)


def start(folder: Path, *arguments: str) -> tuple[int, str, set[str]]:
    """Exit code, message, and the modules that were loaded."""
    code = (
        "import json, sys; from tendonff.compensator.cli import run; status = run(sys.argv[1:]); "
        "print(); print(json.dumps([status, list(sys.modules)]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False, cwd=folder
    )
    status, modules = json.loads(done.stdout.splitlines()[-1])
    return status, done.stderr, {name.partition(".")[0] for name in modules}


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("design", "--help")])
def test_help_and_version_load_no_heavy_package(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    status, _, modules = start(tmp_path, *arguments)
    assert status == 0
    assert not (HEAVY | {"numpy", "rich"}) & modules


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_a_scenario_is_refused_before_heavy_packages_are_loaded(
    tmp_path: Path, examples: Path, command: tuple[str, ...]
) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    (tmp_path / "bad.toml").write_text(text.replace("mu_dynamic =", "mu_dynamc ="), encoding="utf-8")
    name, *options = command
    status, message, modules = start(tmp_path, name, "bad.toml", *options)
    assert status == 2
    assert 'unknown key "mu_dynamc", did you mean "mu_dynamic"?' in message
    assert not HEAVY & modules


@pytest.mark.parametrize("command", [c for c in COMMANDS if "o" in c], ids=lambda command: command[0])
def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, examples: Path, command: tuple[str, ...]
) -> None:
    (tmp_path / "o").write_text("a file", encoding="utf-8")
    name, *options = command
    status, message, modules = start(tmp_path, name, str(examples / "finger.toml"), *options)
    assert status == 2
    assert "is a file; name a folder to write" in message
    assert not HEAVY & modules


@pytest.mark.parametrize("command", ["design", "compare", "table", "export-c", "export-fmu"])
@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("amplitudes_N", "[25.0, 8.0]", "a tendon cannot push"),
        ("step_s", "0.5", "frequencies_Hz must be < 1"),
    ],
)
def test_an_infeasible_reference_is_refused_before_heavy_packages_are_loaded(
    tmp_path: Path, examples: Path, command: str, key: str, value: str, message: str
) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    changed = "\n".join(f"{key} = {value}" if line.startswith(f"{key} ") else line for line in text.splitlines())
    (tmp_path / "bad.toml").write_text(changed, encoding="utf-8")
    status, told, modules = start(tmp_path, command, "bad.toml", "--out", "o")
    assert status == 2
    assert message in told
    assert not HEAVY & modules
    assert not (tmp_path / "o").exists()


FOLLOWS = ("design", "compare", "adapt", "sweep", "table", "export-c", "export-fmu", "explore")


@pytest.mark.parametrize(("command", "kind"), [*((command, "sine") for command in FOLLOWS), ("design", "csv")])
def test_doubts_are_said_before_heavy_packages_are_loaded(
    tmp_path: Path, examples: Path, command: str, kind: str
) -> None:
    """What a command computes with fails to load, so that all it says was said before."""
    text = (examples / "finger.toml").read_text(encoding="utf-8").replace("force_max_N = 200.0", "force_max_N = 60.0")
    text = text.replace("mass_kg = 0.02\n", "mass_kg = 20.0\n")
    if kind == "csv":
        start_, end = text.index("[reference]"), text.index("[run]")
        text = f'{text[:start_]}[reference]\nkind = "csv"\nfile = "r.csv"\n\n{text[end:]}'
        (tmp_path / "r.csv").write_text("time_s,tension_N\n0,30\n1,47\n2,30\n", encoding="utf-8")
    (tmp_path / "odd.toml").write_text(text, encoding="utf-8")
    code = (
        "import sys; from tendonff.compensator.cli import run; "
        f"sys.modules.update(dict.fromkeys({sorted(HEAVY)!r})); run(sys.argv[1:])"
    )
    options = ["--no-browser"] if command == "explore" else ["--out", "o"]
    done = subprocess.run(
        [sys.executable, "-c", code, command, "odd.toml", *options],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert "warning: [load] mass_kg = 20: grams? Then it is 0.02\n" in done.stderr
    assert "the peak of 47" in done.stderr
    assert "force_max_N = 60 delivers at most" in done.stderr
    assert "ModuleNotFoundError" in done.stderr


@pytest.mark.parametrize("module", ["design.run", "design.output", "compare.run", "compare.output", "explore.run"])
def test_what_computes_and_draws_loads_no_package_that_few_scenarios_need(module: str) -> None:
    """Each of them takes as long to import as a design takes to compute."""
    code = f"import sys, tendonff.compensator.{module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    rare = {"scipy.stats", "scipy.signal", "scipy.interpolate", "scipy.optimize", "pandas", "control"}
    assert not rare & set(done.stdout.split())
