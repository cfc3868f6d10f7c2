"""Drives that are late: lag, delay, held commands, and what is assumed of a class, on an independent plant."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.motors.registry import MOTOR_COMPENSATORS
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.uncertain import UNSTATED, Doubt
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.models.servo import ASSUMED_S, CommandHold, DriveClass
from tendonff.ocp.tracking.held import improve_samples
from tests.compensator.studies.design.test_drives import actuated, answer, percent
from tests.independent_plant import respond

INVERSE = next(each for each in MOTOR_COMPENSATORS if each.name == "inverse")
pytestmark = pytest.mark.compiler


def behind(actuator, time_s, command, parts=20):
    """Output of a drive with lag, delay and held commands, by the trapezoidal rule: times and values."""
    fine = np.arange((len(command) - 1) * parts + 1) * (time_s[1] / parts)
    late = fine - (actuator.delay_s or 0.0)
    if actuator.command_interval_s:
        late = np.floor(late / actuator.command_interval_s + 1e-9) * actuator.command_interval_s
    given = np.interp(late, time_s, command)
    if not actuator.servo_time_s:
        return fine, given
    found, half = given.copy(), 0.5 * fine[1] / actuator.servo_time_s
    for row in range(1, len(given)):
        found[row] = ((1 - half) * found[row - 1] + half * (given[row] + given[row - 1])) / (1 + half)
    return fine, found


def arrived(scenario, command, masses=12):
    """RMS error on the independent plant behind its drive, % of range."""
    reference = Problem.of(scenario).reference
    time, force = behind(scenario.transmission.actuator, reference.time_s, command)
    seen = respond(scenario.transmission, time, force, reference.initial_tension_N, masses=masses)
    return percent(seen.output_N[::20] - reference.tension_N, reference)


def test_lag_and_delay_of_a_force_drive_are_taken_back_on_an_independent_plant(examples, record_property):
    """0.3 % of range; the force itself as command misses ten times that."""
    slow = actuated(load_scenario(examples / "finger.toml"), servo_time_s=0.02, delay_s=0.005)
    _, profile = answer(slow)
    error, force = arrived(slow, profile.command_N), arrived(slow, profile.force_N)
    record_property("figure", f"force drive with a lag of 20 ms and a delay of 5 ms: {error:.2g} % ({force:.2g} %)")
    assert error < 0.3
    assert force > 10 * error


def test_a_command_that_the_drive_would_clip_is_said(examples):
    """A lag of 50 ms asks for a force far below nothing, where the bare force stays within the limits."""
    scenario = actuated(load_scenario(examples / "bowden.toml"), servo_time_s=0.05)
    found = design(scenario, compensators=[compensator("none"), compensator("inverse")])
    least = found.profiles["inverse"].command_N.min()
    assert found.profiles["inverse"].force_N.min() > 0 > least
    [said] = [text for text in found.warnings if "beyond force_min_N" in text]
    assert said.startswith(f"command_inverse_N goes from {least:.4g} to ")


def test_the_expected_error_counts_a_lag_that_is_not_known_well(examples):
    """What [robust.spread] states of the drive is simulated, and named where it is the largest."""
    scenario = actuated(load_scenario(examples / "finger.toml"), servo_time_s=0.02)
    spread = (Spread(keys=("actuator.servo_time_s",), low=0.01, high=0.03),)
    scenario = replace(scenario, robust=Uncertainty(spread=spread, samples=3))
    problem, profile = answer(scenario)
    found = problem.expect({"inverse": profile})
    slower = actuated(scenario, servo_time_s=0.03)
    assert found.best.worst.rmse_percent_of_range == pytest.approx(arrived(slower, profile.command_N), rel=0.1)
    assert found.contributions[0].key == "actuator.servo_time_s"


@pytest.mark.parametrize("kind", [kind for kind, assumed in ASSUMED_S.items() if assumed])
def test_the_expected_error_covers_nine_of_ten_drives_of_a_class(examples, kind):
    """Only the class is stated: lag and delay are drawn from it, and both are named with the way to measure them."""
    scenario = actuated(load_scenario(examples / "finger.toml"), drive_class=kind)
    problem, profile = answer(scenario)
    found = problem.expect({"inverse": profile})
    keys = {each.key for each in found.contributions}
    assert {"actuator.servo_time_s", "actuator.delay_s"} <= keys
    covered, draw = 0, np.random.default_rng(5)
    for _ in range(10):
        mu = draw.uniform(0.9, 1.1)
        times = {key: draw.uniform(*ends) for key, ends in ASSUMED_S[kind].items()}
        real = actuated(scenario, **times).transmission
        real = with_numbers(real, {"mu": mu})
        output = Plant(real, problem.level, 40).respond(profile, problem.reference).output_N
        covered += percent(output - problem.reference.tension_N, problem.reference) <= (
            1.001 * found.best.worst.rmse_percent_of_range
        )
    assert covered >= 9


def test_times_that_are_stated_are_not_assumed(examples):
    scenario = actuated(load_scenario(examples / "finger.toml"), drive_class=DriveClass.DYNAMIXEL, servo_time_s=0.02)
    keys = {key for spread in Problem.of(scenario).doubt.spreads for key in spread.keys}
    assert keys == {"mu", "actuator.delay_s"}
    assert scenario.transmission.actuator.servo.servo_time_s == 0.02
    assert scenario.transmission.actuator.servo.delay_s == pytest.approx(0.0055)


@pytest.mark.parametrize("kind", UNSTATED)
def test_the_headline_covers_nine_of_ten_drives_where_nothing_is_stated(examples, kind):
    """Each class is named with its own worst case; one that is stated changes no number of the others."""
    finger = load_scenario(examples / "finger.toml")
    problem, profile = answer(finger)
    found = problem.expect({"inverse": profile})
    said = next(each for each in found.behind if each.kind is kind).worst.rmse_percent_of_range
    assert f"{two_digits(said)} % ({kind})" in found.headline("inverse", "x")
    covered, draw = 0, np.random.default_rng(7)
    for _ in range(10):
        times = {key: draw.uniform(*ends) for key, ends in ASSUMED_S[kind].items()}
        real = with_numbers(actuated(finger, **times).transmission, {"mu": draw.uniform(0.9, 1.1)})
        output = Plant(real, problem.level, 40).respond(profile, problem.reference).output_N
        covered += percent(output - problem.reference.tension_N, problem.reference) <= 1.001 * said
    assert covered >= 9


@pytest.mark.parametrize("stated", [{"drive_class": DriveClass.IDEAL}, {"delay_s": 0.002}, {"servo_time_s": 0.0}])
def test_a_drive_of_which_something_is_stated_is_of_no_other_class(examples, stated):
    finger = load_scenario(examples / "finger.toml")
    assert Doubt.of(finger.transmission, finger.robust).drives_not_stated == ("actuator",)
    doubt = Doubt.of(actuated(finger, **stated).transmission, finger.robust)
    assert doubt.drives_not_stated == ()


def drawn_errors(task, command_rad, stated, draw, times, count=10):
    """RMS errors of motors of drawn times, friction, stiffness and tension within those that the scenario assumes."""
    for _ in range(count):
        numbers = {key: draw.uniform(0.8, 1.2) for key in ("mu", "stiffness")}
        late = {f"{place}.{key}": draw.uniform(*ends) for place in stated for key, ends in times.items()}
        output, _ = task._judged(with_numbers(task.scenario.system, numbers | late), command_rad)
        yield float(np.sqrt(np.mean((output - task.wanted) ** 2)))


@pytest.mark.parametrize(
    "example",
    ["hand_joint", pytest.param("three_joint_finger", marks=pytest.mark.nightly)],
)
@pytest.mark.parametrize("kind", [DriveClass.HOBBY_SERVO, None])
def test_the_worst_case_of_joints_covers_nine_of_ten_motors(examples, tmp_path, example, kind):
    """Of a class that is stated, and of the class that the headline names where none is."""
    text = (examples / f"{example}.toml").read_text(encoding="utf-8")
    places = problem_of(load_scenario(examples / f"{example}.toml")).doubt.drives_not_stated
    if kind is not None:
        own = f'[drive]\ndrive_class = "{kind}"\n'
        text = text.replace("[drive]\n", own) if "[drive]" in text else f"{text}\n{own}"
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    task = problem_of(load_scenario(tmp_path / "own.toml"))
    command = task.answer(INVERSE)
    found = task.expect({"inverse": command})
    drawn = kind or DriveClass.DYNAMIXEL
    said = found.best.worst.rmse if kind else next(b for b in found.behind if b.kind is drawn).worst.rmse
    assert (kind is None) == bool(found.behind)
    errors = list(drawn_errors(task, command, places, np.random.default_rng(3), ASSUMED_S[drawn]))
    assert np.mean(np.array(errors) <= 1.001 * said) >= 0.9
    assert max(errors) > 0.2 * said


def test_motors_of_one_class_lag_alike(examples):
    finger = load_scenario(examples / "three_joint_finger.toml")
    motors = finger.system.motors
    kinds = (DriveClass.DYNAMIXEL, DriveClass.DYNAMIXEL, DriveClass.DYNAMIXEL, DriveClass.IDEAL)
    driven = [replace(m, drive=replace(m.drive, drive_class=k)) for m, k in zip(motors, kinds, strict=True)]
    doubt = Doubt.of(replace(finger.system, motors=tuple(driven)), Uncertainty(mu=0.1, samples=3))
    lag = next(spread for spread in doubt.spreads if "servo_time_s" in spread.name)
    assert lag.keys == tuple(f"motors.{motor.name}.drive.servo_time_s" for motor in motors[:3])
    slow = doubt.samples[doubt.ends(doubt.spreads.index(lag))[1]].system
    assert [motor.drive.servo_time_s for motor in slow.motors] == [0.03, 0.03, 0.03, None]
    assert doubt.drives_not_stated == ()


@pytest.mark.nightly
def test_held_commands_are_nearly_the_best_at_their_rate(examples, record_property):
    """At most 1.15 times what least squares over the judging plant itself finds."""
    held = actuated(load_scenario(examples / "finger.toml"), command_interval_s=0.02, command_hold=CommandHold.HOLD)
    problem, profile = answer(held)
    reference = problem.reference
    plant = Plant(held.transmission, problem.level, 12, 4)
    at = np.arange(0.0, reference.time_s[-1] + 0.02, 0.02)

    def output(samples):
        tried = replace(profile, command_N=np.interp(reference.time_s, at, samples))
        return plant.respond(tried, reference).output_N

    start = np.interp(at, reference.time_s, profile.command_N)
    best = improve_samples(output, start, reference.tension_N, 0.05)
    least = arrived(held, np.interp(reference.time_s, at, best))
    own, plain = arrived(held, profile.command_N), arrived(held, profile.force_N)
    record_property("figure", f"commands held for 20 ms: {own:.2g} %, best {least:.2g} %, force itself {plain:.2g} %")
    assert own < 1.15 * least
    assert plain > 5 * own
