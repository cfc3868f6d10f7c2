"""A law of one's own against the capstan law, fitted to the same log and judged on its second half."""

import numpy as np
from scipy.optimize import least_squares

import tendonff as tf


def capstan(values: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """The play in logarithms with mu theta and load-independent friction."""
    law = tf.CapstanLaw(pull_exponent=values[0], release_exponent=values[0], adhesion_N=values[1])
    return law.output_history_N(tension, tension[0])


def offset(values: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """A law of one's own: a gain, and a play of constant width."""
    output, held = np.empty_like(tension), values[0] * tension[0]
    for k, x in enumerate(values[0] * tension):
        output[k] = held = min(max(held, x - values[1]), x + values[1])
    return output


scenario = tf.load_scenario("examples/finger.toml")
time = np.arange(0.0, 4.0, 2e-3)
force = 40 + 25 * np.sin(2 * np.pi * 0.8 * time) * np.minimum(time, 1) + 8 * np.sin(2 * np.pi * 2.1 * time)
run = tf.simulate(tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING), force, 2e-3, initial_tension_N=40.0)
log_in, log_out = run.tension_N[:, 0], run.output_tension_N
half = len(time) // 2
for law, first in ((capstan, (0.5, 0.5)), (offset, (0.7, 5.0))):
    fit = least_squares(lambda v, law=law: (law(v, log_in) - log_out)[:half], first, bounds=(0, np.inf), diff_step=1e-3)
    error = (law(fit.x, log_in) - log_out)[half:]
    print(f"{law.__name__:8} {fit.x.round(3)}: RMS error {100 * error.std() / np.ptp(log_out):.1f} % of range")
