"""The figure of a centreline: points and sections, and the angle turned along the path."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.identification.measured.centreline.result import CentrelineData
from tendonff.compensator.reporting.colours import BLUE, GREY, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure


def centreline_figure(result: CentrelineData) -> Figure:
    """Points and sections in the plane that shows most of them; angle turned over length, with its interval."""
    middle = result.points_m.mean(axis=0)
    plane = np.linalg.svd(result.points_m - middle, full_matrices=False)[2][:2].T
    points, curve = ((each - middle) @ plane for each in (result.points_m, result.curve_m))
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=3.4)
        shape, turned = axes[0]
        shape.plot(*points.T, ".", color=GREY, markersize=3, label="points")
        for k, each in enumerate(result.stretches):
            rows = (result.length_m >= each.start_m) & (result.length_m <= each.start_m + each.length_m)
            straight = each.angle_rad == 0
            color = BLUE if straight else (VERMILION, ORANGE)[k % 2]
            label = each.name if straight else f"{each.name}: {each.angle_rad:.2f} rad"
            shape.plot(*curve[rows].T, color=color)
            place = curve[rows][int(rows.sum()) // 2]
            away = place - curve.mean(axis=0)
            away = 12 * away / max(float(np.hypot(*away)), 1e-12)
            shape.annotate(
                label,
                place,
                textcoords="offset points",
                xytext=(away[0], away[1]),
                fontsize=8,
                ha="center",
                va="center",
            )
            turned.axvline(each.start_m, color=GREY, linewidth=0.5)
        shape.plot(*curve[:1].T, "o", color=BLUE, markersize=4, label="actuator end")
        legend_below(figure, shape)
        shape.set_aspect("equal", adjustable="datalim")
        shape.set(xlabel="along the widest direction [m]", ylabel="across [m]")
        shape.margins(0.2)  # room for the names
        low, high = result.turned_rad - result.spread_rad, result.turned_rad + result.spread_rad
        turned.fill_between(result.length_m, low, high, color=BLUE, alpha=0.2, linewidth=0, label="95 % interval")
        turned.plot(result.length_m, result.turned_rad, color=BLUE, label="angle turned")
        turned.set(xlabel="length from the actuator [m]", ylabel="wrap angle [rad]")
        turned.legend()
    return figure
