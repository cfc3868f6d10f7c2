"""A restart in motion and a reference that was lost: the exported inverse goes on without a bump."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler


@pytest.mark.parametrize("coulomb_N", [0.0, 4.0])
@pytest.mark.parametrize("precision", Precision)
def test_a_restart_in_motion_and_a_lost_reference_make_no_bump(
    examples, tmp_path, precision, coulomb_N, record_property
):
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    scenario = load_scenario(examples / "finger.toml")
    rig = scenario.transmission
    rig = replace(rig, actuator=replace(rig.actuator, coulomb_N=coulomb_N))
    scenario = replace(scenario, transmission=rig)
    modules = [module for module in c_modules(scenario) if module.name in ("inverse", "plant")]
    for name, text in c_sources(scenario, Problem.of(scenario), modules, precision, "tff").items():
        (tmp_path / name).write_text(text)
    sources = [tmp_path / f"tff_{name}.c" for name in ("inverse", "limits", "parameters", "state", "chain", "plant")]
    program = tmp_path / "program"
    main = Path(__file__).with_name("re_entry.c")
    subprocess.run(["cc", "-std=c99", "-O0", "-I", tmp_path, main, *sources, "-lm", "-o", program], check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    plain, started, later, back, moved, end = map(float, said.split())
    record_property(
        "figure",
        f"{precision}, drive's friction {coulomb_N:g} N: restart in motion {plain:.2g} N, with init_at {started:.2g} N "
        f"and {later:.2g} N at most later; "
        f"after a lost reference that moved {moved:.2g} N, {back:.2g} N a sample at most",
    )
    assert plain > 5  # what a start from rest does
    assert started < 0.3
    assert later < 1.5  # led from the measured tension to the reference
    assert moved > 3
    assert back < 1.5 + 0.2 * coulomb_N  # a reversal on the way asks for about 1 N a sample, and the drive turns too
    assert end < 1e-4
