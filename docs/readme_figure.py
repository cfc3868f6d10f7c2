"""The figure of the README: what arrives at the fingertip, with and without compensation.

python docs/readme_figure.py docs/finger.png
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

import tendonff as tf

SHOWN = {"none": ("reference applied directly", "C1", "--"), "inverse": ("tendonff feedforward", "#7ab8e0", "-")}


def draw(result: tf.Design, target: str) -> None:
    """Draw force and tension for a design.

    Parameters
    ----------
    result : Design
    target : str
        PNG file.
    """
    time = result.reference.time_s
    figure, (force, tension) = plt.subplots(1, 2, figsize=(9, 3.3), layout="constrained")
    for simulated in result.proof:
        if simulated.compensator in SHOWN:
            label, colour, style = SHOWN[simulated.compensator]
            force.plot(time, result.profiles[simulated.compensator].force_N, style, color=colour, label=label)
            tension.plot(time, simulated.output_N, style, color=colour, linewidth=4)
    tension.plot(time, result.reference.tension_N, color="black", linewidth=0.9, label="reference")
    force.set(xlabel="time [s]", ylabel="actuator force [N]", title="Actuator force")
    tension.set(xlabel="time [s]", ylabel="tension at the fingertip [N]", title="Output tension (black: reference)")
    figure.legend(*force.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.savefig(target, dpi=150)


if __name__ == "__main__":
    draw(tf.design(tf.load_scenario(Path(__file__).parents[1] / "examples" / "finger.toml")), sys.argv[1])
