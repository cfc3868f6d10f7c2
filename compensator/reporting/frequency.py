"""Bode plots of linear systems, in the style of all other figures."""

from collections.abc import Mapping

import control
import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.plots import LINE_STYLES, figure_style, new_figure


def bode_figure(systems: Mapping[str, control.LTI], frequencies_Hz: FloatArray, *, ylabel: str) -> Figure:
    """Gain and phase over frequency, one curve for each system.

    Parameters
    ----------
    systems : mapping of str to control.LTI
        By label; one input, one output each.
    frequencies_Hz : ndarray, shape (n,)
        Where to evaluate [Hz], > 0, rising.
    ylabel : str
        What the gain is, with unit.
    """
    with figure_style():
        figure, axes = new_figure(2, 1, share_x=True, height_in=4.4)
        for k, (label, system) in enumerate(systems.items()):
            response = np.asarray(system(2j * np.pi * frequencies_Hz)).ravel()
            style = LINE_STYLES[k % len(LINE_STYLES)]
            axes[0, 0].loglog(frequencies_Hz, np.abs(response), style, label=label)
            axes[1, 0].semilogx(frequencies_Hz, np.degrees(np.unwrap(np.angle(response))), style)
        axes[0, 0].set(ylabel=ylabel)
        for axis in (axes[0, 0].yaxis, axes[1, 0].xaxis):
            axis.set_major_formatter("{x:g}")
        axes[1, 0].set(ylabel="phase [deg]", xlabel="frequency [Hz]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
