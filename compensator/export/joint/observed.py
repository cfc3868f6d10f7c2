"""Numbers of the exported observer of a joint: what its measured motor can do, and how long it may be lost."""

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.driven.joint import JointScenario

MOVES = 16
"""Steps of the model after the first one, in which an observed joint is found."""

STEP_RAD, SPEED, SPEED_OF_COURSE = 0.02, 1.5, 10.0
"""A measured motor may jump so far [rad] beside so many times its limit in speed, or that of the scenario's course."""

LOST_S = 0.1
"""Time without a good motor angle after which an observer starts again at rest."""


def observed_motor(scenario: JointScenario, angle_rad: FloatArray) -> tuple[float, float]:
    """Change of the joint's angle per radian of its motor, roughly, and the fastest motor that is believed [rad/s]."""
    mechanism, drive = scenario.mechanism, scenario.mechanism.drive
    observed = mechanism.drum_radius_m[0] / drive.gear_ratio / mechanism.arms_at(float(angle_rad[0]))[0]
    if drive.speed_max_rad_per_s is not None:
        return observed, SPEED * drive.speed_max_rad_per_s
    joint = float(np.abs(np.diff(angle_rad)).max(initial=0.0)) / scenario.run.step_s
    return observed, SPEED_OF_COURSE * joint / abs(observed)


def stiffness_N_m_per_rad(scenario: JointScenario, angle_rad: FloatArray) -> float:
    """Torque that turns the joint by a radian while its motors stand, without friction."""
    mechanism = scenario.mechanism
    arms = np.array(mechanism.arms_at(float(angle_rad[0])))
    tendons = np.array([each.tendon.stiffness_N_per_m for each in mechanism.tendons])
    return float(tendons @ arms**2) + mechanism.joint.stiffness_N_m_per_rad
