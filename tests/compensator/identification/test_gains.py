"""Gains of the cells, found where the tension is the same along the path or the output tension is known."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.gains import gains_of
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tests.compensator.identification.test_fitted import STEP, strokes

pytestmark = pytest.mark.compiler

GAIN, REST_N, HOLD_S = 1.03, 40.0, 1.0
ZEROED = Measurement(input_offset_N=0.0, output_offset_N=0.0)
UNIFORM = replace(ZEROED, uniform_s=(0.0, 0.9))


@pytest.fixture(scope="module")
def rig(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def log(rig, tmp_path_factory):
    """A rig at rest before its first stroke, whose input cell reads 3 % too much."""
    file = tmp_path_factory.mktemp("gain") / "a.csv"
    time, force = strokes(5)
    held = np.full(round(HOLD_S / STEP), REST_N)
    force = np.concatenate([held, force])
    time = np.arange(len(force)) * STEP
    write_synthetic(
        file, rig.transmission, time, force, Faults(noise=0.002, seed=1), step_s=STEP, masses=20, positions=False
    )
    names = ("time_s", "input_tension_N", "output_tension_N")
    columns = [read_table(file, names, ()).numbers(name) for name in names]
    columns[1] = GAIN * columns[1]
    np.savetxt(file, np.column_stack(columns), fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    return file


def gains(log, how):
    return gains_of([read_measurement(log, how)], how)


@pytest.mark.parametrize("static_only", [True, False])
def test_a_uniform_start_identifies_the_ratio_of_the_gains_and_with_it_the_friction(rig, log, static_only):
    """A ratio of 1.03 left in would move mu by 0.03/pi, 0.0094, up one way and down the other."""
    found = identify(replace(rig, measurement=UNIFORM), [log], static_only=static_only)
    gain = found.estimate("input_gain")
    assert gain.identifiable
    low, high = gain.interval
    assert low <= GAIN <= high
    assert high - low < 0.005
    assert found.scenario.measurement.input_gain == gain.value
    assert found.replay_percent < 1.1 * found.fit_percent
    truth = rig.transmission.friction.mu_dynamic
    for name in ("mu_dynamic", "mu_dynamic_release"):
        estimate = found.estimate(name)
        if static_only:
            assert estimate.interval[0] <= truth <= estimate.interval[1], name
        else:
            assert estimate.value == pytest.approx(truth, abs=0.002)


def test_the_stated_doubt_of_the_gains_shrinks_to_what_was_measured(log):
    """Of two cells known to 2 % the ratio is known to 2.8 %; a common gain moves no coefficient of friction."""
    stated, measured = (gains(log, replace(how, gain_uncertainty=0.02)) for how in (ZEROED, UNIFORM))
    assert stated.ratio_deviation == pytest.approx(0.01 * np.sqrt(2))
    assert measured.ratio_deviation < 0.001
    assert measured.covariance[1, 1] == pytest.approx(0.01**2)
    known = gains(log, replace(UNIFORM, gain_uncertainty=0.02, known_output_s=(0.0, 0.9), known_output_N=REST_N))
    assert known.covariance[1, 1] < 0.001**2
    assert known.found == ("known_output_s", "uniform_s")


def test_a_known_load_identifies_the_gain_of_the_output_cell(log):
    """The output cell is exact, so that a load of 40 N stated as 38 N makes it read 40/38 of the truth."""
    found = gains(log, replace(UNIFORM, known_output_s=(0.0, 0.9), known_output_N=38.0))
    assert found.output == pytest.approx(REST_N / 38, rel=2e-3)
    assert found.input == pytest.approx(GAIN * REST_N / 38, rel=2e-3)


def test_gains_that_were_taken_out_are_not_found_again(log):
    first = gains(log, UNIFORM)
    again = gains(log, replace(UNIFORM, input_gain=first.input))
    assert again.input == pytest.approx(first.input, rel=1e-12)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        (Measurement(uniform_s=(0.0, 0.9)), "only where the cells' zeros are known; give --tare"),
        (replace(ZEROED, uniform_s=(0.0, 3.0)), "the input moves by .* N in uniform_s"),
        (replace(ZEROED, uniform_s=(80.0, 81.0)), "0 samples between 80 and 81 s, 10 are needed"),
        (replace(ZEROED, known_output_s=(0.0, 0.9), known_output_N=10.0), "more than 22 %"),
    ],
)
def test_a_time_that_identifies_no_gain_is_refused_with_the_way_out(log, how, message):
    with pytest.raises(InputError, match=message):
        gains(log, how)


def test_a_known_load_needs_its_time():
    with pytest.raises(ParameterError, match="known_output_s and known_output_N go together"):
        Measurement(known_output_N=3.0)
