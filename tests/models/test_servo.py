"""A drive between its command and what it does, against its own closed forms and a fine simulation of it."""

import math

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.servo import CommandHold, Servo

STEP = 1e-3
TIME = np.arange(0, 2, STEP)
WANTED = np.sin(5 * TIME) * np.minimum(TIME / 0.5, 1) ** 2


def fine(servo: Servo, command: np.ndarray, parts: int = 50) -> np.ndarray:
    """Trapezoidal rule in small steps, written without the class."""
    t = np.arange((len(command) - 1) * parts + 1) * STEP / parts - servo.delay_s
    interval, k = servo.command_interval_s or STEP, np.floor(t / (servo.command_interval_s or STEP) + 1e-9)

    def sample(n: np.ndarray) -> np.ndarray:
        return np.interp(np.maximum(n, 0) * interval, TIME, command)

    part = t / interval - k
    u = {
        CommandHold.LINE: sample(k) + part * (sample(k + 1) - sample(k)),
        CommandHold.HOLD: sample(k),
        CommandHold.LATE: sample(k - 1) + part * (sample(k) - sample(k - 1)),
    }[servo.command_hold]
    if servo.servo_time_s == 0:
        return u[::parts]
    y, half = np.empty(len(u)), STEP / parts / servo.servo_time_s / 2
    y[0] = u[0]
    for row in range(1, len(u)):
        y[row] = ((1 - half) * y[row - 1] + half * (u[row] + u[row - 1])) / (1 + half)
    return y[::parts]


@pytest.mark.parametrize("hold", CommandHold)
@pytest.mark.parametrize(("lag", "delay", "interval"), [(0.02, 0.005, 0.02), (0.02, 0.0, None), (0.007, 0.0033, 0.013)])
def test_the_answer_to_a_command_is_that_of_a_fine_simulation(hold, lag, delay, interval):
    servo = Servo(servo_time_s=lag, delay_s=delay, command_interval_s=interval, command_hold=hold)
    assert servo.follow(WANTED, STEP) == pytest.approx(fine(servo, WANTED), abs=2e-4)


def test_a_ramp_is_followed_late_by_lag_and_delay():
    ramp = 3.0 * TIME
    for hold, late in ((CommandHold.LINE, 0.0), (CommandHold.HOLD, 0.01), (CommandHold.LATE, 0.02)):
        servo = Servo(servo_time_s=0.015, delay_s=0.004, command_interval_s=0.02, command_hold=hold)
        behind = np.mean((ramp - servo.follow(ramp, STEP))[-200:]) / 3.0
        assert behind == pytest.approx(servo.lag_s(STEP), abs=6e-4)
        assert servo.lag_s(STEP) == pytest.approx(0.019 + late)


@pytest.mark.parametrize("hold", CommandHold)
def test_the_command_takes_back_what_the_drive_adds(hold):
    servo = Servo(servo_time_s=0.02, delay_s=0.005, command_interval_s=0.02, command_hold=hold)
    missed = [np.abs(servo.follow(u, STEP) - WANTED)[:-50].max() for u in (WANTED, servo.command(WANTED, STEP))]
    assert missed[0] > 0.1
    assert missed[1] < 0.02


def test_held_samples_are_those_of_least_squares():
    """Without a lag each sample is the mean of what is wanted while it acts; any change of one makes it worse."""
    servo = Servo(command_interval_s=0.04, command_hold=CommandHold.HOLD)
    command = servo.command(WANTED, STEP)
    assert command[40 * 7] == pytest.approx(WANTED[281:321].mean(), abs=2e-3)
    lagging = Servo(command_interval_s=0.04, command_hold=CommandHold.HOLD, servo_time_s=0.03)
    best = lagging.command(WANTED, STEP)
    least = np.mean((lagging.follow(best, STEP) - WANTED) ** 2)
    bump = np.interp(TIME, [0.36, 0.4, 0.44], [0.0, 1e-2, 0.0])
    assert all(np.mean((lagging.follow(best + s * bump, STEP) - WANTED) ** 2) > least for s in (-1, 1))


def test_live_the_lag_is_taken_back_and_the_delay_stays():
    servo = Servo(servo_time_s=0.02, delay_s=0.01)
    answer = servo.follow(servo.command(WANTED, STEP, live=True), STEP)
    late = np.interp(TIME - servo.lag_s(STEP, live=True), TIME, WANTED)
    assert servo.lag_s(STEP, live=True) == 0.01
    assert np.abs(answer - late)[100:].max() < 5e-3


def test_an_ideal_drive_changes_nothing():
    assert Servo().is_ideal
    assert np.array_equal(Servo().follow(WANTED, STEP), WANTED)
    assert np.array_equal(Servo().command(WANTED, STEP), WANTED)


@pytest.mark.parametrize("bad", [-0.1, math.nan])
def test_a_bad_time_is_refused_by_name_and_value(bad):
    with pytest.raises(ParameterError, match=f"delay_s must be a finite number >= 0, got {bad}"):
        Servo(delay_s=bad)


@pytest.mark.parametrize(
    ("servo", "rough", "jumps"),
    [
        (Servo(servo_time_s=0.01, delay_s=0.003), False, False),
        (Servo(command_interval_s=0.01), True, False),
        (Servo(command_interval_s=0.01, resolution=1e-3), True, False),
        (Servo(command_interval_s=0.01, command_hold=CommandHold.HOLD), True, True),
        (Servo(command_interval_s=0.01, command_hold=CommandHold.HOLD, servo_time_s=0.01), True, False),
        (Servo(resolution=1e-3), True, True),
        (Servo(play=1e-3), True, False),
    ],
)
def test_a_drive_is_rough_behind_samples_and_steps_and_jumps_where_no_lag_smooths_them(
    servo: Servo, rough: bool, jumps: bool
) -> None:
    assert (servo.is_rough(1e-3), servo.jumps(1e-3)) == (rough, jumps)
