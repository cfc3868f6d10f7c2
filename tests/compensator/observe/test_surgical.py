"""Jaw of a surgical tool from the motor's side, through `identify`, `fitted.toml` and the observer, on unseen files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.identification.motors.fitted import observer_text
from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.motors.sensor import fit_sensor
from tendonff.compensator.identification.motors.torque import fit_torque, half_width
from tendonff.compensator.scenario.driven.joint import parse_joint_scenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.capstan import CapstanLaw
from tendonff.models.joint.quasi_static import LoopTorque
from tests.hidden_loop import scenario

HOW = Measurement(
    input_column="input_torque_Nm",
    output_column="output_torque_Nm",
    input_position_column="input_angle_rad",
    output_position_column="output_angle_rad",
)
RINGING_S = 0.3
"""The load torque is switched on at the start of each file, and rings."""

LAW = LoopTorque(
    law=CapstanLaw(pull_exponent=0.35, release_exponent=0.3, adhesion_N=0.14), spring=-0.02, offset=0.01, slid_rad=0.02
)


def table(**more) -> ObserverTable:
    angle = {"angle_pull_exponent": 0.4, "angle_release_exponent": 0.3, "angle_preload_N_m": 0.2, "angle_gain": 0.9}
    angle |= {"angle_compliance_rad_per_N_m": 0.3, "angle_elongation_rad_per_N_m": 0.5, "angle_zero_rad": 1.0}
    return ObserverTable(**angle, angle_band_rad=0.01, **more)


def test_the_observer_gives_the_laws_row_by_row_and_knows_the_torque_once_the_loop_has_slid():
    asked = scenario()
    whole = ObserverTable.of(table().angle, 0.01, LAW, 0.005)
    observer = tf.Observer(parse_joint_scenario(observer_text(asked, whole), asked.source))
    time = np.arange(200) * 0.02
    motor, torque = 0.5 * np.sin(3 * time), 0.1 * np.sin(3 * time + 0.5) + 0.02 * np.sin(17 * time)
    rows = [observer.step(motor_rad=a, motor_torque_N_m=b) for a, b in zip(motor, torque, strict=True)]
    angle, torques = np.array([(r.angle_rad.value, r.torque_N_m.value) for r in rows]).T
    assert angle == pytest.approx(whole.angle.angle_rad(motor, torque), abs=1e-12)
    assert torques == pytest.approx(LAW.torque(motor, torque), abs=1e-12)
    width = np.array([r.torque_N_m.high - r.torque_N_m.low for r in rows])
    slid = int(np.argmax(motor - motor[0] > LAW.slid_rad))
    assert np.all(width[:slid] > 0.05)
    assert width[slid:] == pytest.approx(np.full(len(width) - slid, 0.01))
    held = observer.step(motor_rad=float("nan"), motor_torque_N_m=0.1)
    assert observer.status == (tf.ObserverStatus.INPUT_HELD,)
    assert held == rows[-1]


def test_the_interval_of_the_angle_holds_from_any_start():
    """An observer that is switched on in the middle of a stroke does not know what friction stored before."""
    asked = scenario()
    own = replace(table(), angle_pull_exponent=0.8, angle_release_exponent=1.3, angle_band_rad=1e-6)
    fitted = parse_joint_scenario(observer_text(asked, own), asked.source)
    time = np.arange(400) * 0.02
    motor, torque = 0.5 * np.sin(2 * time), 0.12 * np.sin(3 * time + 0.5) + 0.03 * np.sin(17 * time)
    true, far = own.angle.angle_rad(motor, torque), 0.0
    for start in np.random.default_rng(4).integers(0, 200, 5):
        observer = tf.Observer(fitted)
        rows = zip(motor[start:], torque[start:], strict=True)
        seen = [observer.step(motor_rad=a, motor_torque_N_m=b).angle_rad for a, b in rows]
        value, low, high = np.array([(s.value, s.low, s.high) for s in seen]).T
        assert np.all((low <= true[start:]) & (true[start:] <= high))
        assert high[-1] - low[-1] < 0.02 * (high[0] - low[0])  # strokes wipe out what was before
        far = max(far, np.abs(value - true[start:]).max())
    assert far > 0.01  # so the interval is needed
    observer.step(motor_rad=float("nan"), motor_torque_N_m=0.1)  # who knows what the motor did meanwhile
    again = observer.step(motor_rad=0.0, motor_torque_N_m=0.0).angle_rad
    assert again.high - again.low > 0.02


def test_a_loop_that_slides_carries_the_capstan_ratio_of_both_ways():
    motor = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50)])
    torque = np.full(100, 0.2)
    found = LAW.torque(motor, torque) - LAW.spring * motor - LAW.offset + 0.14
    assert found[40] == pytest.approx(0.34 * np.exp(-0.35))
    assert found[99] == pytest.approx(0.34 * np.exp(-0.35))  # the motor's torque has not changed: nothing slid back
    assert LAW.range_at(0.0, 0.2) == pytest.approx((0.34 * np.exp(-0.35) - 0.13, 0.34 * np.exp(0.3) - 0.13))


def test_a_table_names_what_it_lacks():
    with pytest.raises(tf.ParameterError, match="torque_release_exponent"):
        table(torque_pull_exponent=0.3)


def test_a_band_from_few_files_holds_95_percent_of_another_one_almost_surely():
    """Rows of a file err together: files differ in scatter, and their offsets are all that is known of the next one."""
    draw, held = np.random.default_rng(0), []
    for _ in range(200):
        *left, unseen = (draw.standard_normal() + 0.2 * draw.standard_normal(200) for _ in range(7))
        held.append(np.mean(np.abs(unseen) <= half_width(left)) >= 0.95)
    assert np.mean(held) >= 0.93
    many = [draw.standard_normal(100) for _ in range(1000)]
    assert half_width(many) == pytest.approx(1.96, rel=0.06)


@pytest.fixture(scope="module")
def tool(measured_data: Path):
    """Scenario with the observer that the fitted files give, and the fits."""
    folder, asked = measured_data / "davinci_tool4", scenario()
    seen, unseen = (read_logs(asked, sorted((folder / part).glob("*.csv")), HOW) for part in ("identify", "validate"))
    torque = fit_torque(seen, unseen)
    angle = fit_sensor(seen[:3], (), torque.largest_exponents)
    laws = ObserverTable.of(angle.sensor, angle.band_rad, torque.law, torque.band_N_m or 0.0)
    return folder, parse_joint_scenario(observer_text(asked, laws), asked.source), torque


@pytest.mark.slow
@pytest.mark.parametrize(("part", "most_mNm"), [("identify", 5.8), ("validate", 7.2)])
def test_the_jaw_torque_of_whole_strokes_follows_from_the_motor(tool, part, most_mNm, record_property):
    folder, fitted, _ = tool
    table = replace(fitted.observer)
    errors, inside = [], []
    for file in sorted((folder / part).glob("*.csv")):
        rows = np.genfromtxt(file, delimiter=",", names=True)
        rows = rows[rows["time_s"] > RINGING_S]
        observer = tf.Observer(replace(fitted, observer=table))
        core = observer._core._torque  # the same law over all rows at once: a row a call is tested above
        errors.append(core.torque(rows["input_angle_rad"], rows["input_torque_Nm"]) - rows["output_torque_Nm"])
        inside.append(np.abs(errors[-1]) <= table.torque_band_N_m)
    rms = 1e3 * float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    record_property(
        "figure", f"jaw torque, {part}: {rms:.2f} mNm, {100 * np.mean(np.concatenate(inside)):.0f} % inside"
    )
    assert rms <= most_mNm
    assert all(np.mean(rows) >= 0.93 for rows in inside)  # the band was found on the fitted files alone


@pytest.mark.slow
def test_the_laws_numbers_are_those_of_a_loop_with_one_friction(tool):
    """Both ways the same, near 0.35: found before with the roles of the torques exchanged."""
    law = tool[2].law.law
    assert law.pull_exponent == pytest.approx(0.35, abs=0.03)
    assert law.release_exponent == pytest.approx(law.pull_exponent, rel=0.1)
