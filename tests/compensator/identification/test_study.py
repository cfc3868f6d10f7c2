"""A stage that fails is one law less, said in one line, never the end."""

from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.identification.identify import Request
from tendonff.compensator.identification.study import Study, attempted
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.errors import SolveError


@pytest.fixture(scope="module")
def study(examples: Path) -> Study:
    scenario = load_scenario(examples / "finger.toml")
    asked = Request(
        scenario=scenario, how=scenario.measurement, files=(), judging=(), static_only=False, say=print, confirm=bool
    )
    return Study(asked=asked, scenario=scenario, raw=(), records=(), judges=())


@pytest.mark.parametrize(
    "error", [SolveError("it ran away"), ParameterError("mu < 0"), np.linalg.LinAlgError("singular")]
)
def test_a_stage_that_fails_is_left_out_with_its_reason(study: Study, error: Exception) -> None:
    def law_of_something(_: Study) -> Study:
        raise error

    after = attempted(law_of_something, study.noted("before"))
    assert after.warnings == ("before", f"law of something: no answer ({error}); the other laws are not affected")
    assert after.chain is None


def test_a_mistake_in_a_stage_is_no_failure_of_a_law(study: Study) -> None:
    def mistaken(_: Study) -> Study:
        raise KeyError("name")

    with pytest.raises(KeyError):
        attempted(mistaken, study)
