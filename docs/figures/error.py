"""Cost of a wrong friction coefficient: one force profile on plants with other coefficients."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, GREY, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

FINGER = Path(__file__).resolve().parents[2] / "examples" / "finger.toml"
FACTORS = np.linspace(0.7, 1.3, 13)


def errors() -> dict[str, np.ndarray]:
    """RMS error [% of range] of the uncompensated and the inverse's force over `FACTORS` on mu."""
    scenario = load_scenario(FINGER)
    transmission, reference = scenario.transmission, sample_reference(scenario)
    start, step = reference.initial_tension_N, reference.step_s
    chain = Chain.of(transmission, Level.PRESLIDING)
    forces = {
        "no compensation": reference.tension_N,
        "exact inverse": invert(chain, reference.tension_N, step, initial_tension_N=start).force_N,
    }
    found: dict[str, list[float]] = {name: [] for name in forces}
    for factor in FACTORS:
        mu = transmission.friction.mu_dynamic * factor
        friction = replace(transmission.friction, mu_dynamic=mu, mu_static=mu)
        plant = Chain.of(replace(transmission, friction=friction), Level.PRESLIDING, segments=40)
        for name, force in forces.items():
            run = simulate(plant, force, step, initial_tension_N=start).require()
            error = run.output_tension_N - reference.tension_N
            found[name].append(float(100 * np.sqrt(np.mean(error**2)) / reference.range_N))
    return {name: np.array(values) for name, values in found.items()}


def draw() -> Figure:
    """Draw the figure."""
    found = errors()
    with figure_style():
        figure, axes = new_figure(height_in=3.2)
        panel = axes[0, 0]
        panel.plot(100 * (FACTORS - 1), found["no compensation"], ":", color=GREY, label="no compensation")
        panel.plot(100 * (FACTORS - 1), found["exact inverse"], "o-", color=BLUE, markersize=4, label="exact inverse")
        panel.axvspan(-10, 10, color=VERMILION, alpha=0.12, linewidth=0, label="mu known to 10 %")
        panel.set(
            xlabel="friction of the plant beside the model's [%]", ylabel="RMS error [% of range]", ylim=(0, None)
        )
        figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
