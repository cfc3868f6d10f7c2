"""The certified interval: two plays bracket the output tension of a tendon whose friction is known within bounds."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, INK, ORANGE
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.adaptation.bounds import CertifiedInterval

NOMINAL, HALF_WIDTH = 0.628, 0.126


def draw() -> Figure:
    """Draw the figure."""
    time = np.linspace(0, 8, 801)
    force = 45 + 20 * np.sin(2 * np.pi * 0.4 * time) + 10 * np.sin(2 * np.pi * 0.9 * time)

    def output(exponent: float) -> np.ndarray:
        return CapstanLaw(pull_exponent=exponent, release_exponent=exponent).output_history_N(force)

    law = CapstanLaw(pull_exponent=NOMINAL, release_exponent=NOMINAL)
    low, high = CertifiedInterval(law=law, spread=HALF_WIDTH / NOMINAL, noise_N=0.0).history_N(force)
    with figure_style():
        figure, axes = new_figure(height_in=3.0)
        panel = axes[0, 0]
        panel.fill_between(
            time,
            low,
            high,
            color=ORANGE,
            alpha=0.3,
            linewidth=0,
            label="certified interval, friction known to 20 %",
        )
        for share in (-0.8, 0.1, 0.9):
            panel.plot(time, output(NOMINAL + share * HALF_WIDTH), color=BLUE, linewidth=1.0, label="plants within")
        panel.plot(time, force, ":", color=INK, linewidth=0.8, label="actuator force")
        panel.set(xlabel="time [s]", ylabel="tension [N]")
        handles, labels = panel.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=3)
    return figure
