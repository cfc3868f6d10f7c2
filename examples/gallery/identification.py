"""Friction found in a log."""

import tempfile
from pathlib import Path

import numpy as np

import tendonff as tf

with tempfile.TemporaryDirectory() as folder:
    force = 45 + 38 * np.sin(np.linspace(0, 25, 2000)) * np.linspace(0.2, 1, 2000)
    output = tf.CapstanLaw(pull_exponent=0.45, release_exponent=0.4).output_history_N(force, 40.0)
    rows = np.column_stack([np.arange(2000) / 200, force, output + np.random.default_rng(0).normal(0, 0.1, 2000)])
    log = Path(folder, "log.csv")
    np.savetxt(log, rows, delimiter=",", header="time_s,input_tension_N,output_tension_N", comments="")
    figure = tf.identify(tf.load_scenario("examples/finger.toml"), [log], static_only=True).plot()
