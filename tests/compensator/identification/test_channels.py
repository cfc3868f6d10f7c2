"""What is wrong with the columns is recognised before any law is fitted, and named."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.fitting.delay import align, most_delay_s
from tendonff.compensator.identification.fitting.dynamic import fit_coarse
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw

STEP_S = 0.01


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


def tensions(seconds=20.0, exponent=0.4):
    """Both ends of the play law under strokes."""
    time = np.arange(0.0, seconds, STEP_S)
    near = 42 - 26 * np.cos(2.0 * time) + 10 * np.sin(0.71 * time)
    return time, near, CapstanLaw(pull_exponent=exponent, release_exponent=exponent).output_history_N(near)


def log(path, time, near, far):
    noise = np.random.default_rng(0).normal(0, 0.05, (2, len(time)))
    write_csv(path, {"time_s": time, "input_tension_N": near + noise[0], "output_tension_N": far + noise[1]})
    return path


def test_exchanged_columns_are_named_with_the_options_that_put_them_right(finger, tmp_path):
    time, near, far = tensions()
    with pytest.raises(InputError, match=r"exchanged.*--input-column output_tension_N --output-column input_tension_N"):
        identify(finger, [log(tmp_path / "a.csv", time, far, near)], static_only=True)


def test_a_reversed_sign_is_named_with_the_option_that_puts_it_right(finger, tmp_path):
    time, near, far = tensions()
    with pytest.raises(InputError, match=r"output is below zero in 100 % of the rows.*--scale output=-1"):
        identify(finger, [log(tmp_path / "a.csv", time, near, -far)], static_only=True)
    with pytest.raises(InputError, match="the sign of one is reversed; --scale output=-1"):
        identify(finger, [log(tmp_path / "b.csv", time, near, 0.9 * far.mean() - far)], static_only=True)


def test_an_output_that_is_a_multiple_of_the_input_is_no_friction(finger, tmp_path):
    time, near, _ = tensions()
    with pytest.raises(InputError, match=r"output_tension_N is 0\.9[23]\d* times input_tension_N at every moment"):
        identify(finger, [log(tmp_path / "a.csv", time, near, 0.93 * near)], static_only=True)


def test_columns_in_order_pass(finger, tmp_path):
    time, near, far = tensions(exponent=0.05)
    found = identify(finger, [log(tmp_path / "a.csv", time, near, far)], static_only=True)
    assert found.estimate("mu_theta").value == pytest.approx(0.05, rel=0.1)


@pytest.mark.compiler
def test_no_delay_longer_than_a_logger_has_is_taken_out(finger, tmp_path):
    """The output comes a third of a second late, which no cell does."""
    time, near, far = tensions(12.0)
    late = np.interp(time - 0.33, time, far)
    record = clean(read_measurement(log(tmp_path / "a.csv", time, near, late), finger.measurement), finger.measurement)
    coarse = fit_coarse([record], finger.transmission, {}, several=False)
    delay, _, records = align([record], coarse, finger.transmission)
    assert most_delay_s([record]) == pytest.approx(0.1)
    assert not (delay.identified and abs(delay.seconds) > 0.1)
    assert not delay.identified or records[0] is not record
    short = replace(record, pieces=(record.pieces[0].part(slice(0, 41)),))
    assert most_delay_s([short]) == pytest.approx(0.04)
