"""The loop of a surgical tool as a virtual sensor: jaw angle from angle and torque of the motor's side."""

from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.identification.joint.log import read_logs
from tendonff.compensator.identification.joint.sensor import fit_sensor
from tendonff.compensator.scenario.measurement import Measurement
from tests.hidden_loop import scenario

HOW = Measurement(
    input_column="input_torque_Nm", input_position_column="input_angle_rad", output_position_column="output_angle_rad"
)


@pytest.mark.slow
def test_the_memory_of_friction_gives_the_jaw_angle_of_unseen_files(measured_data: Path, record_property) -> None:
    tool = measured_data / "davinci_tool4"
    seen, unseen = (
        read_logs(scenario(), sorted((tool / part).glob("*.csv")), HOW) for part in ("identify", "validate")
    )
    found = fit_sensor(seen, unseen)
    one, own = found.rms_deg("validate"), found.rms_deg("validate", own_zero=True)
    record_property("figure", f"jaw angle unseen: {one:.2f} deg with one zero, {own:.2f} with one each")
    assert one <= 0.60
    assert own <= 0.40
    errors = np.concatenate([f.error_rad for f in found.files if f.role == "validate"])
    assert np.mean(np.abs(errors) <= found.band_rad) >= 0.9  # the band was found on the fitted files alone
    assert np.degrees(found.band_rad) < 1.5
    for estimate in found.estimates:
        low, high = estimate.interval
        assert low < estimate.value < high, estimate.name
