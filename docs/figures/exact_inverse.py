"""Number of masses of a design: the inverse with N masses, simulated on a chain of 160."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

FINGER = Path(__file__).resolve().parents[2] / "examples" / "finger.toml"
COUNTS = (1, 2, 3, 6, 12, 24)


def draw() -> Figure:
    """Draw the figure."""
    scenario = load_scenario(FINGER)
    transmission, reference = scenario.transmission, sample_reference(scenario)
    start, step = reference.initial_tension_N, reference.step_s
    plant = Chain.of(transmission, Level.PRESLIDING, segments=160)
    errors = []
    for count in COUNTS:
        chain = Chain.of(transmission, Level.PRESLIDING, segments=count)
        force = invert(chain, reference.tension_N, step, initial_tension_N=start).force_N
        error = simulate(plant, force, step, initial_tension_N=start).require().output_tension_N - reference.tension_N
        errors.append(100 * np.sqrt(np.mean(error**2)) / reference.range_N)
    with figure_style():
        figure, axes = new_figure(height_in=2.8)
        panel = axes[0, 0]
        panel.loglog(COUNTS, errors, "o-", color=BLUE)
        for count, error in zip(COUNTS, errors, strict=True):
            panel.annotate(f"{error:.2g} %", (count, error), textcoords="offset points", xytext=(6, 5), fontsize=8)
        panel.set(xlabel="masses of the design", ylabel="RMS error [% of range]", xticks=COUNTS, xticklabels=COUNTS)
        panel.set_xticks([], minor=True)
        panel.yaxis.set_major_formatter("{x:g}")
    return figure
