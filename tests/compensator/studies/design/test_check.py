"""A design checked by an integrator."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.closed_form import Inverse, Uncompensated
from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.scenario.reference import Shape, WaypointReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.ocp.integrate.method import Method


def test_a_design_is_checked_by_an_integrator(examples: Path) -> None:
    """The inverse undoes the fixed step, not the equations: what the integrator leaves is the step's error."""
    scenario = load_scenario(examples / "finger.toml")
    swing = WaypointReference(times_s=(0, 0.2, 0.4, 0.6), tensions_N=(20.0, 40.0, 25.0, 30.0), shape=Shape.SMOOTH)
    result = design(replace(scenario, reference=swing), compensators=(Uncompensated(), Inverse()))
    check = result.check(Method.IDAS)
    assert check.compensator == "exact inverse"
    assert 0 < check.rms_percent_of_range < 0.05
    assert check.error_percent_of_range == pytest.approx(check.rms_percent_of_range, rel=0.1)
    assert check.sentence.startswith("check by idas: exact inverse, RMS error 0.0")


def test_a_check_states_both_differences() -> None:
    reference, by_step, by_method = np.array([0.0, 4.0]), np.array([0.0, 4.0]), np.array([0.3, 4.4])
    check = MethodCheck.of(Method.CVODES, "inverse", "rad", reference, (by_step, by_method))
    assert check.peak == pytest.approx(0.4)
    assert check.rms_percent_of_range == pytest.approx(100 * np.sqrt(0.125) / 4)
    assert "differs from the fixed step by 0.35 rad RMS (8.8 % of range), 0.4 rad at most" in check.sentence
