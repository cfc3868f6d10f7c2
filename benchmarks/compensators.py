"""Friction compensators on open measurements of a surgical tool, judged on files that none of them has seen.

    python benchmarks/compensators.py --data FOLDER

The input torque that a wanted output torque needs, predicted from output torque, input angle and their past; every
model is fitted on `FOLDER/identify` and judged on `FOLDER/validate`. `--upstream CLONE` makes FOLDER from the authors'
own files (`git clone https://github.com/MRDLab/mis-tool-characterization CLONE`; Medical Robotics and Devices Lab,
University of Minnesota, Open Database License 1.0). Needs scikit-learn: `pip install ".[yardstick]"`.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

Array = NDArray[np.float64]
FILES = {"identify": ("00", "06", "20", "26", "40", "46"), "validate": ("03", "09", "23", "29", "43", "49")}
START_S, CUTOFF_HZ, KEEP = 0.3, 10.0, 4
CENTRE_RAD, MID_STROKE_RAD = -0.524, 0.25


@dataclass(frozen=True, kw_only=True)
class Run:
    """File, filtered without phase lag, every fourth row.

    Attributes
    ----------
    input_N_m, output_N_m, angle_rad, speed_rad_per_s : ndarray
    """

    input_N_m: Array
    output_N_m: Array
    angle_rad: Array
    speed_rad_per_s: Array

    @classmethod
    def read(cls, file: Path) -> "Run":
        """Read a file: time, input torque, output torque, input angle."""
        t, into, out, angle = np.loadtxt(file, delimiter=",", skiprows=1, usecols=range(4)).T
        low_pass = butter(2, CUTOFF_HZ, fs=1 / np.median(np.diff(t)), output="sos")
        into, out, angle = (sosfiltfilt(low_pass, each) for each in (into, out, angle))
        speed = np.gradient(angle, t)
        rows = slice(int(np.searchsorted(t, START_S)), None, KEEP)
        return cls(input_N_m=into[rows], output_N_m=out[rows], angle_rad=angle[rows], speed_rad_per_s=speed[rows])


Law = Callable[[Array, Run], Array]


def bristle(slip: Array, stiffness: float, limit: float) -> Array:
    """A state that follows the slip and is held within +- limit: a play with stiffness."""
    found, state = np.empty(len(slip)), 0.0
    for k, step in enumerate(np.diff(slip, prepend=slip[0]) * stiffness):
        state = min(max(state + step, -limit), limit)
        found[k] = state
    return found


def none(_: Array, run: Run) -> Array:
    """The wanted torque itself."""
    return run.output_N_m


def smoothed(x: Array, run: Run) -> Array:
    """Coulomb friction with its sign change smoothed over the speed."""
    return x[0] * run.output_N_m + x[1] * np.tanh(run.speed_rad_per_s / abs(x[2])) + x[3]


def play(x: Array, run: Run) -> Array:
    """Friction of constant size with presliding: a play on the angle."""
    return x[0] * run.output_N_m + bristle(run.angle_rad, abs(x[1]), abs(x[2])) + x[3]


def capstan(x: Array, run: Run) -> Array:
    """The law of tendonff: T + p, times e to a play of half-width mu theta that gives way before it slips."""
    load = np.maximum(run.output_N_m + x[0], 1e-6)
    return load * np.exp(bristle(run.angle_rad, abs(x[1]), abs(x[2]))) - x[0] + x[3]


def bouc_wen(x: Array, run: Run) -> Array:
    """The hysteresis of Bouc and Wen on the angle, beside a gain, a spring and a constant."""
    z, state = np.empty(len(run.angle_rad)), 0.0
    limit, sharp = abs(x[2]) + 1e-6, 1 + abs(x[3])
    for k, step in enumerate(np.diff(run.angle_rad, prepend=run.angle_rad[0])):
        share = abs(state / limit) ** sharp
        state += step * abs(x[1]) * (1 - share * (0.5 + 0.5 * np.sign(step * state)))
        state = min(max(state, -limit), limit)
        z[k] = state
    return x[0] * run.output_N_m + z + x[4] * (run.angle_rad - CENTRE_RAD) + x[5]


LAWS: dict[str, tuple[Law, tuple[float, ...]]] = {
    "none": (none, ()),
    "tanh-smoothed": (smoothed, (1.0, 0.05, 0.05, 0.0)),
    "play": (play, (1.0, 3.0, 0.05, 0.0)),
    "Bouc-Wen": (bouc_wen, (1.0, 3.0, 0.05, 1.0, 0.0, 0.0)),
    "tendonff's law": (capstan, (0.12, 10.0, 0.35, -0.02)),
}


def fitted(law: Law, start: tuple[float, ...], runs: list[Run]) -> Callable[[Run], Array]:
    """The law with its least squares on all files."""
    x = np.array(start)
    if start:
        scale = np.maximum(np.abs(x), 0.02)
        x = least_squares(
            lambda x: np.concatenate([law(x, run) - run.input_N_m for run in runs]), x, x_scale=scale, max_nfev=60
        ).x
    return lambda run: law(x, run)


def sign_map(runs: list[Run]) -> Callable[[Run], Array]:
    """Friction looked up by joint position and direction, off in a deadband of speed, as industrial drives have it."""
    edges = np.linspace(-1.1, 0.05, 24)
    excess = np.concatenate([run.input_N_m - run.output_N_m for run in runs])
    angle, speed = (np.concatenate([getattr(run, n) for run in runs]) for n in ("angle_rad", "speed_rad_per_s"))
    place, fast = np.digitize(angle, edges), 0.02
    maps = {}
    for way in (1, -1):
        ahead = way * speed > fast
        whole = float(np.mean(excess[ahead]))
        bins = [excess[ahead & (place == k)] for k in range(len(edges) + 1)]
        maps[way] = np.array([np.mean(each) if len(each) > 5 else whole for each in bins])

    def predict(run: Run) -> Array:
        at = np.digitize(run.angle_rad, edges)
        both = (maps[1][at] + maps[-1][at]) / 2
        way = np.where(run.speed_rad_per_s > fast, maps[1][at], both)
        return run.output_N_m + np.where(run.speed_rad_per_s < -fast, maps[-1][at], way)

    return predict


def features(run: Run) -> Array:
    """Inputs of the network: torque, angle, speed, and angle and speed up to 0.3 s ago."""
    columns = [run.output_N_m, run.angle_rad, run.speed_rad_per_s]
    for lag in (2, 5, 15):
        past = np.maximum(np.arange(len(run.angle_rad)) - lag, 0)
        columns += [run.angle_rad - run.angle_rad[past], run.speed_rad_per_s[past]]
    return np.column_stack(columns)


def network(runs: list[Run]) -> Callable[[Run], Array]:
    """A small network, two layers of 16."""
    model = make_pipeline(
        StandardScaler(), MLPRegressor(hidden_layer_sizes=(16, 16), alpha=1e-3, max_iter=300, random_state=0)
    )
    scale = 0.1
    model.fit(np.vstack([features(run) for run in runs]), np.concatenate([run.input_N_m for run in runs]) / scale)
    return lambda run: scale * model.predict(features(run))


def read_upstream(file: Path) -> Array:
    """Time, input torque, output torque and input angle of an authors' file, from its counts."""
    t, angle, into, out = np.loadtxt(file, delimiter=",", comments="%", usecols=(0, 1, 2, 5)).T
    torque = 3.9811e-5  # N m a count
    return np.column_stack([t, torque * into, -torque * out, -2 * np.pi / 8192 * angle])


def convert(clone: Path, folder: Path) -> None:
    """Write the authors' files as FOLDER/identify and FOLDER/validate, every fifth row, in SI units."""
    for part, names in FILES.items():
        (folder / part).mkdir(parents=True, exist_ok=True)
        for name in names:
            source = clone / "data" / "Tool_4_Maryland_L_4" / f"{name}.TXT"
            rows = read_upstream(source)[::5]
            head = "time_s,input_torque_Nm,output_torque_Nm,input_angle_rad"
            np.savetxt(folder / part / f"tool4_{name}.csv", rows, "%.6g", ",", header=head, comments="")


def main() -> int:
    """Fit, judge, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with identify/ and validate/")
    parser.add_argument("--upstream", type=Path, help="clone of the authors' repository to make it from")
    options = parser.parse_args()
    if options.upstream:
        convert(options.upstream, options.data)
    runs = {part: [Run.read(file) for file in sorted((options.data / part).glob("*.csv"))] for part in FILES}
    if not all(runs.values()):
        print(f"{options.data} has no CSV files in identify/ and validate/; --upstream CLONE makes them")
        return 2
    models = {name: fitted(law, start, runs["identify"]) for name, (law, start) in LAWS.items()}
    models |= {"sign map with deadband": sign_map(runs["identify"]), "network": network(runs["identify"])}
    width = float(np.ptp(np.concatenate([run.input_N_m for run in runs["validate"]])))
    print("| compensator | files it was fitted on | unseen files | unseen, mid-stroke |\n|---|---|---|---|")
    rows = []
    for name, model in models.items():
        misses = {part: [model(run) - run.input_N_m for run in runs[part]] for part in FILES}
        middle = [np.abs(run.angle_rad - CENTRE_RAD) < MID_STROKE_RAD for run in runs["validate"]]
        inside = [miss[rows] for miss, rows in zip(misses["validate"], middle, strict=True)]
        errors = [misses["identify"], misses["validate"], inside]
        rows.append((name, [100 * float(np.sqrt(np.mean(np.concatenate(e) ** 2))) / width for e in errors]))
    for name, values in sorted(rows, key=lambda row: -row[1][1]):
        print(f"| {name} | {' | '.join(f'{value:.1f}' for value in values)} |")
    print(f"RMS error of the input torque, % of its range of {width:.3f} N m")
    return 0


if __name__ == "__main__":
    sys.exit(main())
