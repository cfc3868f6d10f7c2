"""A log format of one's own: frames of a data logger, read and handed over as columns with units in their names."""

import struct
import tempfile
from pathlib import Path

import numpy as np

import tendonff as tf

FRAME = struct.Struct("<Ihh")  # microseconds, both cells in hundredths of a newton


def convert(source: Path, target: Path) -> Path:
    """Write the frames of a logger as the CSV that `identify` reads."""
    rows = np.array(list(FRAME.iter_unpack(source.read_bytes()))) * (1e-6, 0.01, 0.01)
    np.savetxt(target, rows, "%.6g", ",", header="time_s,input_tension_N,output_tension_N", comments="")
    return target


with tempfile.TemporaryDirectory() as folder:
    time = np.arange(0.0, 4.0, 0.02)
    force = 40 + 25 * np.sin(2 * np.pi * 0.5 * time)
    law = tf.CapstanLaw(pull_exponent=0.6, release_exponent=0.6)
    frames = zip(1e6 * time, 100 * force, 100 * law.output_history_N(force, 30.0), strict=True)
    Path(folder, "log.bin").write_bytes(b"".join(FRAME.pack(*map(round, frame)) for frame in frames))
    log = convert(Path(folder, "log.bin"), Path(folder, "log.csv"))
    found = tf.identify(tf.load_scenario("examples/finger.toml"), [log], static_only=True)
    print(f"mu theta {found.estimate('mu_theta').value:.3f}")
