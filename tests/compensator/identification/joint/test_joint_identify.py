"""Identification of a joint on logs of its own mechanism: laws that the data choose, what is told, what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError, read_csv
from tendonff.compensator.identification.joint.estimates import derived
from tendonff.compensator.identification.joint.first_look import look
from tendonff.compensator.identification.joint.fitted import fitted_text, moved_files
from tendonff.compensator.identification.joint.log import read_logs
from tendonff.compensator.identification.joint.parameters import JointNumber
from tendonff.compensator.identification.joint.routine import suggest_routine
from tendonff.compensator.identification.joint.run import identify_joint
from tendonff.compensator.scenario.measurement import Measurement
from tests.compensator.identification.joint import own_log
from tests.hidden_loop import EXAMPLES, scenario

pytestmark = [pytest.mark.compiler]


@pytest.mark.slow
def test_without_a_stop_lost_motion_and_friction_are_told_and_nothing_else(tmp_path):
    asked = scenario(stop=False)
    true = own_log.other()
    found = identify_joint(asked, [own_log.write(tmp_path, true, asked)])
    exponent, _, lost, friction = derived(true, 0.0)
    assert found.estimate("mu_theta").value != pytest.approx(exponent, rel=0.1)  # else the claim would be empty
    assert found.estimate("lost_motion_rad").value == pytest.approx(lost, rel=0.08)
    assert found.estimate("drive_torque_N_m").value == pytest.approx(friction, rel=0.08)
    for name in ("mu_dynamic", "pretension_N", "stiffness_N_per_m", "mu_theta", "tension_over_stiffness_m"):
        assert not found.estimate(name).identifiable
        assert "push slowly against a stop" in found.estimate(name).why
    assert any("no push against a stop" in text for text in found.warnings)
    assert "push slowly against a stop" in found.missing


def test_a_shallow_push_starts_from_a_stop_that_was_reached(tmp_path):
    """Else the fit never touches it: tension and stiffness then miss the truth by more than their intervals."""
    known = scenario().mechanism
    true = replace(known, joints=(replace(known.joint, stop_low_rad=-0.1),))
    [log] = read_logs(scenario(), [own_log.write(tmp_path, true, dip_rad=0.12)], Measurement())
    found = look(log, known)
    assert [push.way for push in found.pushes] == [1, -1]
    assert -0.12 <= found.start(known, 0.0)[JointNumber.STOP_LOW] <= -0.03


@pytest.mark.slow
def test_an_efficiency_of_the_gear_is_taken_up_where_it_acts_and_written(tmp_path):
    true = own_log.other(gear_efficiency=0.88)
    log = own_log.write(tmp_path, true)
    assert run(["identify", str(_file(tmp_path)), "--data", str(log), "--out", str(tmp_path / "fit")]) == 0
    told = json.loads((tmp_path / "fit" / "fit.json").read_text("utf-8"))
    assert "efficiency" in told["law"]
    assert told["estimates"]["gear_efficiency"]["estimate"] == pytest.approx(0.88, abs=0.02)
    fitted = tf.load_joint_scenario(tmp_path / "fit" / "fitted.toml").mechanism
    assert fitted.drive.gear_efficiency == told["estimates"]["gear_efficiency"]["estimate"]


def _file(folder):
    path = folder / "hand.toml"
    path.write_text(scenario().text, "utf-8")
    return path


def test_the_routine_stays_within_the_drive_and_makes_a_tendon_slack(tmp_path):
    routine = suggest_routine(scenario())
    drive = scenario().mechanism.drive
    assert 10 <= routine.time_s[-1] <= 30
    assert np.abs(np.gradient(routine.motor_rad, 0.01)).max() <= drive.speed_max_rad_per_s
    assert np.abs(routine.expected.torque_N_m).max() <= drive.torque_max_N_m
    assert routine.expected.slack
    assert routine.expected.angle_rad.max() < scenario().mechanism.joint.stop_high_rad + 0.01
    assert run(["identify", str(_file(tmp_path)), "--suggest", "--out", str(tmp_path / "out")]) == 0
    written = read_csv(tmp_path / "out" / "suggested_motor.csv", ("time_s", "motor_rad"), increasing="time_s")
    assert np.array_equal(written["motor_rad"], routine.motor_rad)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ("time_s,motor_rad,motor_current_A", "torque constant"),
        ("time_s,motor_torque_N_m", "motor_rad"),
        ("time_s,motor_rad,force_N", "motor_torque_N_m"),
        ("time_s,motor_rad,joint_torque_N_m", r'^(?!.*did you mean).*"motor_torque_N_m" is missing'),
        ("motor_rad,motor_torque_N_m", r'^(?!.*torque constant).*"time_s" is missing'),
    ],
)
def test_a_column_that_is_missing_is_named(tmp_path, columns, told):
    time = np.arange(200) * 0.01
    table = np.column_stack([time, *(np.sin(time) for _ in columns.split(",")[1:])])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=columns, comments="")
    asked = tf.load_joint_scenario(EXAMPLES / "hand_joint.toml")
    with pytest.raises(InputError, match=told):
        identify_joint(asked, [tmp_path / "log.csv"])


def test_a_pair_is_refused_with_the_way_out(tmp_path):
    pair = tf.load_joint_scenario(EXAMPLES / "instrument_pair.toml")
    with pytest.raises(InputError, match="both ends of one tendon that passes the joint"):
        identify_joint(pair, [tmp_path / "log.csv"])
    with pytest.raises(InputError, match="for a loop"):
        suggest_routine(pair)


def test_options_of_a_tendon_are_refused(tmp_path, capsys):
    code = run(["identify", str(_file(tmp_path)), "--data", "x.csv", "--static", "--out", str(tmp_path / "o")])
    assert code == 2
    assert "--static is for the tensions of one tendon" in capsys.readouterr().err


def test_the_written_text_holds_the_same_mechanism_from_another_folder(tmp_path):
    """Also of a scenario whose numbers stand in a base, and of tendons that differ, one with a table of lengths."""
    hand = (EXAMPLES / "hand_joint.toml").read_text("utf-8")
    (tmp_path / "hand.toml").write_text(hand.replace("[joints.knuckle]", "[joints.old]"), "utf-8")
    own = 'schema = 1\nbase = "hand.toml"\n[joints.tip]\nkind = "driven"\ninertia_kg_m2 = 1.0e-5\n'
    (tmp_path / "tip.toml").write_text(own, "utf-8")
    (tmp_path / "flexor.csv").write_text("angle_rad,length_m\n-1,0.010\n0,0.002\n1,-0.007\n", "utf-8")
    apart = hand.replace("moment_arm_m = 0.008  ", 'lengths = "flexor.csv"  #', 1)
    apart = apart.replace(
        "moment_arm_m = -0.008 ", "moment_arm_m = -0.008\npath = { total_angle_rad = 2.5, segments = 6 } #", 1
    )
    (tmp_path / "apart.toml").write_text(apart, "utf-8")
    (tmp_path / "out").mkdir()
    for file in (tmp_path / "tip.toml", tmp_path / "apart.toml", EXAMPLES / "instrument_pair.toml"):
        asked = tf.load_joint_scenario(file)
        text = moved_files(fitted_text(asked, asked.mechanism, []), asked.source, tmp_path / "out")
        (tmp_path / "out" / file.name).write_text(text, "utf-8")
        again = tf.load_joint_scenario(tmp_path / "out" / file.name)
        assert repr(again.mechanism) == repr(asked.mechanism)
        assert again.reference == asked.reference
