"""Bode and step plots against closed forms, and on the link."""

import control
import numpy as np
import pytest

from tendonff.compensator.reporting.frequency import bode_figure, step_figure
from tendonff.models.interop import link_impedance
from tendonff.models.link import ZenerLink

SLOW = control.TransferFunction([2.0], [0.5, 1.0])  # gain 2, time constant 0.5 s
LINK = ZenerLink(stiffness_N_per_m=2e4, relaxing_stiffness_N_per_m=6e3, relaxation_time_s=0.4, damping_N_s_per_m=3.0)


def test_a_bode_plot_shows_gain_and_phase_in_hertz():
    frequency = np.geomspace(0.01, 10, 50)
    figure = bode_figure({"lag": SLOW, "link": link_impedance(LINK)}, frequency, ylabel="gain [-]")
    gain, phase = (axes.lines[0] for axes in figure.axes[:2])
    omega = 2 * np.pi * frequency
    assert gain.get_xdata() == pytest.approx(frequency)
    assert gain.get_ydata() == pytest.approx(2 / np.sqrt(1 + (0.5 * omega) ** 2))
    assert phase.get_ydata() == pytest.approx(-np.degrees(np.arctan(0.5 * omega)))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["lag", "link"]


def test_a_step_plot_shows_the_response_to_one_unit():
    """Of the link: k1 t + k2 tau (1 - e^{-t/tau}) + c, the force of a stretch at one metre per second."""
    time = np.linspace(0, 2, 401)
    figure = step_figure({"lag": SLOW, "link": link_impedance(LINK)}, time, ylabel="force [N]")
    lag, link = figure.axes[0].lines
    assert lag.get_ydata() == pytest.approx(2 * (1 - np.exp(-time / 0.5)), abs=1e-9)
    assert link.get_ydata() == pytest.approx(2e4 * time + 6e3 * 0.4 * (1 - np.exp(-time / 0.4)) + 3, rel=1e-9)
