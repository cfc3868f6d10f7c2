"""Sketch of a finger: three bones, joints, and tendons that cross them."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from tendonff.compensator.reporting.colours import BLUE, GREY, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure


def draw() -> Figure:
    """Draw the figure."""
    with figure_style():
        figure, axes = new_figure(1, 1, height_in=2.8)
        panel = axes[0, 0]
        bend = np.deg2rad([0.0, -20.0, -35.0, -25.0])
        heading = np.cumsum(bend)
        lengths = (3.2, 2.6, 2.0, 1.5)
        steps = np.array(
            [length * np.array([np.cos(a), np.sin(a)]) for length, a in zip(lengths, heading, strict=True)]
        )
        joints = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
        normal = np.array([[-np.sin(a), np.cos(a)] for a in heading])
        panel.plot(*joints.T, color=GREY, linewidth=7, alpha=0.4, solid_capstyle="round")
        for name, at in zip(("mcp", "pip", "dip"), joints[1:4], strict=True):
            panel.add_patch(Circle(tuple(at), 0.28, fill=True, facecolor="white", edgecolor=INK, linewidth=1.5))
            panel.text(*(at + np.array([0.05, 0.75])), f"$q_{{{name}}}$", ha="left")
        for side, last, colour, name in ((1, 3, VERMILION, "extensor"), (-1, 3, BLUE, "flexors"), (-0.62, 2, BLUE, "")):
            points = [np.array([-1.6, side * 0.42]), joints[0] + side * 0.42 * normal[0]]
            points += [joints[k] + side * 0.21 * (normal[k - 1] + normal[k]) for k in range(1, last + 1)]
            points.append(0.5 * (joints[last] + joints[last + 1]) + side * 0.3 * normal[last])
            path = np.array(points)
            panel.plot(*path.T, color=colour, linewidth=1.8)
            panel.plot(*path[-1], "o", color=colour, markersize=4)
            if name:
                panel.text(-1.6, side * 0.95, name, color=colour, va="center")
        panel.text(-1.7, 0.0, "motors", ha="right", va="center")
        panel.set(aspect="equal", xlim=(-3.6, 8.8), ylim=(-5.0, 1.7))
        panel.axis("off")
    return figure
