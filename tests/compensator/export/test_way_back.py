"""Lost references, missed calls and starts in motion: no module jumps, and what was lost shortly costs little."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenarios import load_scenario

pytestmark = pytest.mark.compiler

FLAGS = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Werror")


@pytest.fixture(scope="module")
def folder(examples, tmp_path_factory):
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    folder = tmp_path_factory.mktemp("way_back")
    export_project(load_scenario(examples / "finger.toml"), profile_N=np.full(3, 30.0)).write(folder)
    return folder


def test_no_module_jumps_after_what_was_lost_and_what_was_lost_shortly_costs_little(folder, record_property):
    sources = [
        folder / f"tff_{n}.c" for n in ("inverse", "stream", "capstan", "table", "state", "limits", "parameters")
    ]
    program, main = folder / "way_back", Path(__file__).with_suffix("").with_name("way_back.c")
    subprocess.run(["cc", *FLAGS, "-I", folder, main, *sources, "-lm", "-o", program], check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    rows = [[float(word) for word in line.split()] for line in said.splitlines()]
    found = dict(zip(("inverse", "stream", "capstan", "table"), rows, strict=True))
    record_property("figure", f"lost for 350 samples, 50 calls missed, one in 20 lost, start in motion: {found}")
    for module, (lost, more_lost, missed, more_missed, scattered, jump, started, more_started) in found.items():
        assert jump < 1e-9
        assert max(more_lost, more_missed, more_started) < 5
        if module != "capstan":  # whose law jumps where the reference turns
            assert max(lost, missed, started) < 5
        assert scattered < 0.5


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_flags_that_remove_the_guards_are_refused(folder, flag):
    done = subprocess.run(
        ["cc", "-std=c99", flag, "-c", "tff_limits.c", "-o", "x.o"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "guards against NaN" in done.stderr
