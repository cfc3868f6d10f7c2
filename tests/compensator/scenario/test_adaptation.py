"""Table [adaptation]."""

import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import load_scenario, parse_scenario, scenario_to_toml
from tendonff.ocp.adaptation.tuning import Sensor, Tunable

TABLE = """
[adaptation]
sensor = "output_tension"
noise = 0.1
delay_samples = 2
parameters = ["mu", "load_stiffness"]
range = [0.6, 1.8]
integral_gain_per_s = 20.0
"""


@pytest.fixture
def finger(examples):
    return (examples / "finger.toml").read_text(encoding="utf-8")


def test_the_table_is_read_and_written_back(finger):
    scenario = parse_scenario(finger + TABLE)
    adaptation = scenario.adaptation
    assert adaptation is not None
    assert adaptation.sensor is Sensor.OUTPUT_TENSION
    assert adaptation.parameters == (Tunable.MU, Tunable.LOAD_STIFFNESS)
    assert adaptation.range == (0.6, 1.8)
    assert parse_scenario(scenario_to_toml(scenario)).adaptation == adaptation


def test_without_the_table_there_is_none_and_nothing_is_written(finger):
    scenario = parse_scenario(finger)
    assert scenario.adaptation is None
    assert "adaptation" not in scenario_to_toml(scenario)


def test_the_example_tunes_friction_from_the_position(examples):
    adaptation = load_scenario(examples / "finger_adaptive.toml").adaptation
    assert adaptation is not None
    assert adaptation.sensor is Sensor.ACTUATOR_POSITION
    assert adaptation.parameters == (Tunable.MU,)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('sensor = "output_tension"\n', "", 'key "sensor" is missing'),
        ('"output_tension"', '"tension"', 'sensor must be "output_tension" or "actuator_position"'),
        ("delay_samples = 2", "delay_samples = 64", "delay_samples must be a whole number from 0 to 63, got 64"),
        ("[0.6, 1.8]", "[1.2, 1.8]", "range must be two numbers around 1"),
        ('["mu", "load_stiffness"]', '["load_stiffness"]', 'must tune the friction, got [load_stiffness]; add "mu"'),
        ('["mu", "load_stiffness"]', '["mass"]', 'parameters[0] must be "mu" or'),
        ('"output_tension"', '"actuator_position"', "integral action needs the output tension"),
        ("noise = 0.1", "noise = -0.1", "noise must be a finite number >= 0"),
        ("noise", "nois", 'unknown key "nois"'),
    ],
)
def test_what_is_wrong_is_named_with_the_way_out(finger, old, new, text):
    assert old in TABLE
    with pytest.raises(InputError) as error:
        parse_scenario(finger + TABLE.replace(old, new, 1))
    assert text in str(error.value)
