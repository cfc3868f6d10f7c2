"""The exported plant's work in a call is bounded, and a step that is given up does no harm to the next."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.golden import golden_vectors
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.modules import OBSERVER, PLANT
from tendonff.compensator.export.text import c_text
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.reference import SineReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step import target

pytestmark = pytest.mark.compiler


def test_golden_rows_end_before_a_step_that_the_plant_may_give_up(examples):
    """Sticking and slipping at low tension: some steps need more than the bound, and no two compilers agree on all."""
    finger = load_scenario(examples / "finger.toml")
    friction = replace(
        finger.transmission.friction,
        mu_dynamic=0.32,
        mu_static=0.32,
        bristle_stiffness_N_per_m=1e6,
        soft_bristle_stiffness_N_per_m=2e5,
        adhesion_N=3.0,
    )
    path = replace(finger.transmission.path, total_angle_rad=5.5, segments=10)
    waves = SineReference(
        initial_tension_N=6.2, amplitudes_N=(1.1, 0.45), frequencies_Hz=(0.23, 0.75), duration_s=1.0, fade_in_s=0.3
    )
    scenario = replace(
        finger,
        transmission=replace(finger.transmission, path=path, friction=friction),
        reference=waves,
        run=replace(finger.run, step_s=0.002, level=Level.ELASTIC),
    )
    problem = Problem.of(scenario)
    course = golden_vectors(problem, None, Precision.DOUBLE).course
    expected = course.columns["plant"]
    sources = c_sources(scenario, problem, (PLANT,), Precision.DOUBLE, "tff")
    (found,) = run_on_host(sources, "tff", Precision.DOUBLE, [{"plant": course.plant_force_N[: len(expected)]}])
    assert len(expected) > 200
    assert found["plant"] == pytest.approx(expected, abs=1e-9 * course.scale_N)


def figures(module: str, scenario: Scenario, folder: Path) -> list[int]:
    """What the module's violent drive prints."""
    for name, text in c_sources(scenario, Problem.of(scenario), (PLANT, OBSERVER), Precision.DOUBLE, "tff").items():
        (folder / name).write_text(text)
    sources = [
        Path(__file__).with_name(f"{module}_fuzz.c"),
        *(folder / f"tff_{name}.c" for name in (module, "chain", "state", "limits", "parameters")),
    ]
    program = folder / "program"
    subprocess.run(["cc", "-std=c99", "-O2", "-I", folder, *sources, "-lm", "-o", program], check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    return [int(word) for word in said.split()]


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
    most, failed, longest = figures("plant", scenario, tmp_path)
    record_property(
        "figure", f"plant, violent forces, at most {bound} evaluations: {most} of them, {failed} of 40000 fail"
    )
    assert most <= bound
    assert (failed > 0) == fails or failed <= 4
    assert longest <= 20


def test_an_observer_comes_back_after_a_step_without_a_solution(examples, tmp_path, record_property):
    """A state from which nothing converges, a tendon that slid while it went slack say, is left at once."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    failed, longest = figures("observer", load_scenario(examples / "finger_stribeck.toml"), tmp_path)
    record_property("figure", f"observer, violent tensions: {failed} of 10000 calls fail, at most {longest} in a row")
    assert 0 < failed <= 100
    assert longest <= 4
