"""Effects of the chain beyond the capstan law: presliding and stress relaxation."""

import casadi as ca
import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.models.tendon.friction import LuGreBristle
from tendonff.models.tendon.link import ZenerLink

NORMAL_N, MU = 50.0, 0.2


def loop(stiffness_N_per_m: float, path_m: np.ndarray) -> np.ndarray:
    """Bristle force along a path at constant normal force, by the packages' own law [N]."""
    bristle = LuGreBristle(
        bristle_stiffness_N_per_m=stiffness_N_per_m,
        mu_dynamic_pull=MU,
        mu_static_pull=MU,
        mu_dynamic_release=MU,
        mu_static_release=MU,
        stribeck_velocity_m_per_s=1.0,
        viscous_N_s_per_m=0.0,
    )
    v, f_s = ca.SX.sym("v"), ca.SX.sym("f_s")
    rate = ca.Function("rate", [v, f_s], list(bristle.rate(v, (f_s,), ca.SX(NORMAL_N))))
    force = np.zeros_like(path_m)
    for k, step in enumerate(np.diff(path_m)):
        force[k + 1] = force[k] + float(rate(step, force[k]))
    return force


def relaxation(link: ZenerLink, time_s: np.ndarray, elongation_m: float) -> np.ndarray:
    """Tension at held elongation, by the packages' own law [N]."""
    e, z = ca.SX(elongation_m), ca.SX.sym("z")
    rate = ca.Function("rate", [z], list(link.rate(e, (z,))))
    force = ca.Function("force", [z], [link.unclipped_force(e, ca.SX(0), (z,))])
    damper, tension = 0.0, np.zeros_like(time_s)
    for k, step in enumerate(np.diff(time_s, append=time_s[-1])):
        tension[k] = float(force(damper))
        damper += step * float(rate(damper))
    return tension


def draw() -> Figure:
    """Draw the figure."""
    path = 1e-3 * np.concatenate([np.linspace(0, 1, 400), np.linspace(1, -0.5, 600), np.linspace(-0.5, 1, 600)])
    link = ZenerLink(
        stiffness_N_per_m=2e4, relaxing_stiffness_N_per_m=6e3, relaxation_time_s=0.4, damping_N_s_per_m=0.0
    )
    time = np.linspace(0, 2, 401)
    tension = relaxation(link, time, 2e-3)
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=3.0)
        slide, hold = axes[0]
        for stiffness, colour, style in ((2e5, VERMILION, "--"), (5e4, BLUE, "-")):
            slide.plot(
                1e3 * path,
                loop(stiffness, path),
                style,
                color=colour,
                label=f"bristle stiffness {1e-3 * stiffness:.0f} N/mm",
            )
        slide.axhline(MU * NORMAL_N, color=INK, linewidth=0.6)
        slide.axhline(-MU * NORMAL_N, color=INK, linewidth=0.6)
        slide.set(xlabel="displacement [mm]", ylabel="bristle force [N]", title="Presliding")
        hold.plot(time, tension, color=BLUE)
        hold.axhline(tension[0], color=INK, linewidth=0.6)
        hold.axhline(40.0, color=INK, linewidth=0.6)
        hold.set(xlabel="time at held elongation [s]", ylabel="tension [N]", title="Stress relaxation", ylim=(36, 54))
        figure.legend(*slide.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure
