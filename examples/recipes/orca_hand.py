"""An ORCA hand whose joint follows the exact inverse instead of the ratio; needs orca-core.

    python examples/recipes/orca_hand.py SCENARIO.toml JOINT

The scenario describes the joint's two tendons. Motor angles count from where the motor stands at the start, with the
joint where the scenario's reference starts. With [feedback] the hand needs encoders at its joints.
"""

import math
import sys
import time
from collections.abc import Iterable
from typing import Any, cast

import tendonff as tf


def follow(hand: Any, joint: str, runtime: tf.Runtime, angles_rad: Iterable[float], period_s: float = 0.01) -> None:
    """Command one motor of a connected `OrcaHand` so that its joint follows angles [rad]."""
    motor = hand.config.joint_to_motor_map[joint]
    sign = -1 if hand.config.joint_inversion_dict.get(joint, False) else 1
    home, last = hand.get_motor_pos(as_dict=True)[motor], time.monotonic() - period_s
    for angle in angles_rad:
        now = time.monotonic()
        hand.write_motor_pos([motor], [home + sign * runtime.step(angle, dt=now - last)])
        last = now
        time.sleep(max(0.0, now + period_s - time.monotonic()))


def follow_with_feedback(
    hand: Any, joint: str, runtime: tf.Runtime, angles_rad: Iterable[float], period_s: float = 0.01
) -> None:
    """The same of a connected `OrcaHandJointFeedback` and a scenario with [feedback].

    The hand's own loop keeps running, with gains of zero for this joint: its target is what the runtime commands, in
    degrees by the calibrated ratio.
    """
    hand.set_pid_gains(Kp={joint: 0.0}, Ki={joint: 0.0})
    ratio = hand.calibration.joint_to_motor_ratios_dict[hand.config.joint_to_motor_map[joint]]  # rad per degree
    home, last = hand.get_measured_joints()[joint], time.monotonic() - period_s
    for angle in angles_rad:
        now = time.monotonic()
        measured = runtime.start + math.radians(hand.get_measured_joints()[joint] - home)
        hand.set_joint_positions({joint: home + runtime.step(angle, dt=now - last, measured=measured) / ratio})
        last = now
        time.sleep(max(0.0, now + period_s - time.monotonic()))


if __name__ == "__main__":
    from orca_core import OrcaHand, OrcaHandJointFeedback

    from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint

    scenario = cast("JointScenario", tf.load_scenario(sys.argv[1]))
    hand = OrcaHand() if scenario.feedback is None else OrcaHandJointFeedback()
    hand.connect()
    followed = follow if scenario.feedback is None else follow_with_feedback
    followed(hand, sys.argv[2], tf.Runtime(scenario), sample_joint(scenario).angle_rad, scenario.run.step_s)
