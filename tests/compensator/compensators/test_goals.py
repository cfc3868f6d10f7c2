"""Other goals of the table [optimal]: what a scenario asks for reaches the profile, and is refused beside the rest."""

import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.profile import ProfileStatus
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.design.run import design
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml


@pytest.fixture(scope="module")
def text(examples):
    """A transition of the fast finger with coarse steps."""
    whole = (examples / "finger_fast.toml").read_text(encoding="utf-8")
    head, _ = whole.split("[reference]")
    return (
        f'{head}[reference]\nkind = "waypoints"\ntimes_s = [0.0, 0.3, 0.5]\ntensions_N = [30.0, 45.0, 45.0]\n'
        'shape = "smooth"\n[run]\nstep_s = 0.005\nlevel = "presliding"\n[optimal]\n'
    )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("tolerance_N = 3.0\n", "the output stays within 3 N of the reference"),
        ("least_time = true\n", "from 30 to 45 N in"),
        ("least_time = true\ntolerance_N = 1.0\n", "then within 1 N until the end"),
        ("preview_s = 0.1\n", "with 0.1 s of preview"),
    ],
)
def test_a_goal_of_the_scenario_is_what_the_optimal_profile_is_made_for(text, keys, said):
    scenario = parse_scenario(text + keys)
    assert parse_scenario(scenario_to_toml(scenario)).optimal == scenario.optimal
    profile = compensator("optimal").profile(Problem.of(scenario))
    assert said in profile.tracking.message
    assert profile.status is ProfileStatus.GOOD


def test_a_design_says_that_the_error_was_not_the_goal_and_does_not_advise_against_it(text):
    chosen = [compensator(name) for name in ("none", "inverse", "optimal")]
    warnings = design(parse_scenario(text + "least_time = true\n"), compensators=chosen).warnings
    assert any(w.startswith("optimal: made for least_time") for w in warnings)
    assert not any("use inverse here" in w for w in warnings)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("tolerance_N = 0\n", r"tolerance_N must be a finite number > 0, got 0.*leave it out"),
        ("preview_s = -1.0\n", r"preview_s must be a finite number > 0, got -1.*leave it out"),
        ("preview_s = 0.1\nleast_time = true\n", r"preview_s = 0\.1 does not go with least_time or tolerance_N"),
        ("least_time = 1\n", r"least_time must be true or false, got 1"),
        ("tolerance_N = 1.0\n[robust]\nmu = 0.1\n", r"\[optimal\] tolerance_N does not go with \[robust\]; leave one"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_message(text, keys, message):
    with pytest.raises(InputError, match=message):
        parse_scenario(text + keys)


def test_goals_are_refused_for_a_cycle(text):
    cycle = text.replace("[30.0, 45.0, 45.0]", "[30.0, 45.0, 30.0]\nperiodic = true")
    with pytest.raises(InputError, match=r"least_time does not go with \[reference\] periodic"):
        parse_scenario(cycle + "least_time = true\n")


def test_a_transition_to_the_same_tension_is_refused(text):
    still = parse_scenario(text.replace("[30.0, 45.0, 45.0]", "[30.0, 45.0, 30.0]") + "least_time = true\n")
    with pytest.raises(ValueError, match="the reference begins and ends at 30 N"):
        compensator("optimal").profile(Problem.of(still))
