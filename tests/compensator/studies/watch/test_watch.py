"""Drift of a joint over its use: the right name soon, and silence where nothing drifts."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv, write_text
from tendonff.compensator.identification.motors.fitted import fitted_text
from tendonff.compensator.identification.motors.loop_routine import suggest_routine
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.experiment.run import experiment
from tendonff.compensator.studies.watch.chart import DRIFTS, courses_of
from tendonff.compensator.studies.watch.output import Watch
from tendonff.compensator.studies.watch.run import watch
from tendonff.compensator.studies.watch.windows import WATCHED, Window
from tendonff.models.errors import ParameterError
from tests.hand_in_use import ROW_S, HandInUse, known
from tests.hidden_loop import hidden, scenario

N = Parameter
WEAK = np.array([[1.0, -0.96, 0.0], [-0.96, 1.0, 0.0], [0.0, 0.0, 0.2]]) * 0.15**2
"""Free strokes: friction and pre-tension by their product alone."""

SURE = np.diag([0.02, 0.02, 0.05]) ** 2


WIDE = np.diag([0.1, 0.1, 0.3]) ** 2
"""With the scatter of the base, each number to +-31 % or worse, and no product that is known better."""


def identified(asked: JointScenario, hand: HandInUse) -> str:
    """The scenario with the hand's numbers, and how well friction is known."""
    return fitted_text(asked, known(hand.mechanism), []) + "\n[robust]\nmu = 0.05\n"


def drawn(hours: float, moved, covariance, seed: int = 0) -> list[Window]:
    """Windows of 30 s with errors of a covariance about a drift."""
    draw = np.random.default_rng(seed)
    root, windows = np.linalg.cholesky(covariance), []
    for k in range(round(hours * 120)):
        used = 30.0 * (k + 1)
        logs = np.log([0.2, 15.0, 0.02]) + moved(used) + root @ draw.standard_normal(3)
        values = dict(zip(WATCHED, np.exp(logs).tolist(), strict=True))
        windows.append(Window(name="day", used_s=used, values=values, covariance=covariance))
    return windows


def course(hours: float, moved, covariance, seed: int = 0) -> tuple[float | None, ...]:
    """First alarm of each number in such windows [s]."""
    courses = courses_of(drawn(hours, moved, covariance, seed))
    return tuple(None if c.alarm is None else c.alarm.used_s for c in courses)


@pytest.mark.parametrize("covariance", [WEAK, SURE], ids=["strokes alone", "with pushes"])
@pytest.mark.parametrize("which", range(3))
def test_each_change_raises_its_own_alarm_first_and_within_five_minutes(covariance, which):
    aim = DRIFTS[which].direction
    for seed in range(10):
        alarms = course(0.5, lambda t: aim * (t > 600), covariance, seed)
        assert alarms[which] is not None
        assert alarms[which] <= 900
        assert all(other is None or other > alarms[which] for k, other in enumerate(alarms) if k != which)


@pytest.mark.parametrize("covariance", [WEAK, SURE], ids=["strokes alone", "with pushes"])
def test_no_alarm_in_three_days_without_drift(covariance):
    for seed in range(3):
        assert course(24, lambda _: np.zeros(3), covariance, seed) == (None, None, None)


def test_the_error_of_a_base_of_one_window_raises_no_alarm():
    """All later windows share it, so that no number of them averages it out; one course in seven alarmed."""
    covariance, alarmed = np.diag([0.06, 0.06, 0.15]) ** 2, 0
    for seed in range(60):
        first, *later = drawn(1, lambda _: np.zeros(3), covariance, seed)
        alarmed += any(c.alarm for c in courses_of([replace(first, name="first"), *later]))
    assert alarmed <= 2


@pytest.mark.parametrize("covariance", [WEAK, SURE], ids=["strokes alone", "with pushes"])
def test_the_band_holds_the_value_of_a_constant_rig_in_95_percent_of_the_windows(covariance):
    """The one band of figure and file; that of the file counts by itself, without the base."""
    inside, of_file = [], []
    for seed in range(20):
        windows = tuple(drawn(0.25, lambda _: np.zeros(3), covariance, seed))
        found = Watch(scenario=scenario(), windows=windows, courses=courses_of(windows), inputs=(Path("day"),))
        frame = found.to_frame()
        for each, true in zip(found.courses, (0.2, 15.0, 0.02), strict=True):
            name = str(each.drift.number)
            assert frame[f"{name}_low"].to_numpy() == pytest.approx(each.base * each.low)
            inside.append(np.mean((each.low <= 1) & (each.high >= 1)))
            of_file.append(np.mean((frame[f"{name}_low"] <= true) & (frame[f"{name}_high"] >= true)))
    assert np.mean(inside) > 0.94
    assert np.mean(of_file) > 0.93


def test_one_window_that_is_far_off_raises_none():
    alarms = course(1, lambda t: DRIFTS[0].direction * 3 * (t == 1200), SURE)
    assert alarms == (None, None, None)


@pytest.mark.parametrize(("covariance", "hours"), [(WIDE, 1 / 6), (SURE, 1 / 15)], ids=["wide bands", "base alone"])
def test_logs_that_cannot_show_a_change_are_not_said_to_show_no_drift(covariance, hours):
    windows = tuple(drawn(hours, lambda _: np.zeros(3), covariance))
    found = Watch(scenario=scenario(), windows=windows, courses=courses_of(windows), inputs=())
    assert not found.alarms
    assert "No drift" not in found.headline
    for change in ("friction of the tendons +30 %", "pre-tension -20 %"):
        assert change in found.headline.partition("cannot show")[2].partition(":")[0]
    assert "of such use would)" in found.headline
    assert "push" in found.headline


def test_numbers_that_the_logs_cannot_tell_apart_are_no_numbers_in_the_file():
    """A band around a value that the fit has by chance would exclude the true one: the headline says so too."""
    windows = tuple(drawn(1 / 6, lambda _: np.zeros(3), WIDE))
    found = Watch(scenario=scenario(), windows=windows, courses=courses_of(windows), inputs=(Path("day"),))
    frame = found.to_frame()
    assert not any(course.shown for course in found.courses)
    for number in WATCHED:
        assert frame[[str(number), f"{number}_low", f"{number}_high"]].isna().all(axis=None)
    assert frame["used_s"].notna().all()


def test_logs_that_show_every_change_say_no_drift():
    windows = tuple(drawn(1 / 3, lambda _: np.zeros(3), SURE))
    found = Watch(scenario=scenario(), windows=windows, courses=courses_of(windows), inputs=())
    assert found.headline.startswith("No drift over 20 min of use: friction of the tendons ")


@pytest.mark.parametrize("covariance", [WIDE, WEAK], ids=["wide bands", "strokes alone"])
def test_a_change_is_found_within_the_use_that_is_stated(covariance):
    """In 19 of 20 courses, and not in half of that time: the statement is worth something."""
    aim = DRIFTS[0].direction
    base = courses_of(drawn(0.5, lambda _: np.zeros(3), covariance, 99))[0]
    hours = (300 + base.sure_s) / 3600
    alarms = [course(hours, lambda t: aim * (t > 300), covariance, seed)[0] for seed in range(20)]
    assert sum(a is not None for a in alarms) >= 16
    if covariance is WIDE:
        assert sum(a is not None and a <= 300 + base.sure_s / 3 for a in alarms) < 10


def test_numbers_that_no_log_identified_are_said_to_be_the_scenarios():
    windows = tuple(drawn(1 / 3, lambda _: np.zeros(3), SURE))
    planned = scenario()
    fitted = replace(planned, robust=replace(planned.robust, mu=0.05))
    of_planned, of_fitted = (
        Watch(scenario=each, windows=windows, courses=courses_of(windows), inputs=()).warnings
        for each in (planned, fitted)
    )
    assert "not identified on this joint" in of_planned[0]
    assert of_fitted == ()


@pytest.mark.compiler
@pytest.mark.slow
def test_a_pre_tension_that_falls_between_two_days_is_named_and_written(tmp_path, capsys):
    true = hidden(1).mechanism
    hand = HandInUse(mechanism=replace(true, drive=replace(true.drive, gear_efficiency=1.0)))
    asked = scenario()
    write_text(tmp_path / "fitted.toml", identified(asked, hand))
    arguments = ["watch", str(tmp_path / "fitted.toml"), "--out", str(tmp_path / "out")]
    for day, changed in enumerate(({}, {N.TENSION: 0.8})):
        seconds = 60.0 + 60.0 * day
        write_csv(tmp_path / f"day{day}.csv", hand.log(day, seconds, changed))
        arguments += ["--data", str(tmp_path / f"day{day}.csv")]
    assert run(arguments) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert [alarm["key"] for alarm in summary["alarms"]] == ["pretension_N"]
    assert summary["alarms"][0]["change"] == pytest.approx(-0.2, abs=0.06)
    assert summary["alarms"][0]["file"] == "day1.csv"
    assert "pre-tension down by" in capsys.readouterr().err
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "tension the loop again" in page


@pytest.mark.compiler
def test_the_suggested_routine_is_no_window_that_something_else_moved(tmp_path):
    """With its pushes against the stop, on a mechanism a few per cent off the fitted one."""
    hand, asked = HandInUse(mechanism=hidden(2).mechanism), scenario()
    write_text(tmp_path / "fitted.toml", identified(asked, hand))
    routine = suggest_routine(asked)
    motor = np.interp(np.arange(0.0, routine.time_s[-1], ROW_S), routine.time_s, routine.motor_rad)
    write_csv(tmp_path / "routine.csv", hand.measured(hand.mechanism, motor, np.random.default_rng(0)))
    files = [str(tmp_path / name) for name in ("fitted.toml", "routine.csv", "out")]
    assert run(["watch", files[0], "--data", files[1], "--out", files[2]]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert (summary["windows_that_tell"], summary["warnings"]) == (summary["windows"], [])


def test_the_scenario_of_a_tendon_is_refused_with_the_way_out(tmp_path, examples, capsys):
    assert run(["watch", str(examples / "finger.toml"), "--data", "x.csv", "--out", str(tmp_path / "o")]) == 2
    assert "tendonff identify with several --data" in capsys.readouterr().err


def test_a_tension_is_refused_by_its_kind(examples):
    with pytest.raises(InputError, match="watch follows friction and pre-tension of a closed loop"):
        watch(load_scenario(examples / "finger.toml"), ["a.csv"])
    with pytest.raises(ParameterError, match=r"tf.load_scenario\(file\) gives, got 'finger.toml'"):
        watch("finger.toml", ["a.csv"])
    with pytest.raises(InputError, match="describe that tendon by a scenario of its tension"):
        experiment(load_scenario(examples / "hand_joint.toml"))
