"""A reversal where the rate limit binds: the clipped inverse and the optimal profile."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.limits import ForceLimits

FAST = Path(__file__).resolve().parents[2] / "examples" / "finger_fast.toml"


def draw() -> Figure:
    """Draw the figure."""
    scenario = load_scenario(FAST)
    transmission, reference = scenario.transmission, sample_reference(scenario)
    chain, limits = Chain.of(transmission, scenario.run.level), ForceLimits.of(transmission.actuator)
    start, step = reference.initial_tension_N, reference.step_s
    clipped = limits.apply(invert(chain, reference.tension_N, step, initial_tension_N=start).force_N, step, start)
    best = track(chain, reference.tension_N, step, limits, initial_tension_N=start).force_N
    some = slice(None, None, 4)
    time = reference.time_s
    with figure_style():
        figure, axes = new_figure(3, 1, share_x=True, height_in=5.4)
        applied, rate, left = axes[:, 0]
        for name, force, colour, style in (
            ("inverse, clipped", clipped, BLUE, "-"),
            ("optimal", best, VERMILION, "--"),
        ):
            run = simulate(chain, force, step, initial_tension_N=start).require()
            error = run.output_tension_N - reference.tension_N
            share = 100 * np.sqrt(np.mean(error**2)) / reference.range_N
            label = f"{name}: {share:.2g} % of range RMS"
            applied.plot(time[some], force[some], style, color=colour, label=label)
            rate.plot(time[some], np.gradient(force, step)[some], style, color=colour)
            left.plot(time[some], error[some], style, color=colour)
        for bound in (-limits.rate_N_per_s, limits.rate_N_per_s):
            rate.axhline(bound, color=INK, linewidth=0.8, linestyle=(0, (6, 3)))
        applied.set(ylabel="force [N]")
        rate.set(ylabel="force rate [N/s]")
        left.set(xlabel="time [s]", ylabel="tension error [N]")
        figure.legend(*applied.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
