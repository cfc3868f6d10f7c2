"""Sketch of a joint on a loop: motor drum, two tendons on their guides, joint."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from tendonff.compensator.reporting.colours import BLUE, GREY, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure


def draw() -> Figure:
    """Draw the figure."""
    with figure_style():
        figure, axes = new_figure(1, 1, height_in=2.6)
        panel = axes[0, 0]
        along = np.linspace(0.0, 8.0, 200)
        bend = 0.35 * np.sin(np.pi * along / 4.0) * np.sin(np.pi * along / 8.0)
        for side, colour, name in ((1, BLUE, "tendon 1"), (-1, VERMILION, "tendon 2")):
            panel.plot(along, side * 0.8 + bend, color=colour, linewidth=2.5)
            panel.text(4.0, side * 1.15 + 0.1, name, color=colour, ha="center", va="center")
            panel.text(0.55, side * 1.2, f"$T_{{{(3 - side) // 2}}}$ drum", color=colour, ha="left", va="center")
            panel.text(7.3, side * 1.2, f"$T_{{{(3 - side) // 2}}}$ joint", color=colour, ha="right", va="center")
        for x, text in ((0.0, "drum\nmotor $\\vartheta$"), (8.0, "joint\n$q$, $J$")):
            panel.add_patch(Circle((x, 0.0), 0.8, fill=False, color=INK, linewidth=1.5))
            panel.text(x, 0.0, text, ha="center", va="center")
        panel.plot([8.74, 10.0], [0.33, 0.9], color=INK, linewidth=4, solid_capstyle="round")
        panel.annotate("", xy=(9.1, 1.25), xytext=(9.45, 0.1), arrowprops={"arrowstyle": "->", "color": GREY})
        panel.text(9.7, 1.25, "contact,\ngravity", color=GREY, va="center")
        panel.set(aspect="equal", xlim=(-1.2, 11.2), ylim=(-1.6, 1.7))
        panel.axis("off")
    return figure
