"""The force that gives a tension, on a finer plant."""

import tendonff as tf

result = tf.design(tf.load_scenario("examples/finger.toml"), compensators=["none", "capstan", "inverse"])
figure = result.plot("tension")
