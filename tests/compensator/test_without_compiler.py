"""Every command takes a joint where no C compiler works: the same results, slower, which is said."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ALONE = os.environ | {"CC": "no-compiler", "MPLBACKEND": "Agg"}
EXPLORE = """
import sys
import tendonff as tf
from tendonff.compensator import door
scenario = tf.load_scenario(sys.argv[1])
page = door.function_of("explore", scenario)(scenario)
found = page.explore({knob.key: knob.value for knob in page.knobs}, design_knows=True, curves=page.fast)
assert all(len(course.output) == len(found.time_s) for course in found.courses.values())
"""
WORKS = {
    "design": ("report.html", ()),
    "compare": ("matrix.csv", ()),
    "sweep": ("samples.csv", ("--samples", "2")),
    "table": ("table.csv", ()),
    "export-fmu": (".", ()),
    "adapt": ("estimate.csv", ()),
    "identify": ("fit.json", ("--data", "log.csv")),
    "watch": (".", ("--data", "log.csv")),
}
"""What each command writes, and its arguments."""


@pytest.fixture(scope="module")
def folder(examples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short reference of a loop, and a log of it."""
    folder = tmp_path_factory.mktemp("alone")
    text = (examples / "hand_joint.toml").read_text(encoding="utf-8").replace("step_s = 0.001", "step_s = 0.004")
    text = text.replace("times_s = [0.0, 0.6, 1.0, 1.5, 2.2, 3.0]", "times_s = [0.0, 0.3, 0.5]")
    text = text.replace("angles_rad = [0.0, 0.9, 0.9, 0.3, 1.1, 0.0]", "angles_rad = [0.0, 0.5, 0.2]")
    tuning = '\n[adaptation]\nsensor = "joint_angle"\nnoise = 4.4e-4\ndelay_samples = 2\n'
    (folder / "loop.toml").write_text(text + tuning, encoding="utf-8")
    (folder / "motor.csv").write_text("time_s,motor_rad\n0,0\n0.3,0.3\n0.7,-0.1\n1.0,0.2\n", encoding="utf-8")
    return folder


def tendonff(folder: Path, *arguments: str, environment: dict[str, str] = ALONE) -> str:
    """What a command says."""
    command = [sys.executable, "-m", "tendonff.compensator.cli", *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


def table(file: Path) -> np.ndarray:
    return np.genfromtxt(file, delimiter=",", skip_header=1)


@pytest.mark.compiler
def test_a_simulation_has_the_numbers_of_the_compiled_one_and_says_that_it_is_slow(folder: Path) -> None:
    asked = ("simulate", "loop.toml", "--force", "motor.csv")
    assert "Results are the same, several times slower" in tendonff(folder, *asked, "--out", "alone.csv")
    assert "slower" not in tendonff(folder, *asked, "--out", "compiled.csv", environment=dict(os.environ))
    assert table(folder / "alone.csv") == pytest.approx(table(folder / "compiled.csv"), abs=1e-6)


@pytest.mark.compiler
@pytest.mark.nightly
def test_exported_code_is_the_same_and_passes_its_own_test(folder: Path) -> None:
    """Sources to the byte; the self test without the calls at random that a compiler answers on export."""
    text = (folder / "loop.toml").read_text(encoding="utf-8").replace("step_s = 0.004", "step_s = 0.001")
    (folder / "fine.toml").write_text(text, encoding="utf-8")
    tendonff(folder, "export-c", "fine.toml", "--out", "alone")
    tendonff(folder, "export-c", "fine.toml", "--out", "compiled", environment=dict(os.environ))
    for name in ("tff_joint.c", "tff_joint.h", "tff_joint_adaptive.c"):
        assert (folder / "alone" / name).read_bytes() == (folder / "compiled" / name).read_bytes()
    subprocess.run(["make", "test"], cwd=folder / "alone", check=True, capture_output=True)


@pytest.mark.nightly
@pytest.mark.parametrize("work", WORKS)
def test_every_command_takes_a_joint(work: str, folder: Path) -> None:
    written, more = WORKS[work]
    if work in ("identify", "watch"):
        tendonff(folder, "simulate", "loop.toml", "--force", "motor.csv", "--out", "run.csv")
        text = (folder / "run.csv").read_text(encoding="utf-8")
        (folder / "log.csv").write_text(text.replace(",angle_rad", ",joint_rad"), encoding="utf-8")
    assert "several times slower" in tendonff(folder, work, "loop.toml", *more, "--out", work)
    assert (folder / work / written).exists()
    if work == "identify":
        numbers = json.loads((folder / work / written).read_text(encoding="utf-8"))
        assert numbers


@pytest.mark.nightly
def test_a_page_of_explore_answers(folder: Path) -> None:
    subprocess.run([sys.executable, "-c", EXPLORE, str(folder / "loop.toml")], env=ALONE, check=True)
