"""Feedback gains and their margins beside the feedforward of a joint."""

from dataclasses import replace

import tendonff as tf
from tendonff.compensator.scenario.settings import Feedback

loop = Feedback(sensor="joint_angle", delay_s=0.010, sample_s=0.005, resolution=0.0015)
scenario = replace(tf.load_scenario("examples/hand_joint.toml"), feedback=loop)
result = tf.design(scenario)
figure = result.plot("feedback_loop")
