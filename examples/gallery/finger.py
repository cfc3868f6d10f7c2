"""Motor angles of a finger, one call a sample."""

import matplotlib.pyplot as plt
import numpy as np

import tendonff as tf

finger = tf.Runtime("examples/three_joint_finger.toml")
time = np.arange(0.0, 2.0, 0.002)
bend = 0.5 + 0.4 * np.sin(2 * np.pi * time) * np.minimum(time, 1)
motors = np.array([finger.step({"mcp": q, "pip": 0.8 * q, "dip": 0.5 * q}) for q in bend])
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
axes.plot(
    np.degrees(bend[500:]), np.degrees(motors[500:] - motors[500]), label=["motor 1", "motor 2", "motor 3", "motor 4"]
)
axes.set(xlabel="knuckle [deg]", ylabel="motors [deg]")
axes.legend()
