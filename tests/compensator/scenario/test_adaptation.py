"""Table [adaptation]."""

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.certificate import feedback_certificate
from tendonff.compensator.compensators.tuning import check_tuning, tuned_chain, tuning_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
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


def test_from_the_tension_both_directions_are_tuned_and_an_integral_is_certified(finger):
    """Three eighths of what is certified by default; from the position one factor, and no integral; 0 is none."""
    given = {"output_tension": "noise = 0.1", "actuator_position": "", "none": "integral_gain_per_s = 0.0"}
    gains = {}
    for sensor, more in given.items():
        name = "output_tension" if sensor == "none" else sensor
        scenario = parse_scenario(f'{finger}\n[adaptation]\nsensor = "{name}"\ndelay_samples = 2\n{more}\n')
        pair = (Tunable.MU_PULL, Tunable.MU_RELEASE)
        assert scenario.adaptation.parameters == ((Tunable.MU,) if name == "actuator_position" else pair)
        tuning = tuning_of(Problem.of(scenario), scenario.adaptation)
        gains[sensor] = tuning.integral_gain / scenario.run.step_s
        assert parse_scenario(scenario_to_toml(scenario)).adaptation == scenario.adaptation
    certified = feedback_certificate(scenario.transmission, scenario.run.step_s, 2, 0.0).largest_gain_per_s
    assert gains == pytest.approx({"output_tension": 3 * certified / 8, "actuator_position": 0, "none": 0})


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


@pytest.mark.compiler
def test_friction_and_load_are_tuned_on_a_path_that_moves(finger):
    head, _, rest = finger.partition("[path]")
    _, _, rest = rest.partition("[tendon]")
    sections = "".join(
        f'[[path.sections]]\nname = "{name}"\nangle_rad = {angle}\nlength_m = 0.05\n{more}\n'
        for name, angle, more in (("arm", 1.2, ""), ("elbow", 0.9, 'joint = "elbow"\nangle_per_rad = 1.0'))
    )
    motion = "offset_rad = 0.0\namplitudes_rad = [0.3]\nfrequencies_Hz = [0.7]\nfade_in_s = 0.5\n"
    joint = f'[joints.elbow]\nkind = "sine"\n{motion}'
    text = f"{head}[path]\nsegments = 6\n{sections}{joint}\n[tendon]{rest}{TABLE}"
    scenario = parse_scenario(text)
    problem = Problem.of(scenario)
    tuning, start = tuning_of(problem, scenario.adaptation), problem.reference.initial_tension_N
    tuned, wanted = tuned_chain(problem, tuning), problem.reference.tension_N[1:]
    rig = SimulatedRig(
        tuned.with_factors({Tunable.MU: 1.2, Tunable.LOAD_STIFFNESS: 0.8}), scenario.run.step_s, 1, start
    )
    run = SelfTuner(tuned, scenario.run.step_s, tuning, problem.limits, start).run(rig, wanted, np.zeros(len(wanted)))
    assert run.factors[-1, 0] == pytest.approx(1.2, rel=0.02)


def test_an_exponent_is_tuned_stated_or_not_where_the_path_rests(examples):
    table = TABLE.replace('"load_stiffness"', '"load_exponent"')
    for stated in ("", "load_exponent = 0.2\nreference_tension_N = 30.0"):
        text = (examples / "finger.toml").read_text(encoding="utf-8").replace("[friction]", f"[friction]\n{stated}", 1)
        check_tuning(parse_scenario(text + table, examples / "finger.toml"))
    with pytest.raises(InputError, match="at rest"):
        text = (examples / "finger_moving.toml").read_text(encoding="utf-8")
        check_tuning(parse_scenario(text + table, examples / "finger_moving.toml"))
