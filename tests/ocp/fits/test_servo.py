"""Lag and delay of a drive from logs of an independent simulation of it."""

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.ocp.fits.servo import fit_servo, servo_chirp

STEP = 2e-3


def logged(command, lag, delay, parts=40):
    """Answer of a drive, trapezoidal rule in small steps."""
    time = np.arange(len(command)) * STEP
    fine = np.arange((len(command) - 1) * parts + 1) * STEP / parts
    u, half = np.interp(fine - delay, time, command), 0.5 * fine[1] / lag
    y = u.copy()
    for row in range(1, len(u)):
        y[row] = ((1 - half) * y[row - 1] + half * (u[row] + u[row - 1])) / (1 + half)
    return y[::parts]


@pytest.mark.parametrize(("lag", "delay"), [(0.02, 0.005), (0.006, 0.012), (0.045, 0.003)])
def test_lag_and_delay_are_found_within_a_millisecond_and_their_intervals_hold(lag, delay):
    """1 ms and 10 %, from a chirp with noise of 1 % and a position in other units."""
    _, command = servo_chirp(0.3, STEP)
    answer = 2.0 * logged(command, lag, delay) + 0.1 + 6e-3 * np.random.default_rng(3).standard_normal(len(command))
    found = fit_servo(command, answer, STEP)
    assert found.servo_time_s == pytest.approx(lag, abs=max(1e-3, 0.1 * lag))
    assert abs(found.delay_s - delay) < 1e-3
    assert found.gain == pytest.approx(2.0, rel=0.02)
    low, high = found.servo_time_interval_s
    assert low - 3e-4 < lag < high + 3e-4
    assert found.residual < 0.05


def test_a_command_that_stands_still_is_refused_with_the_way_out():
    with pytest.raises(ParameterError, match="does not change; log a chirp"):
        fit_servo(np.ones(500), np.ones(500), STEP)


def test_the_chirp_begins_and_ends_at_rest():
    time, command = servo_chirp(5.0, STEP, middle=20.0)
    assert command[0] == command[-1] == 20.0
    assert np.ptp(command) == pytest.approx(10.0, rel=0.05)
    assert time[-1] == pytest.approx(8.0)
