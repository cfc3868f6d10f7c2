"""A compensator that fails takes nobody with it."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.closed_form import Inverse, Uncompensated
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.ocp.errors import SolveError


class Broken(Inverse):
    """Raises what it is made with."""

    name = "broken"

    def __init__(self, error):
        self.error = error

    def profile(self, problem, *, progress=None):
        raise self.error


@pytest.fixture(scope="module")
def finger(examples):
    scenario = load_scenario(examples / "finger.toml")
    return replace(scenario, run=replace(scenario.run, step_s=4e-3))


@pytest.fixture(scope="module")
def alone(finger):
    """The design without the compensator that fails."""
    return design(finger, compensators=(Uncompensated(), Inverse()))


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (SolveError("the chain went slack"), "failed: the chain went slack"),
        (ZeroDivisionError("float division by zero"), "failed: ZeroDivisionError: float division by zero"),
        pytest.param(
            np.linalg.LinAlgError("Singular matrix"),
            "failed: LinAlgError: Singular matrix",
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_what_a_compensator_raises_is_its_own_message_and_the_others_are_what_they_are_without_it(
    finger, alone, unpainted, tmp_path, error, reason
):
    result = design(finger, compensators=(Uncompensated(), Broken(error), Inverse()))
    assert result.failed == {"broken": reason}
    assert "broken" not in result.profiles
    assert not result.is_usable
    assert f"broken: {reason}" in result.warnings
    assert result.expectation.worst_percent == alone.expectation.worst_percent
    assert np.array_equal(result.forces_N["inverse"], alone.forces_N["inverse"])
    result.write(tmp_path)
    assert reason in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_where_every_compensator_fails_there_is_no_design(finger):
    with pytest.raises(SolveError, match=r"broken: failed: no way"):
        design(finger, compensators=(Broken(SolveError("no way")),))


def test_a_defect_of_a_compensator_is_not_taken_for_a_failure(finger):
    with pytest.raises(IndexError):
        design(finger, compensators=(Uncompensated(), Broken(IndexError("list index out of range"))))
