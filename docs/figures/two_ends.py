"""Tension along the path between the cones from both ends."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, GREY, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan.two_ended import TwoEndedLaw
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import Simulator

FINGER = Path(__file__).resolve().parents[2] / "examples" / "finger.toml"
STEP_S = 0.002


def profiles() -> tuple[np.ndarray, np.ndarray]:
    """Tension along the chain after the actuator pulled, and after the load's rest position was then drawn away [N].

    Returns
    -------
    pulled, drawn : ndarray, shape (41,)
    """
    finger = load_scenario(FINGER).transmission
    stiff = replace(
        finger, friction=replace(finger.friction, bristle_stiffness_N_per_m=3e7)
    )  # the law has no presliding
    chain = Chain.of(stiff, Level.ELASTIC, segments=40)
    run = Simulator(chain, STEP_S, chain.rest_state(30.0), ChainInputs.of(1, near_force_N=30.0))
    rows = np.arange(1, 1001) / 1000
    pulled = run.advance(ChainInputs.of(1000, near_force_N=30 + 15 * rows), record=True)
    drawn = run.advance(ChainInputs.of(1000, near_force_N=45.0, far_rest_m=-0.006 * rows), record=True)
    return pulled.tension_N[-1], drawn.tension_N[-1]


def draw() -> Figure:
    """Draw the figure."""
    transmission = load_scenario(FINGER).transmission
    mu, theta = transmission.friction.mu_dynamic, transmission.path.total_angle_rad
    pulled, drawn = profiles()
    law = np.log(TwoEndedLaw.of(transmission, pulled.size - 1).profile_N(pulled, drawn[0], drawn[-1]))
    pulled, drawn = np.log(pulled), np.log(drawn)
    angle = np.linspace(0, theta, pulled.size)
    low = np.maximum(drawn[0] - mu * angle, drawn[-1] - mu * (theta - angle))
    high = np.minimum(drawn[0] + mu * angle, drawn[-1] + mu * (theta - angle))
    with figure_style():
        figure, axes = new_figure(height_in=3.2)
        panel = axes[0, 0]
        panel.fill_between(angle, low, high, color=ORANGE, alpha=0.2, label="between the cones from both ends")
        panel.plot(angle, pulled, color=GREY, label="left by pulling at the actuator")
        panel.plot(angle, law, "--", color=VERMILION, label="law, after the far end acted")
        panel.plot(angle, drawn, "o", color=BLUE, markersize=3, label="simulated chain")
        panel.set(xlabel="wrap angle from the actuator [rad]", ylabel="ln tension / N")
        figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
