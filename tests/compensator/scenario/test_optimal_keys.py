"""The table [optimal]: read straight into the options of the search; keys of earlier versions name the way out."""

import math

import pytest

from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.ocp.tracking.options import TrackOptions


@pytest.fixture(scope="module")
def text(examples):
    return (examples / "finger_fast.toml").read_text(encoding="utf-8") + "\n[optimal]\n"


def test_what_the_table_says_are_the_options_and_what_it_leaves_out_are_their_defaults(text):
    scenario = parse_scenario(text + "minimum_tension_N = 2\nstiffer_weight = 0.5\n")
    assert scenario.optimal == TrackOptions(minimum_tension_N=2.0, maximum_tension_N=math.inf, stiffer_weight=0.5)
    assert parse_scenario(scenario_to_toml(scenario)).optimal == scenario.optimal


@pytest.mark.parametrize(
    ("key", "way_out"),
    [
        ("tolerance_N = 1.0", "raise travel_weight"),
        ("least_time = true", "waypoints reference"),
        ("preview_s = 0.1", r"preview_s of \[stream\]"),
        ("static_weight = 0.003", "stiffer_weight"),
        ("restarts = 6", "no random part"),
    ],
)
def test_a_key_of_earlier_versions_is_refused_with_the_way_out(text, key, way_out):
    name = key.partition(" ")[0]
    with pytest.raises(InputError, match=rf'\[optimal\]: key "{name}" was removed in 0\.3\.0: .*{way_out}'):
        parse_scenario(f"{text}{key}\n")
