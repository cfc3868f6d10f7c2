"""[robust.spread]: the interval of any number of the scenario."""

from pathlib import Path

import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.uncertainty import Spread


@pytest.fixture(scope="module")
def finger(examples: Path) -> str:
    return (examples / "finger.toml").read_text(encoding="utf-8")


def with_spread(text: str, *lines: str) -> str:
    return text + "\n[robust.spread]\n" + "\n".join(lines) + "\n"


def test_half_widths_ends_and_keys_that_vary_together_are_read_and_written_back(finger: str) -> None:
    text = with_spread(
        finger,
        '"load.stiffness_N_per_m" = 0.2',
        '"actuator.coulomb_N" = [0.0, 15.0]',
        '"tendon.stiffness_N_per_m, tendon.relaxing_stiffness_N_per_m" = 0.1',
    )
    scenario = parse_scenario(text)
    assert scenario.robust.spread == (
        Spread(keys=("load.stiffness_N_per_m",), half_width=0.2),
        Spread(keys=("actuator.coulomb_N",), low=0.0, high=15.0),
        Spread(keys=("tendon.stiffness_N_per_m", "tendon.relaxing_stiffness_N_per_m"), half_width=0.1),
    )
    again = parse_scenario(scenario_to_toml(scenario))
    assert again.robust == scenario.robust
    assert not scenario.robust.is_certain


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('"load.stifness_N_per_m" = 0.2', 'unknown key "load.stifness_N_per_m", did you mean "load.stiffness_N_per_m"'),
        ('"load.stiffness_N_per_m" = "much"', "must be a relative half-width or \\[low, high\\]"),
        ('"load.stiffness_N_per_m" = [1.0, 2.0, 3.0]', "must be a relative half-width or \\[low, high\\]"),
        ("load.stiffness_N_per_m = 0.2", 'write the dotted key in quotes: "load.stiffness_N_per_m"'),
        ('"actuator.coulomb_N" = 0.2', 'spread "actuator.coulomb_N": the number is not set'),
        ('"friction.adhesion_N" = 0.2', 'spread "friction.adhesion_N": the number is 0'),
        ('"path.segments" = 0.5', "a whole number cannot be uncertain"),
        ('"friction.mu_static" = 0.5', r"mu_dynamic = 0\.2 is above mu_static = 0\.1"),
        ('"load.mass_kg" = [-1.0, 1.0]', "mass_kg must be a finite number > 0, got -1"),
    ],
)
def test_what_cannot_vary_is_refused_with_a_way_out(finger: str, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_scenario(with_spread(finger, line))


@pytest.mark.parametrize("interval", ["[0.15, 0.25]", '"0.15 to 0.25"'])
def test_an_interval_in_the_place_of_a_number_is_sent_to_the_spreads(finger: str, interval: str) -> None:
    given = finger.replace("mu_dynamic = 0.2", f"mu_dynamic = {interval}", 1)
    with pytest.raises(InputError, match=r"mu_dynamic must be a number, .*; an interval goes into \[robust\.spread\]"):
        parse_scenario(given)


def test_a_number_has_one_spread(finger: str) -> None:
    with pytest.raises(InputError, match=r'"load\.mass_kg" has two spreads'):
        parse_scenario(with_spread(finger, '"load.mass_kg" = 0.2', '"load.mass_kg, tendon.mass_kg" = 0.1'))


@pytest.mark.parametrize("rig", ["bowden", "exosuit", "tendon", "surgical"])
def test_a_new_scenario_says_how_well_its_estimates_are_known_and_why(rig: str) -> None:
    from importlib.resources import files

    template = files("tendonff.compensator.scenario").joinpath("templates", f"{rig}.toml")
    text = template.read_text(encoding="utf-8")
    scenario = parse_scenario(text)
    assert len(scenario.robust.spreads) >= 5
    table = text.partition("[robust.spread]")[2]
    rows = [line for line in table.splitlines() if line.startswith('"')]
    assert sum("#" in row for row in rows) >= len(rows) - 1


def test_a_whole_file_of_an_example_stays_certain(examples: Path) -> None:
    assert load_scenario(examples / "finger.toml").robust.is_certain
