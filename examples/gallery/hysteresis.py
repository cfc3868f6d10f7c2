"""Hysteresis of three wrap angles."""

import matplotlib.pyplot as plt
import numpy as np

import tendonff as tf

force = 45 + 38 * np.sin(np.linspace(0, 25, 2000)) * np.linspace(0.2, 1, 2000)
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for theta in (0.8, 1.6, 3.1):
    law = tf.CapstanLaw(pull_exponent=0.15 * theta, release_exponent=0.15 * theta)
    axes.plot(force, law.output_history_N(force, 40.0), label=f"wrap angle {theta} rad")
axes.set(xlabel="input tension [N]", ylabel="output tension [N]")
axes.legend()
