"""Bode plots against closed forms."""

import numpy as np
import pytest

from tendonff.compensator.reporting.plots import bode_figure


def test_a_bode_plot_shows_gain_and_phase_in_hertz():
    frequency = np.geomspace(0.01, 10, 50)
    omega = 2 * np.pi * frequency
    slow = 2.0 / (0.5j * omega + 1)  # gain 2, time constant 0.5 s
    figure = bode_figure({"lag": slow, "link": 2e4 / (1j * omega)}, frequency, ylabel="gain [-]")
    gain, phase = (axes.lines[0] for axes in figure.axes[:2])
    assert gain.get_xdata() == pytest.approx(frequency)
    assert gain.get_ydata() == pytest.approx(2 / np.sqrt(1 + (0.5 * omega) ** 2))
    assert phase.get_ydata() == pytest.approx(-np.degrees(np.arctan(0.5 * omega)))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["lag", "link"]
