"""Stops of a loop: pushes against them, and what is none."""

from dataclasses import replace

import pytest

from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.estimates import derived
from tendonff.compensator.identification.motors.first_look import look
from tendonff.compensator.identification.motors.law import MechanismLaw
from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.compensator.scenario.measurement import Measurement
from tests.compensator.identification.motors import own_log
from tests.hidden_loop import EXAMPLES, scenario

pytestmark = [pytest.mark.compiler]


def test_weight_at_an_end_of_the_strokes_is_no_push_against_a_stop(tmp_path):
    asked = far_stop()
    true = replace(asked.mechanism, joints=(replace(asked.mechanism.joint, gravity_N_m=0.04),))
    [log] = read_logs(asked, [own_log.write(tmp_path, true, asked, dip_rad=0.05)], Measurement())
    found = look(log, asked.mechanism)
    assert log.torque_N_m.min() < found.offset_N_m - 1.3 * found.drive_torque_N_m  # it looks like one
    assert [push.way for push in found.pushes] == [1]


def test_a_joint_starts_within_the_stops_that_are_looked_for(tmp_path):
    asked = scenario()
    [log] = read_logs(asked, [own_log.write(tmp_path, asked.mechanism, dip_rad=0.3)], Measurement())
    joint = replace(asked.mechanism.joint, stop_low_rad=-0.2)
    law = MechanismLaw(mechanism=replace(asked.mechanism, joints=(joint,)), logs=[log])
    for stop, beyond in ((Parameter.STOP_LOW, 0.01), (Parameter.STOP_HIGH, -0.01)):
        [unknown] = law.unknowns({stop: beyond})
        low, high = (unknown.low, 0.0) if stop is Parameter.STOP_LOW else (0.0, unknown.high)
        assert (unknown.low, unknown.high) == (low, high)
        assert low < unknown.start < high


def test_the_stops_of_the_scenario_are_tried_where_the_first_look_saw_others(tmp_path, monkeypatch):
    asked = scenario()
    path = own_log.write(tmp_path, asked.mechanism)
    found = look(read_logs(asked, [path], Measurement())[0], asked.mechanism)
    blind = replace(found, pushes=(), exponent=None, tension_over_stiffness_m=None)
    monkeypatch.setattr("tendonff.compensator.identification.motors.run.look", lambda *_: blind)
    again = identify(asked, [path])
    assert again.described
    assert again.estimate("stop_high_rad").value == pytest.approx(1.25, abs=5e-3)
    assert again.estimate("mu_theta").value == pytest.approx(derived(asked.mechanism, 0.0)[0], rel=0.1)


def far_stop() -> JointScenario:
    """The hand as users plan it, with a stop beyond its range: its weight counts beside its friction."""
    text = (EXAMPLES / "hand_joint.toml").read_text("utf-8")
    stop = "gravity_zero_rad = 0.0\nstop_high_rad = 1.7\nstop_stiffness_N_m_per_rad = 100.0\n"
    return parse_joint_scenario(text.replace("gravity_zero_rad = 0.0", stop), EXAMPLES / "hand_joint.toml")
