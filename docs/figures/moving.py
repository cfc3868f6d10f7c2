"""Errors on a finger whose joints move: what a design must know of the motion, measured on a finer chain."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tendonff as tf
from tendonff.compensator.reporting.colours import BLUE, GREY, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.sampled.joint_motion import moved

SCENARIO = Path(__file__).resolve().parents[2] / "examples" / "finger_moving.toml"
PLANT_MASSES = 60


def outputs() -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Time, reference and the output tension on 60 masses of each design."""
    scenario = tf.load_scenario(SCENARIO)
    reference = tf.sample_reference(scenario)
    wanted, step, start = reference.tension_N, reference.step_s, reference.initial_tension_N
    moving = moved(scenario, float(reference.time_s[-1]))
    sections = tuple(replace(section, length_per_rad_m=0.0) for section in moving.path.sections)
    angles_only = replace(moving, path=replace(moving.path, sections=sections))
    plant = tf.Chain.of(moving, scenario.run.level, PLANT_MASSES)

    def force(chain: tf.Chain) -> np.ndarray:
        return tf.invert(chain, wanted, step, initial_tension_N=start).force_N

    def chain(transmission: tf.Transmission, masses: int = 12) -> tf.Chain:
        return tf.Chain.of(transmission, scenario.run.level, masses)

    forces = {"none": wanted, "at rest": force(chain(moving).at_rest()), "angles only": force(chain(angles_only))}
    forces |= {f"{n} masses": force(chain(moving, n)) for n in (6, 12, 24)}
    found = {
        name: tf.simulate(plant, each, step, initial_tension_N=start).output_tension_N for name, each in forces.items()
    }
    return reference.time_s, wanted, found


def errors_percent() -> dict[str, float]:
    """RMS error of each design, % of the reference's range: the table of the page."""
    _, wanted, found = outputs()
    return {
        name: float(100 * np.sqrt(np.mean((output - wanted) ** 2)) / np.ptp(wanted)) for name, output in found.items()
    }


def draw() -> Figure:
    """Draw the figure."""
    time, wanted, found = outputs()
    scenario = tf.load_scenario(SCENARIO)
    motion = moved(scenario, float(time[-1])).motion
    with figure_style():
        figure, axes = new_figure(3, 1, height_in=5.4, share_x=True)
        joints, tension, error = axes[:, 0]
        for name, angle, style in zip(motion.names, motion.at(time).T, ("-", "--"), strict=True):
            joints.plot(time, angle, style, color=GREY, label=name)
        joints.set(ylabel="joint angle [rad]")
        joints.set_ylim(-0.75, 1.0)
        joints.legend(loc="upper right", ncols=2)
        looks = {"none": (GREY, ":"), "at rest": (VERMILION, "--"), "12 masses": (BLUE, "-")}
        names = {"none": "no compensation", "at rest": "designed for the path at rest", "12 masses": "motion known"}
        for name, (colour, style) in looks.items():
            tension.plot(time, found[name], style, color=colour, label=names[name])
            error.plot(time, found[name] - wanted, style, color=colour)
        tension.plot(time, wanted, color="black", linewidth=0.8, label="reference")
        tension.set(ylabel="output tension [N]")
        error.set(ylabel="error [N]", xlabel="time [s]")
        figure.legend(*tension.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
