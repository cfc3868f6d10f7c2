"""Exported code of drives: dry friction of their own, position servos, cycles."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.inverse import invert

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


def actuated(scenario, **values):
    rig = scenario.transmission
    return replace(scenario, transmission=replace(rig, actuator=replace(rig.actuator, **values)))


def exported(scenario, module, inputs, precision=Precision.DOUBLE, **options):
    """Answers of one module of an export."""
    files = export_project(scenario, precision=precision, profile_N=np.full(3, 30.0), **options).files
    sources = {name: text for name, text in files.items() if name.startswith("tff_")}
    return run_on_host(sources, "tff", precision, [{module: inputs}])[0][module]


@pytest.mark.parametrize("level", Level)
def test_the_exported_inverse_of_a_rubbing_drive_is_that_of_python(finger, level):
    scenario = actuated(replace(finger, run=replace(finger.run, level=level)), coulomb_N=4.0)
    problem = Problem.of(scenario)
    wanted, step = problem.reference.tension_N, problem.reference.step_s
    expected = invert(problem.chain, wanted, step).force_N
    assert exported(scenario, "inverse", wanted) == pytest.approx(expected, abs=1e-9)
    smooth = invert(Chain.of(finger.transmission, level), wanted, step).force_N
    assert np.abs(expected - smooth).max() > 3.9
    if level is Level.PRESLIDING:  # stiff bristles cost single precision 0.02 N, with and without a drive that rubs
        single = exported(scenario, "inverse", wanted, Precision.FLOAT)
        assert single == pytest.approx(expected, abs=1e-3)


def test_without_dry_friction_the_text_names_none(finger):
    files = export_project(finger, profile_N=np.full(3, 30.0)).files
    assert not any("coulomb" in text or "f_d" in text for name, text in files.items() if name != "design.json")
    rubbing = export_project(actuated(finger, coulomb_N=4.0), profile_N=np.full(3, 30.0)).files
    assert "f_d" in rubbing["tff_inverse.c"]
