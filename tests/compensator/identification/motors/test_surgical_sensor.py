"""The loop of a surgical tool as a virtual sensor: jaw angle from angle and torque of the motor's side."""

from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.motors.sensor import fit_sensor
from tendonff.compensator.identification.motors.torque import fit_torque
from tendonff.compensator.scenario.measurement import Measurement
from tests.hidden_loop import scenario

HOW = Measurement(
    input_column="input_torque_Nm",
    output_column="output_torque_Nm",
    input_position_column="input_angle_rad",
    output_position_column="output_angle_rad",
)


@pytest.fixture(scope="module")
def logs(measured_data: Path):
    """Fitted files, and unseen ones."""
    tool = measured_data / "davinci_tool4"
    return tuple(read_logs(scenario(), sorted((tool / part).glob("*.csv")), HOW) for part in ("identify", "validate"))


@pytest.mark.slow
def test_the_memory_of_friction_gives_the_jaw_angle_of_unseen_files_from_any_start(logs, record_property) -> None:
    seen, unseen = logs
    found = fit_sensor(seen, unseen)
    one, own = found.rms_deg("validate"), found.rms_deg("validate", own_zero=True)
    inside = found.inside_percent("validate")
    record_property("figure", f"jaw angle unseen: {one:.2f} deg with one zero, {own:.2f} with one each, {inside:.0f} %")
    assert one <= 0.60
    assert own <= 0.40
    assert 93 <= inside <= 99  # the interval was found on the fitted files alone
    assert min(f.inside for f in found.files) >= 0.85
    assert np.degrees(found.band_rad) < 1.5
    for estimate in found.estimates:
        low, high = estimate.interval
        assert low < estimate.value < high, estimate.name


@pytest.mark.slow
def test_a_memory_deeper_than_the_torques_is_kept_out_where_files_are_few(logs) -> None:
    """Three files at 10 and 70 % load fit exponents that no stroke wipes out: 2 deg on unseen files."""
    seen, unseen = logs
    largest = fit_torque(seen[:3], ()).largest_exponents
    free, bounded = fit_sensor(seen[:3], unseen), fit_sensor(seen[:3], unseen, largest)
    assert free.sensor.law.release_exponent > 2
    assert bounded.bounded
    assert bounded.sensor.law.release_exponent <= largest["release_exponent"] * (1 + 1e-9)
    assert bounded.rms_deg("validate") < 0.6 * free.rms_deg("validate")
    assert bounded.band_rad < 0.5 * free.band_rad
    assert bounded.inside_percent("validate") >= 95
