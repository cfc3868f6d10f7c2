"""The smooth angle behind readings in counts: within a count, and back only where the readings go back."""

import numpy as np
import pytest

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.smoothing import adaptive_low_pass
from tendonff.compensator.identification.motors.counts import between_counts, count_of, reading_share, smooth_angle
from tendonff.compensator.identification.motors.estimates import DERIVED, derived
from tendonff.compensator.identification.motors.loop_routine import suggest_routine
from tendonff.ocp.fits.mechanism import GEAR_SLIP_RAD, Loop, MotorRun, respond
from tests.hidden_loop import COUNT_RAD, scenario

ROW_S = 1e-2


def read(angle_rad, zero=0.3):
    """An angle in counts from some zero, less this zero."""
    return (np.round(angle_rad / COUNT_RAD + zero) - zero) * COUNT_RAD


def stroke(to_rad, seconds, row_s=ROW_S):
    """Half a cosine, and a hold as long."""
    time = np.arange(round(seconds / row_s) + 1) * row_s
    up = to_rad * (1 - np.cos(np.pi * time / seconds)) / 2
    return np.concatenate([up, np.full(len(time), to_rad)])


@pytest.mark.parametrize("row_s", [1e-2, 1e-3])
def test_a_slow_swing_is_known_to_less_than_half_a_count_and_goes_one_way(row_s):
    time = np.arange(round(4 / row_s)) * row_s
    true = 0.2 * (1 - np.cos(2 * np.pi * 0.25 * time))
    smooth = smooth_angle(read(true), row_s)
    off, inside = smooth - true, np.abs(time - 2) < 1.8
    assert np.abs(off).max() < 0.6 * COUNT_RAD
    assert np.abs(off[inside]).max() < 0.4 * COUNT_RAD
    rising = np.diff(smooth)[: len(time) // 2 - 1]
    assert rising.min() > -1e-3 * COUNT_RAD


def test_a_motor_that_stops_does_not_swing_back():
    """By less than a count it would turn the friction of its gear over, as the low-pass lets it."""
    true = stroke(0.5, 1.4)
    smooth, swinging = smooth_angle(read(true), ROW_S), adaptive_low_pass(read(true), ROW_S)
    rubs, let_go, expected = (MotorRun.of_one(x, ROW_S, 0.0).way()[-1, 0] for x in (smooth, swinging, true))
    assert rubs == pytest.approx(expected, abs=0.05)
    assert let_go < expected - 0.05


def test_a_reading_that_flickers_is_no_reversal_and_one_that_stays_is():
    level = np.repeat([0.0, 1.0, 2.0, 3.0], 20)
    flickers = level.copy()
    flickers[[45, 52]] -= 1.0
    stays = np.concatenate([level, np.repeat([2.0], 40)])
    assert np.diff(between_counts(flickers, ROW_S, 1.0)).min() > -1e-2
    back = between_counts(stays, ROW_S, 1.0)
    assert back.max() - back[-1] > 0.3


def test_a_quick_motor_stays_near_its_counts():
    """Its jerk is many counts a row wherever it turns."""
    true = np.abs(np.arange(400) * 0.1 % 2 - 1)
    assert np.abs(between_counts(read(true), ROW_S, COUNT_RAD) - read(true)).max() < COUNT_RAD


def test_a_count_is_found_in_rounded_files_and_not_where_there_is_none():
    true = stroke(0.5, 1.4)
    assert count_of(np.round(read(true), 4)) == pytest.approx(COUNT_RAD, rel=1e-2)
    assert count_of(true + 1e-5 * np.random.default_rng(0).standard_normal(len(true))) == 0.0
    assert count_of(read(np.abs(np.arange(400) * 0.02 % 2 - 1))) == 0.0  # never slow: 13 or 14 counts a row
    assert count_of(np.repeat([0.0, 1.0, 0.3], 50)) == 0.0


def test_noise_beside_the_counts_is_smoothed_as_noise():
    true = stroke(0.5, 1.4, 1e-3)
    noisy = read(true + 2 * COUNT_RAD * np.random.default_rng(0).standard_normal(len(true)))
    assert smooth_angle(noisy, 1e-3) == pytest.approx(adaptive_low_pass(noisy, 1e-3, count_of(noisy)))


def test_a_reading_counts_once_however_long_it_stays():
    angle = read(np.concatenate([stroke(0.5, 1.4), 0.5 - stroke(0.5, 1.4)]))
    share = reading_share(angle)
    assert share.sum() == pytest.approx(1 + np.count_nonzero(np.diff(angle)))
    assert share[80] == 1.0
    assert share[200] == 1 / np.count_nonzero(np.abs(angle - angle[200]) < COUNT_RAD / 2)
    assert (reading_share(np.round(angle, 9) / 50) == 1).all()  # counts that are much finer than what they tell
    assert (reading_share(np.full(50, np.nan)) == 1).all()


@pytest.mark.compiler
@pytest.mark.parametrize("row_s", [pytest.param(1e-2, marks=pytest.mark.nightly), 1e-3])
def test_counts_of_a_log_without_noise_leave_a_and_the_stretch_within_one_per_cent(tmp_path, row_s):
    asked = scenario()
    routine = suggest_routine(asked)
    time = np.arange(round(routine.time_s[-1] / row_s) + 1) * row_s
    motor = np.interp(time, routine.time_s, routine.motor_rad)
    answer = respond(Loop(mechanism=asked.mechanism), MotorRun.of_one(motor, row_s, 0.0), segments=16)
    columns = {"time_s": time, "motor_rad": read(motor), "motor_torque_N_m": answer.torque_N_m[:, 0]}
    write_csv(tmp_path / "log.csv", columns)
    found = identify(asked, [tmp_path / "log.csv"])
    for name, value in zip(DERIVED, derived(asked.mechanism, 0.0).tolist(), strict=True):
        if name in ("mu_theta", "tension_over_stiffness_m"):
            assert found.estimate(name).value == pytest.approx(value, rel=0.01), name


@pytest.mark.parametrize("rows", [1, 3, 50])
def test_friction_of_a_gear_builds_up_as_an_exponential_however_long_the_rows(rows):
    way = np.linspace(0.0, 2 * GEAR_SLIP_RAD, rows + 1)
    built = MotorRun.of_one(way, ROW_S, 0.0).way()[-1, 0]
    assert built == pytest.approx(1 - np.exp(-2.0), abs=1e-12)
