"""What is loaded before a command knows that it has work to do."""

import json
import subprocess
import sys
from collections.abc import Set as AbstractSet
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


def start(
    folder: Path, *commands: tuple[str, ...], absent: AbstractSet[str] = frozenset()
) -> list[tuple[object, str, set[str]]]:
    """Of commands that follow each other in one fresh process: exit code, message, and what is loaded since its start.

    A heavy package that one of them loaded is still there after the next, so the first that has it is to blame. Where
    one looks for a package that is `absent`, the error stands for its exit code.
    """
    code = (
        "import contextlib, io, json, sys\n"
        "from tendonff.compensator.cli import run\n"
        "sys.modules.update(dict.fromkeys(json.loads(sys.argv[2])))\n"
        "for command in json.loads(sys.argv[1]):\n"
        "    said = io.StringIO()\n"
        "    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):\n"
        "        try:\n"
        "            status = run(command)\n"
        "        except ModuleNotFoundError as error:\n"
        "            status = type(error).__name__\n"
        "    print(json.dumps([status, said.getvalue(), list(sys.modules)]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(commands), json.dumps(sorted(absent))],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(commands)
    return [(status, said, {name.partition(".")[0] for name in modules}) for status, said, modules in found]


def test_help_and_version_load_no_heavy_package(tmp_path: Path) -> None:
    commands = ("--help",), ("--version",), ("design", "--help")
    for command, (status, _, modules) in zip(commands, start(tmp_path, *commands), strict=True):
        assert status == 0, command
        assert not (HEAVY | {"numpy", "rich"}) & modules, command


def test_a_scenario_is_refused_before_heavy_packages_are_loaded(tmp_path: Path, examples: Path) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    (tmp_path / "bad.toml").write_text(text.replace("mu_dynamic =", "mu_dynamc ="), encoding="utf-8")
    commands = [(name, "bad.toml", *options) for name, *options in COMMANDS]
    for command, (status, message, modules) in zip(commands, start(tmp_path, *commands), strict=True):
        assert status == 2, command
        assert 'unknown key "mu_dynamc", did you mean "mu_dynamic"?' in message, command
        assert not HEAVY & modules, command


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path, examples: Path) -> None:
    (tmp_path / "o").write_text("a file", encoding="utf-8")
    commands = [(name, str(examples / "finger.toml"), *options) for name, *options in COMMANDS if "o" in options]
    for command, (status, message, modules) in zip(commands, start(tmp_path, *commands), strict=True):
        assert status == 2, command
        assert "is a file; name a folder to write" in message, command
        assert not HEAVY & modules, command


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("amplitudes_N", "[25.0, 8.0]", "a tendon cannot push"),
        ("frequencies_Hz", "[700.0, 0.5]", "frequencies_Hz must be < 500"),
        ("step_s", "0.5", "[run] step_s = 0.5: milliseconds? Then it is 0.0005"),
    ],
)
def test_an_infeasible_reference_is_refused_before_heavy_packages_are_loaded(
    tmp_path: Path, examples: Path, key: str, value: str, message: str
) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    changed = "\n".join(f"{key} = {value}" if line.startswith(f"{key} ") else line for line in text.splitlines())
    (tmp_path / "bad.toml").write_text(changed, encoding="utf-8")
    names = ("design", "compare", "table", "export-c", "export-fmu")
    commands = [(name, "bad.toml", "--out", "o") for name in names]
    for command, (status, printed, modules) in zip(commands, start(tmp_path, *commands), strict=True):
        assert status == 2, command
        assert message in printed, command
        assert not HEAVY & modules, command
    assert not (tmp_path / "o").exists()


FOLLOWS = ("design", "compare", "adapt", "sweep", "table", "export-c", "export-fmu", "explore")
COMPUTES = {
    **{name: ("--no-browser",) if name == "explore" else ("--out", "o") for name in FOLLOWS},
    "experiment": ("--out", "o"),
    "simulate": ("--force", "f.csv", "--out", "o.csv"),
    "identify": ("--data", "d.csv", "--out", "o"),
}


@pytest.mark.parametrize(
    ("example", "old", "new", "asked"),
    [
        ("finger", "mass_kg = 0.02\n", "mass_kg = 20.0\n", "[load] mass_kg = 20: grams? Then it is 0.02"),
        ("hand_joint", "moment_arm_m = 0.008", "moment_arm_m = 8", "[tendons] moment_arm_m = 8: millimetres?"),
    ],
)
def test_every_command_that_computes_refuses_another_unit_before_it_computes(
    tmp_path: Path, examples: Path, example: str, old: str, new: str, asked: str
) -> None:
    text = (examples / f"{example}.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "odd.toml").write_text(text.replace(old, new), encoding="utf-8")
    names = dict(COMPUTES)
    if example == "hand_joint":
        del names["experiment"]
        names["watch"] = names["identify"]
    commands = [(name, "odd.toml", *options) for name, options in names.items()]
    for command, (status, said, modules) in zip(commands, start(tmp_path, *commands), strict=True):
        assert (status, asked in said) == (2, True), (command, said)
        assert not {"matplotlib", "control"} & modules, command
    assert not (tmp_path / "o").exists()


def test_warnings_are_said_before_heavy_packages_are_loaded(tmp_path: Path, examples: Path) -> None:
    """What a command computes with fails to load, so that all it says was said before."""
    text = (examples / "finger.toml").read_text(encoding="utf-8").replace("force_max_N = 200.0", "force_max_N = 60.0")
    start_, end = text.index("[reference]"), text.index("[run]")
    (tmp_path / "sine.toml").write_text(text, encoding="utf-8")
    measured = f'{text[:start_]}[reference]\nkind = "csv"\nfile = "r.csv"\n\n{text[end:]}'
    (tmp_path / "csv.toml").write_text(measured, encoding="utf-8")
    (tmp_path / "r.csv").write_text("time_s,tension_N\n0,30\n1,47\n2,30\n", encoding="utf-8")
    written = {name: ("--no-browser",) if name == "explore" else ("--out", "o") for name in FOLLOWS}
    commands = [(name, "sine.toml", *options) for name, options in written.items()]
    commands.append(("design", "csv.toml", *written["design"]))
    for command, (status, said, _) in zip(commands, start(tmp_path, *commands, absent=HEAVY), strict=True):
        assert status == "ModuleNotFoundError", command
        assert "the peak of 47" in said, command
        assert "force_max_N = 60 delivers at most" in said, command


def test_what_computes_and_draws_loads_no_package_that_few_scenarios_need() -> None:
    """Each of them takes as long to import as a design takes to compute."""
    modules = ("design.run", "design.output", "compare.run", "compare.output", "explore.run")
    code = "import importlib, sys\nfor name in sys.argv[1:]:\n    importlib.import_module(name); print(*sys.modules)"
    names = [f"tendonff.compensator.studies.{module}" for module in modules]
    done = subprocess.run([sys.executable, "-c", code, *names], capture_output=True, text=True, check=True)
    rare = {"scipy.stats", "scipy.signal", "scipy.interpolate", "scipy.optimize", "pandas", "control"}
    for module, loaded in zip(modules, done.stdout.splitlines(), strict=True):
        assert not rare & set(loaded.split()), module
