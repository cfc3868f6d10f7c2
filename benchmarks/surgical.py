"""Jaw of a surgical grasper from the motor's side: `python -m benchmarks.surgical FOLDER [FIGURE.svg]`.

FOLDER is davinci_tool4 with its parts identify and validate. Laws are fitted on the first; raw samples of both then go
through the laws of the observer: of the torque from 0.3 s on, where the load has been switched on, of the angle from
there and from random instants on.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.motors.sensor import SensorFit, fit_sensor
from tendonff.compensator.identification.motors.torque import TorqueFit, fit_torque
from tendonff.compensator.reporting.colours import INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario

ONSET_S, LATE_S, LOW_PASS_HZ = 0.3, 1.0, 5.0
STARTS, STARTS_WITHIN = 20, 0.6
HOW = Measurement(
    input_column="input_torque_Nm",
    output_column="output_torque_Nm",
    input_position_column="input_angle_rad",
    output_position_column="output_angle_rad",
)
SHOWN = {"tool4_03": "0.1 Hz, 40 % load", "tool4_23": "0.3 Hz, 40 % load", "tool4_49": "0.5 Hz, full load"}
EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "hand_joint.toml"

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]


def observed(fit: TorqueFit, file: Path, low_pass_Hz: float | None = None) -> Rows:
    """Time, measured torque and that by the law [s, N m, N m]."""
    data = np.genfromtxt(file, delimiter=",", names=True)
    data = data[data["time_s"] > ONSET_S]
    torque = data["input_torque_Nm"]
    if low_pass_Hz is not None:
        rate = 1 / float(np.median(np.diff(data["time_s"])))
        b, a = butter(1, 2 * low_pass_Hz / rate)
        torque = lfilter(b, a, torque - torque[0]) + torque[0]
    return data["time_s"], data["output_torque_Nm"], fit.law.torque(data["input_angle_rad"], torque)


def draw(fit: TorqueFit, folder: Path, target: Path) -> None:
    """Save the figure of some unseen files."""
    band = 1e3 * (fit.band_N_m or 0.0)
    with figure_style():
        figure, axes = new_figure(1, len(SHOWN), height_in=2.6)
        for panel, (name, title) in zip(axes[0], SHOWN.items(), strict=True):
            time, there, law = (x[::20] for x in observed(fit, folder / "validate" / f"{name}.csv"))
            panel.fill_between(time, 1e3 * law - band, 1e3 * law + band, color=VERMILION, alpha=0.2, linewidth=0)
            panel.plot(time, 1e3 * there, color=INK, label="measured at the jaw")
            panel.plot(time, 1e3 * law, color=VERMILION, linestyle="--", label="from the motor, with 95 % band")
            panel.set_title(title)
            panel.set(xlabel="time [s]", ylim=(1e3 * there.min() - 3 * band, 1e3 * there.max() + 3 * band))
        axes[0, 0].set_ylabel("torque [mN m]")
        legend_below(figure, axes[0, 0])
        figure.savefig(target, metadata={"Date": None} if target.suffix == ".svg" else None)


def print_angles(fit: SensorFit, file: Path) -> None:
    """Error of the angle in raw samples from instants on, and how many the interval holds."""
    data = np.genfromtxt(file, delimiter=",", names=True)
    first = int(np.argmax(data["time_s"] > ONSET_S))
    draw = np.random.default_rng(1).integers(first, int(STARTS_WITHIN * len(data)), STARTS)
    found = []
    for start in (first, *draw.tolist()):
        rows = data[start:]
        sensed, there = fit.sensor.follow(rows["input_angle_rad"], rows["input_torque_Nm"]), rows["output_angle_rad"]
        inside = (sensed.low_rad - fit.band_rad <= there) & (there <= sensed.high_rad + fit.band_rad)
        error = np.degrees(sensed.angle_rad - there)
        found.append(
            (
                np.sqrt(np.mean(error**2)),
                100 * np.mean(inside),
                100 * np.mean(np.abs(error) <= np.degrees(fit.band_rad)),
            )
        )
    onset, random = found[0], np.array(found[1:])
    mean, least, worst = random.mean(axis=0), random.min(axis=0), random[:, 0].max()
    print(
        f"  {file.stem}: from {ONSET_S} s {onset[0]:.2f} deg, {onset[1]:.0f} % inside; {STARTS} random starts "
        f"{mean[0]:.2f} deg (worst {worst:.2f}), {mean[1]:.0f} % inside (least {least[1]:.0f}), without the range over "
        f"histories {mean[2]:.0f} (least {least[2]:.0f})"
    )


def main(folder: Path, target: Path | None) -> None:
    """Print the errors, and draw them."""
    scenario = load_scenario(EXAMPLE)
    files = {part: sorted((folder / part).glob("*.csv")) for part in ("identify", "validate")}
    seen, unseen = (read_logs(scenario, files[part], HOW) for part in ("identify", "validate"))
    fit = fit_torque(seen, unseen)
    for estimate in fit.estimates:
        low, high = estimate.interval or (np.nan, np.nan)
        print(f"{estimate.name} = {estimate.value:.4g} ({low:.4g} to {high:.4g})")
    for part, every in files.items():
        for low_pass in (None, LOW_PASS_HZ):
            rows = [observed(fit, file, low_pass) for file in every]
            errors = [law - there for _, there, law in rows]
            late = [error[time > LATE_S] for error, (time, _, _) in zip(errors, rows, strict=True)]
            inside = [100 * float(np.mean(np.abs(e) <= (fit.band_N_m or 0.0))) for e in errors]
            span = 1e3 * float(np.ptp(np.concatenate([there for _, there, _ in rows])))
            whole, after = (1e3 * float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for e in (errors, late))
            shares = ", ".join(f"{f.stem} {x:.0f} %" for f, x in zip(every, inside, strict=True))
            print(
                f"{part}, low-pass {low_pass or 'none'}: RMS {whole:.2f} mN m ({100 * whole / span:.1f} % of range), "
                f"after {LATE_S:g} s {after:.2f}; inside the band {shares}"
            )
    for count in (len(seen), 3):
        angle = fit_sensor(seen[:count], unseen, fit_torque(seen[:count], ()).largest_exponents)
        print(f"angle, {count} files fitted, exponents {'bounded' if angle.bounded else 'free'}: {angle.sentence}")
        for file in (*files["identify"], *files["validate"]):
            print_angles(angle, file)
    if target is not None:
        draw(fit, folder, target)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
