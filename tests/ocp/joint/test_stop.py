"""A joint that runs into its stop."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DrivenJoint
from tendonff.ocp.fits.mechanism import Loop, MotorRun, respond
from tests import joint_plant
from tests.joint_rig import ARM, STIFFNESS, mechanism


def test_stops_hold_the_joint_beyond_them_alone():
    joint = DrivenJoint(
        name="q", inertia_kg_m2=1e-5, stop_low_rad=-0.5, stop_high_rad=1.0, stop_stiffness_N_m_per_rad=80.0
    )
    held = joint.static_torque_N_m(np.array([-0.6, -0.5, 0.3, 1.0, 1.05]))
    assert held == pytest.approx([-8.0, 0.0, 0.0, 0.0, 4.0])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"stop_high_rad": 1.0}, "stop_stiffness_N_m_per_rad > 0"),
        ({"stop_high_rad": -1.0, "stop_low_rad": 1.0, "stop_stiffness_N_m_per_rad": 9.0}, "below stop_high_rad"),
    ],
)
def test_stops_that_cannot_be_are_refused(keys, message):
    with pytest.raises(ParameterError, match=message):
        DrivenJoint(name="q", inertia_kg_m2=1e-5, **keys)


@pytest.mark.compiler
def test_a_push_against_the_stop_is_that_of_the_independent_plant(record_property):
    """Taut, through the kink, slack; a free stroke before it: the torque within 1 % of its range."""
    rig = mechanism()
    rig = replace(rig, joints=(replace(rig.joint, stop_high_rad=0.3, stop_stiffness_N_m_per_rad=100.0),))
    motor = np.interp(np.arange(0.0, 1.5, 1e-3), [0.0, 0.6, 1.4, 1.5], [0.0, 0.36, 0.62, 0.62])
    plant = joint_plant.respond(rig, motor, 1e-3, 0.0, tensions_N=np.full(2, 15.0), masses=16, step_s=5e-6)
    felt = ARM * (plant.drum_N[:, 0] - plant.drum_N[:, 1])
    answer = respond(Loop(mechanism=rig), MotorRun.of_one(motor[::5], 5e-3, 0.0), segments=8)
    assert answer.complete
    assert answer.slack
    off = np.abs(answer.held_N_m[:, 0] - felt[::5]).max() / np.ptp(felt)
    record_property("figure", f"push against a stop: {100 * off:.2g} % of the torque's range")
    assert off < 0.01
    assert answer.angle_rad.max() == pytest.approx(0.3, abs=0.01)
    assert answer.held_N_m.max() / ARM < 0.62 * ARM * STIFFNESS * 2  # the joint stands, and not the drum
