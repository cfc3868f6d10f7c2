"""The play law beside the simulated chain: over time, and as a loop in logarithmic coordinates."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate

FINGER = Path(__file__).resolve().parents[2] / "examples" / "finger.toml"
STEP_S = 0.005


def draw() -> Figure:
    """Draw the figure."""
    transmission = load_scenario(FINGER).transmission
    time = np.arange(0.0, 20.0 + STEP_S, STEP_S)
    force = 60 * np.exp(0.06 * time * np.sin(2 * np.pi * time / 4))
    output = simulate(Chain.of(transmission, Level.ELASTIC, segments=40), force, STEP_S).require().output_tension_N
    law = CapstanLaw.of(transmission).output_history_N(force)
    some = slice(None, None, 20)
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=3.0)
        over_time, loop = axes[0]
        over_time.plot(time[some], force[some], color=INK, linewidth=0.8, label="input")
        over_time.plot(time[some], output[some], color=BLUE, linewidth=2.6, label="output, simulated chain")
        over_time.plot(time[some], law[some], "--", color=VERMILION, label="output, play law (on the curve below)")
        over_time.set(xlabel="time [s]", ylabel="tension [N]")
        loop.plot(np.log(force[some]), np.log(output[some]), color=BLUE, linewidth=2.6)
        loop.plot(np.log(force[some]), np.log(law[some]), "--", color=VERMILION)
        loop.set(xlabel="ln input tension / N", ylabel="ln output tension / N", aspect="equal")
        figure.legend(*over_time.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
