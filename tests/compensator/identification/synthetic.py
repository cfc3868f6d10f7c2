"""Synthetic measurements: a chain with known parameters, noisy cells and a faulty logger.

Identification must find the parameters again.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import write_text
from tendonff.compensator.identification.measured import Array
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """What the measurement adds to the truth.

    Parameters
    ----------
    noise : float
        White noise of every channel, standard deviation as a share of the channel's range.
    input_offset_N, output_offset_N : float
        What the cells read at zero tension.
    spikes : int
        Single-sample spikes in every channel.
    gaps_s : tuple of float
        Lengths of gaps, spread over the record.
    missing : int
        Rows with an empty cell.
    seed : int
    """

    noise: float = 0.005
    input_offset_N: float = 0.0
    output_offset_N: float = 0.0
    spikes: int = 0
    gaps_s: tuple[float, ...] = ()
    missing: int = 0
    seed: int = 0


DIRTY = Faults(spikes=8, gaps_s=(0.4, 0.005), missing=2)


def write_synthetic(
    path: Path,
    transmission: Transmission,
    time_s: Array,
    force_N: Array,
    faults: Faults,
    *,
    level: Level = Level.PRESLIDING,
    masses: int = 40,
    step_s: float = 1e-3,
    positions: bool = True,
) -> None:
    """Simulate a force and write what would have been measured.

    Parameters
    ----------
    path : Path
        CSV file of the measurement contract.
    transmission : Transmission
        The truth.
    time_s, force_N : ndarray, shape (n,)
        Actuator force, piecewise linear, from 0.
    faults : Faults
    level : Level, optional
    masses : int, optional
        Number of masses of the truth.
    step_s : float, optional
        Sampling step; the simulation takes half of it.
    positions : bool, optional
        Write the positions of both ends as well.
    """
    half = np.arange(int(time_s[-1] / step_s + 1e-6) * 2 + 1) * (step_s / 2)
    run = simulate(Chain.of(transmission, level, masses), np.interp(half, time_s, force_N), step_s / 2).require()
    channels = [
        run.tension_N[::2, 0] + faults.input_offset_N,
        run.tension_N[::2, -1] + faults.output_offset_N,
        *([run.near_position_m[::2], run.far_position_m[::2]] if positions else []),
    ]
    rng = np.random.default_rng(faults.seed)
    rows = len(channels[0])
    columns = [half[::2]]
    for clean in channels:
        span = float(np.ptp(clean))
        read = clean + faults.noise * span * rng.standard_normal(rows)
        hit = rng.integers(0, rows, faults.spikes)
        read[hit] += rng.choice([-1.0, 1.0], faults.spikes) * span * rng.uniform(0.3, 1, faults.spikes)
        columns.append(read)
    keep = np.ones(rows, dtype=bool)
    for number, gap in enumerate(faults.gaps_s):
        start = int(rows * (number + 0.62) / (len(faults.gaps_s) + 0.31))
        keep[start : start + max(1, round(gap / step_s))] = False
    table = np.column_stack(columns)
    table[rng.integers(0, rows, faults.missing), 1] = np.nan
    names = ["time_s", "input_tension_N", "output_tension_N", "input_position_m", "output_position_m"][: table.shape[1]]
    lines = [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in table[keep].tolist()]
    write_text(path, "\n".join([",".join(names), *lines]) + "\n")
