"""The exported plant's work in a call is bounded, and a step that is given up does no harm to the next."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.text import c_text
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.ocp.step import target


@pytest.mark.parametrize(("evaluations", "fails"), [(None, False), (30, True)])
def test_the_work_of_a_call_is_bounded(examples, tmp_path, monkeypatch, evaluations, fails, record_property):
    """With a bound so low that it binds, steps fail one by one and the plant goes on."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    bound = 60
    if evaluations is not None:
        usual, bound = target.plant_limits, evaluations

        def tight(precision):
            return replace(usual(precision), evaluations=evaluations)

        monkeypatch.setattr(target, "plant_limits", tight)
        monkeypatch.setattr(c_text, "plant_limits", tight)
    scenario = load_scenario(examples / "finger_stribeck.toml")
    export_project(scenario, profile_N=np.ones(3)).write(tmp_path)
    sources = [
        Path(__file__).with_name("plant_fuzz.c"),
        *(tmp_path / f"tff_{name}.c" for name in ("plant", "limits", "parameters")),
    ]
    program = tmp_path / "program"
    subprocess.run(["cc", "-std=c99", "-O2", "-I", tmp_path, *sources, "-lm", "-o", program], check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    most, failed, longest = map(int, said.split())
    record_property(
        "figure", f"plant, violent forces, at most {bound} evaluations: {most} solves, {failed} of 40000 fail"
    )
    assert most <= bound
    assert (failed > 0) == fails or failed <= 4
    assert longest <= 20
