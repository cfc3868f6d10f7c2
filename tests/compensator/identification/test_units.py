from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.doubts import column_doubts, magnitude_warning, unit_warning
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError

TORQUES = Measurement(
    input_column="input_torque_Nm", output_column="F_out [kN]", input_position_column="motor angle (deg)"
)


def test_a_torque_or_an_angle_in_the_place_of_a_tension_or_a_position_is_named_with_the_option() -> None:
    message = unit_warning(TORQUES, ["input_position"])
    assert "input_torque_Nm as N (--scale input=FACTOR)" in message
    assert "motor angle (deg) as m (--scale input_position=FACTOR)" in message
    assert "F_out" not in message
    assert "time_s" not in message


def test_another_unit_of_the_same_quantity_in_a_name_is_a_doubt() -> None:
    [doubt] = column_doubts(TORQUES, ["input_position"])
    assert doubt.key == "measurement.output_scale"
    assert doubt.text == 'column "F_out [kN]" is read as N: kN? Then --scale output=FACTOR'


def test_a_factor_or_a_column_that_was_not_read_needs_no_message() -> None:
    for how in (Measurement(), replace(TORQUES, input_scale=100.0, output_scale=1000.0)):
        assert [*column_doubts(how, [])] == []
        assert unit_warning(how, []) == ""


def test_a_column_that_was_converted_is_not_said_to_be_read_without_a_factor() -> None:
    converted = "units: 1; F_out [kN] x 1000 (--scale overrides)"
    assert [*column_doubts(TORQUES, [], converted)] == []
    assert "input_torque_Nm as N" in unit_warning(TORQUES, [], converted)


@pytest.mark.parametrize("name", ["force_A", "pull_in", "cell_N", "F_g"])
def test_a_name_that_tells_a_place_is_no_unit(name: str) -> None:
    how = Measurement(input_column=name, input_position_column="pos_in")
    assert [*column_doubts(how, ["input_position"])] == []
    assert unit_warning(how, ["input_position"]) == ""


@pytest.mark.parametrize(("largest_N", "apart"), [(0.25, True), (1.6, False), (2900.0, False), (3100.0, True)])
def test_tensions_far_from_those_of_the_scenario_are_told(largest_N: float, apart: bool) -> None:
    message = magnitude_warning(largest_N, 150.0)
    assert ("--scale" in message) == bool(message) == apart


@pytest.fixture
def strokes(tmp_path):
    """A capstan of e^0.4 either way, in newtons."""
    time = np.arange(3000) / 200
    wave = 30 + 12 * np.sin(2 * np.pi * 0.4 * time)
    out, memory = np.empty_like(wave), wave[0]
    for k, tension in enumerate(wave):
        out[k] = memory = min(max(memory, tension * np.exp(-0.4)), tension * np.exp(0.4))
    write_csv(tmp_path / "a.csv", {"time_s": time, "input_tension_N": wave, "output_tension_N": out})
    return tmp_path / "a.csv"


@pytest.mark.compiler
@pytest.mark.usefixtures("unpainted")
def test_the_report_repeats_the_options_that_read_the_files(examples, strokes, tmp_path):
    other = replace(
        Measurement(), input_scale=2.0, output_scale=2.0, skip_s=0.5, explain=Explain.OUTPUT, time_column="time_s"
    )
    scenario = replace(load_scenario(examples / "finger.toml"), measurement=other)
    found = identify(scenario, [strokes], static_only=True)
    found.write(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "--data a.csv --scale input=2 --scale output=2 --skip 0.5 --explain output --static --out DIR" in page


def test_a_path_where_objects_are_expected_is_refused_with_the_way_to_write_it(examples):
    scenario = load_scenario(examples / "finger.toml")
    with pytest.raises(ParameterError, match=r'data must be a list of files, got "log\.csv"; write \["log\.csv"\]'):
        tf.identify(scenario, "log.csv")
    with pytest.raises(ParameterError, match=r"tf\.load_scenario\(file\) gives, got 'finger\.toml'"):
        tf.design("finger.toml")
    with pytest.raises(ParameterError, match=r"write tf\.Level\('presliding'\)"):
        tf.system_of(scenario.transmission, "presliding")


def test_a_file_cannot_judge_its_own_fit(examples, strokes):
    with pytest.raises(InputError, match=r"a\.csv: given with --data and with --validate"):
        identify(load_scenario(examples / "finger.toml"), [strokes], [strokes])


def test_one_column_cannot_be_two_channels(strokes):
    with pytest.raises(InputError, match='"input_tension_N" is named as the column of input and of output'):
        read_measurement(strokes, Measurement(output_column="input_tension_N"))


def test_a_column_that_does_not_rise_is_no_clock(strokes):
    with pytest.raises(
        InputError, match=r"input_tension_N rises in \d+ % of the rows only; name the column that holds time"
    ):
        read_measurement(strokes, Measurement(time_column="input_tension_N", input_column="time_s"))


def test_small_numbers_get_a_message_and_no_excitation(examples, strokes):
    scenario = load_scenario(examples / "finger.toml")
    small = replace(scenario, measurement=Measurement(input_scale=0.003, output_scale=0.003))
    with pytest.raises(InputError, match=r"kN\?.*Nothing was computed"):
        identify(small, [strokes], static_only=True)
    found = identify(small, [strokes], static_only=True, confirm=lambda _: True)
    assert not found.suggests
    assert any("is this its rig" in warning for warning in found.warnings)
    assert identify(scenario, [strokes], static_only=True).suggests
