"""The inverted capstan law: its jumps, what an actuator makes of them, and what is left."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.smoothed import Smoothed
from tendonff.compensator.reporting.colours import BLUE, GREY, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.limits import ForceLimits

FINGER = Path(__file__).resolve().parents[2] / "examples" / "finger.toml"


def draw() -> Figure:
    """Draw the figure."""
    scenario = load_scenario(FINGER)
    transmission, reference = scenario.transmission, sample_reference(scenario)
    law, chain = CapstanLaw.of(transmission), Chain.of(transmission, Level.PRESLIDING)
    jumping = law.input_history_N(reference.tension_N, reference.initial_tension_N)
    limits = replace(ForceLimits.of(transmission.actuator), rate_N_per_s=500.0)

    def output(force: np.ndarray) -> np.ndarray:
        return simulate(chain, force, reference.step_s, initial_tension_N=reference.initial_tension_N).output_tension_N

    def rms(force: np.ndarray) -> float:
        return float(100 * np.sqrt(np.mean((output(force) - reference.tension_N) ** 2)) / reference.range_N)

    best = Smoothed().profile(Problem.of(scenario)).force_N
    forces = {
        "reference as force": (reference.tension_N, GREY, ":"),
        "inverted law, jumping": (jumping, VERMILION, "-"),
        "the same, at most 500 N/s": (
            limits.apply(jumping, reference.step_s, reference.initial_tension_N),
            ORANGE,
            "--",
        ),
        "sign smoothed at best": (best, BLUE, "-."),
    }
    some = slice(None, None, 4)
    with figure_style():
        figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
        for label, (force, colour, style) in forces.items():
            error = output(force) - reference.tension_N
            axes[0, 0].plot(reference.time_s[some], force[some], style, color=colour)
            axes[1, 0].plot(
                reference.time_s[some],
                error[some],
                style,
                color=colour,
                label=f"{label}: {rms(force):.1f} % of range RMS",
            )
        axes[0, 0].set(ylabel="force [N]")
        axes[1, 0].set(xlabel="time [s]", ylabel="tension error [N]")
        figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
