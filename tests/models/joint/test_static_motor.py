"""The quasi-static motor angle of a joint against the chains, turned slowly."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.joint.quasi_static import directions, static_motor_rad
from tendonff.ocp.joint.invert import invert_joint
from tendonff.ocp.joint.start import joint_problem
from tests.joint_rig import bent, heavier, mechanism, motion

STEP = 4e-3
TIME = np.arange(0.0, 6.0, STEP)
FADE = np.where(TIME < 1.5, np.sin(np.pi * TIME / 3) ** 2, 1.0)
ANGLE = FADE * 0.7 * np.sin(2 * np.pi * 0.4 * TIME)


@pytest.mark.compiler
@pytest.mark.parametrize("kind", [DriveKind.LOOP, DriveKind.PAIR])
@pytest.mark.parametrize("change", [lambda rig: rig, bent, lambda rig: heavier(rig, 0.25)])
def test_away_from_reversals_the_chains_want_the_same_motor_angle(change, kind: DriveKind) -> None:
    """The third case goes through slack."""
    rig: Mechanism = change(mechanism(kind, 15.0 if kind is DriveKind.LOOP else 3.0, segments=24))
    light = replace(rig, joints=(replace(rig.joint, damping_N_m_s_per_rad=0.0, stiffness_N_m_per_rad=0.02),))
    given = joint_problem(light, Level.ELASTIC, motion(ANGLE, TIME))
    exact = invert_joint(given, ANGLE, STEP).motor_rad
    static = static_motor_rad(light, ANGLE, light.joint.static_torque_N_m(ANGLE))
    ways = directions(ANGLE)
    turned = np.convolve(np.abs(np.gradient(ways)) > 0, np.ones(81), "same") > 0  # within 0.16 s of a reversal
    settled = ~turned & (TIME > 0.5)
    assert settled.mean() > 0.6
    assert np.rad2deg(np.abs(exact - static)[settled].max()) < 0.03
    assert np.rad2deg(np.abs(static - ANGLE[:, None]).max()) > 0.5
    assert np.abs(static[0]).max() < 1e-12  # at rest the motor stands where it was tensioned


def test_a_way_is_kept_while_the_joint_stands() -> None:
    assert directions(np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 1.0])).tolist() == [0, 0, 1, 1, 1, 1, -1, -1]
