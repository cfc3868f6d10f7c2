"""A joint between two tendons: ratio alone against the exact inverse."""

import tendonff as tf

result = tf.design(tf.load_scenario("examples/hand_joint.toml"))
figure = result.plot("joint")
