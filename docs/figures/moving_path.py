"""Sketch of a path in three sections, at two angles of the joint in its middle."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, GREEN, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure

RADIUS, ANGLES, STRAIGHT = 1.0, (1.2, 0.9, 0.6), 0.6


def path(joint_rad: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points of each section for an angle of the joint."""
    position, heading, sections = np.zeros(2), 0.0, []
    for wrap in np.array(ANGLES) + np.array([0.0, joint_rad, 0.0]):
        turn = heading + np.linspace(0, wrap, 40)
        arc = position + RADIUS * np.column_stack([np.sin(turn) - np.sin(heading), np.cos(heading) - np.cos(turn)])
        heading += wrap
        end = arc[-1] + STRAIGHT * np.array([np.cos(heading), np.sin(heading)])
        sections.append((arc, np.vstack([arc[-1], end])))
        position = end
    return sections


def draw() -> Figure:
    """Draw the figure."""
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=3.0)
        for panel, joint in zip(axes[0], (-0.6, 0.6), strict=True):
            sections = zip(path(joint), (BLUE, VERMILION, GREEN), strict=True)
            for wrap, ((arc, straight), colour) in zip((1.2, 0.9 + joint, 0.6), sections, strict=True):
                panel.plot(*arc.T, color=colour, linewidth=4)
                panel.plot(*straight.T, color=INK, linewidth=1)
                panel.annotate(f"{wrap:.1f} rad", arc[20], textcoords="offset points", xytext=(10, -10), color=colour)
            panel.set(aspect="equal", title=f"joint at {joint:+.1f} rad".replace("-", "\N{MINUS SIGN}"))
            panel.set(xlim=(-1.2, 3.2), ylim=(-0.5, 3.2))
            panel.axis("off")
    return figure
