"""Design and simulation of a joint from the command line."""

import contextlib
import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.motors import joint
from tendonff.compensator.compensators.motors.drive import commanded, driven
from tendonff.compensator.compensators.motors.task import UNSETTLED
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DriveKind, JointDrive
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.servo import DriveClass
from tendonff.ocp.joint.invert import JointStatus
from tendonff.ocp.joint.simulate import simulate_joint
from tendonff.ocp.joint.start import joint_problem

pytestmark = pytest.mark.compiler


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8") as stream:
        names = next(csv.reader(stream))
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example behind an ideal servo, designed."""
    folder = tmp_path_factory.mktemp("hand")
    text = (Path(__file__).parents[4] / "examples" / "hand_joint.toml").read_text("utf-8")
    for key in ("resolution_rad", "command_interval_s"):
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith(key))
    (folder / "hand.toml").write_text(text, "utf-8")
    with (folder / "said.txt").open("w", encoding="utf-8") as said, contextlib.redirect_stderr(said):
        assert run(["design", str(folder / "hand.toml"), "--out", str(folder / "out"), "--check", "idas"]) == 0
    return folder


def test_the_recommended_motor_angle_is_checked_by_an_integrator(hand: Path) -> None:
    said = " ".join((hand / "said.txt").read_text("utf-8").split())
    [apart] = re.findall(r"check by idas: exact inverse, .* RMS \(([\d.e-]+) % of range\)", said)
    assert 0 < float(apart) < 0.05


def test_a_loop_is_designed_with_its_data_sheet(hand: Path) -> None:
    summary = json.loads((hand / "out" / "summary.json").read_text("utf-8"))
    errors = {name: level["presliding"] for name, level in summary["compensators"].items()}
    assert list(errors) == ["linear", "static", "inverse"]
    assert math.degrees(errors["inverse"]["rmse_rad"]) < 0.05
    assert errors["static"]["rmse_rad"] < errors["linear"]["rmse_rad"] / 2
    assert errors["inverse"]["rmse_rad"] < errors["static"]["rmse_rad"] / 2
    loop, a = summary["loop"], 0.6
    assert loop["drive_force_N"] == pytest.approx(2 * a * 5)
    assert loop["least_tension_N"] == pytest.approx(5 * a / math.sinh(a))
    assert loop["lost_motion_rad"] == pytest.approx(5 / 2e4 * math.tanh(a / 2) / 8e-3)
    assert {"slack_torque_N_m", "least_pretension_N", "recommended_pretension_N"} <= loop.keys()
    expected = summary["expectation"]
    assert {c["key"] for c in expected["contributions"]} == {"mu", "stiffness", "drive.pretension_N"}
    assert 0.1 < math.degrees(expected["contributions"][0]["rmse_rad"]) < math.degrees(expected["rmse_rad"])
    assert not summary["warnings"]


def test_the_profile_of_a_loop_has_the_promised_columns(hand: Path) -> None:
    profile = columns(hand / "out" / "profile.csv")
    assert list(profile) == [
        "time_s",
        "reference_rad",
        "motor_linear_rad",
        "motor_static_rad",
        "motor_inverse_rad",
        "motor_torque_inverse_N_m",
        "tension_flexor_N",
        "tension_extensor_N",
    ]
    assert np.abs(profile["motor_linear_rad"] - profile["reference_rad"]).max() < 1e-12
    assert all(np.isfinite(column).all() for column in profile.values())


def test_the_report_draws_and_prints_the_sheet(hand: Path) -> None:
    page = (hand / "out" / "report.html").read_text("utf-8")
    for text in ("Data sheet", "recommended pre-tension", "exact inverse", "Robustness to parameter"):
        assert text in page
    for name in ("joint", "tension", "motor", "pretension"):
        assert (hand / "out" / f"{name}.svg").stat().st_size > 5000


def test_a_profile_that_is_simulated_gives_the_reference(hand: Path) -> None:
    scenario, profile = hand / "hand.toml", hand / "out" / "profile.csv"
    assert run(["simulate", str(scenario), "--force", str(profile), "--out", str(hand / "sim.csv")]) == 0
    found, wanted = columns(hand / "sim.csv"), columns(profile)
    assert np.abs(found["angle_rad"] - wanted["reference_rad"]).max() < 1e-8
    assert np.abs(found["tension_flexor_N"] - wanted["tension_flexor_N"]).max() < 1e-5
    torque = wanted["motor_torque_inverse_N_m"]
    assert np.abs(found["motor_torque_N_m"] - torque).max() < 0.01 * np.ptp(torque)
    linear = ["--force-column", "motor_linear_rad"]
    assert run(["simulate", str(scenario), "--force", str(profile), "--out", str(hand / "sim.csv"), *linear]) == 0
    assert np.abs(columns(hand / "sim.csv")["angle_rad"] - wanted["reference_rad"]).max() > 0.01


@pytest.mark.usefixtures("unpainted")
def test_a_pair_is_designed(tmp_path: Path, examples: Path) -> None:
    assert run(["design", str(examples / "instrument_pair.toml"), "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text("utf-8"))
    assert math.degrees(summary["compensators"]["inverse"]["presliding"]["rmse_rad"]) < 0.05
    assert "loop" not in summary
    profile = columns(tmp_path / "profile.csv")
    assert {"motor_open_rad", "motor_close_rad", "tension_open_N", "tension_close_N"} <= profile.keys()
    assert min(profile["tension_open_N"].min(), profile["tension_close_N"].min()) == pytest.approx(3.0)


COARSE = ("step_s = 0.001", "step_s = 0.002")


def variant(examples: Path, tmp_path: Path, *changes: tuple[str, str], name: str = "hand_joint") -> Path:
    text = (examples / f"{name}.toml").read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "s.toml"
    path.write_text(text, "utf-8")
    return path


def test_a_wanted_torque_is_given_while_something_else_moves_the_joint(tmp_path: Path, examples: Path) -> None:
    reference = (
        '[reference]\nquantity = "joint_torque"\nkind = "sine"\namplitudes_N_m = [0.02]\nfrequencies_Hz = [1.3]\n'
        'fade_in_s = 0.4\nduration_s = 1.5\n[reference.motion]\nkind = "sine"\namplitudes_rad = [0.3]\n'
        "frequencies_Hz = [0.8]\nfade_in_s = 0.4\nduration_s = 1.5\n[run]"
    )
    text = (examples / "instrument_pair.toml").read_text("utf-8")
    head, _, tail = text.partition("[reference]")
    (tmp_path / "s.toml").write_text(head + reference + tail.partition("[run]")[2], "utf-8")
    result = design_motors(load_scenario(tmp_path / "s.toml"))
    assert result.percent(result.profiles["inverse"].rms) < 1.0
    assert result.percent(result.profiles["linear"].rms) > 5.0
    assert "N m" in result.headline


def test_a_cycle_is_designed_in_its_steady_state(tmp_path: Path, examples: Path) -> None:
    text = (examples / "instrument_pair.toml").read_text("utf-8").partition("[reference]")[0]
    text += (
        '[reference]\nkind = "sine"\namplitudes_rad = [0.5]\nfrequencies_Hz = [1.0]\nduration_s = 1.0\n'
        'periodic = true\n[run]\nstep_s = 0.002\nlevel = "presliding"\n'
    )
    (tmp_path / "s.toml").write_text(text, "utf-8")
    result = design_motors(load_scenario(tmp_path / "s.toml"))
    assert math.degrees(result.profiles["inverse"].rms) < 0.1
    ends = result.profiles["inverse"].motor_rad[[0, -1]]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6


def test_limits_of_the_motor_are_reported(tmp_path: Path, examples: Path) -> None:
    path = variant(
        examples,
        tmp_path,
        ("speed_max_rad_per_s = 8.0", "speed_max_rad_per_s = 2.0"),
        ("torque_max_N_m = 1.0", "torque_max_N_m = 0.05"),
        COARSE,
    )
    result = design_motors(load_scenario(path))
    text = " ".join(result.warnings)
    assert "speed_max_rad_per_s is 2" in text
    assert "torque_max_N_m is 0.05" in text
    speed = np.abs(np.diff(result.profiles["inverse"].motor_rad, axis=0)).max() / 2e-3
    assert speed <= 2.0 * (1 + 1e-9)


def test_a_pretension_is_too_much_only_where_no_angle_in_range_asks_for_it(tmp_path: Path, examples: Path) -> None:
    """A small reference asks for little; the template's 5 N are for what a live one may want within range_rad."""
    small = ("angles_rad = [0.0, 0.9, 0.9, 0.3, 1.1, 0.0]", "angles_rad = [0.0, 0.25, 0.25, 0.1, 0.3, 0.0]")
    narrow = ("range_rad = [-0.5, 1.6]", "range_rad = [-0.1, 0.3]")

    def said(*changes: tuple[str, str]) -> str:
        path = variant(examples, tmp_path, COARSE, small, *changes)
        return " ".join(design_motors(load_scenario(path), compensators=("linear", "inverse")).warnings)

    assert "pretension_N" not in said()
    assert "pretension_N = 5 is more than" in said(narrow)


def test_commands_that_shake_a_joint_without_damping_are_reported(tmp_path: Path, examples: Path) -> None:
    calm = design_motors(load_scenario(variant(examples, tmp_path, COARSE)))
    light = ("damping_N_m_s_per_rad = 2.0e-3", "damping_N_m_s_per_rad = 2.0e-4")
    shaken = design_motors(load_scenario(variant(examples, tmp_path, COARSE, light)))
    assert not any("rings at" in text for text in calm.warnings)
    assert any("the joint rings at 40.3 Hz with 1 %" in text for text in shaken.warnings)
    assert shaken.profiles["inverse"].rms > 3 * calm.profiles["inverse"].rms


def drive(**values: float) -> JointDrive:
    return JointDrive(kind=DriveKind.LOOP, drum_radius_m=(8e-3,), pretension_N=10.0, **values)


def test_a_stated_time_is_kept_beside_a_class_of_drives_zero_too(examples: Path) -> None:
    """Of lag and delay, what is not stated is assumed, with a spread that counts."""
    assumed = drive(drive_class=DriveClass.DYNAMIXEL)
    known = replace(assumed, servo_time_s=0.0)
    assert assumed.servo.servo_time_s > 0
    assert (known.servo.servo_time_s, known.servo.delay_s) == (0.0, assumed.servo.delay_s)
    mechanism = load_scenario(examples / "hand_joint.toml").mechanism
    doubt = Doubt.of(replace(mechanism, drive=known), Uncertainty(mu=0.1, samples=2))
    assert [spread.name for spread in doubt.spreads] == ["mu", "drive.delay_s"]


def test_the_lag_of_a_servo_is_taken_back() -> None:
    time = np.arange(0, 2, 1e-3)
    wanted = (np.sin(3 * time) * np.minimum(time, 1) ** 2)[:, None]
    slow = drive(servo_time_s=0.03)
    late = driven(slow, wanted, 1e-3) - wanted
    led = driven(slow, commanded(slow, wanted, 1e-3), 1e-3) - wanted
    assert np.abs(late).max() > 0.05
    assert np.abs(led).max() < 1e-4


def test_the_play_of_a_gear_is_crossed_at_every_reversal() -> None:
    time = np.arange(0, 2, 1e-3)
    wanted = (np.sin(3 * time) * np.minimum(time, 1) ** 2)[:, None]
    loose = drive(backlash_rad=0.04)
    late = driven(loose, wanted, 1e-3) - wanted
    led = driven(loose, commanded(loose, wanted, 1e-3), 1e-3) - wanted
    assert np.abs(late).max() == pytest.approx(0.02)
    turning = loose.turning_rad
    assert np.abs(led).max() <= turning + 1e-12
    assert np.abs(led[np.abs(np.gradient(wanted[:, 0])) > 1e-3]).max() < 1e-12
    slow = drive(backlash_rad=0.04, speed_max_rad_per_s=4.0)
    assert np.abs(np.diff(commanded(slow, wanted, 1e-3), axis=0)).max() <= 4e-3 * (1 + 1e-9)


def test_tensions_keep_the_gears_of_a_pair_on_one_side() -> None:
    pair = JointDrive(kind=DriveKind.PAIR, drum_radius_m=(8e-3,), least_tension_N=2.0, backlash_rad=0.04)
    wanted = np.sin(np.arange(0, 2, 1e-2))[:, None]
    assert np.array_equal(driven(pair, commanded(pair, wanted, 1e-2), 1e-2), wanted)


def test_a_servo_hears_rounded_commands_at_its_own_pace() -> None:
    time = np.arange(0, 1, 1e-3)
    wanted = (0.3 * time)[:, None]
    coarse = driven(drive(resolution_rad=0.01, command_interval_s=0.05), wanted, 1e-3)
    assert np.abs(coarse - wanted).max() <= 0.005 + 1e-9
    assert np.abs(coarse[::50] / 0.01 - np.round(coarse[::50] / 0.01)).max() < 1e-9


@pytest.mark.usefixtures("unpainted")
def test_a_homing_stroke_wipes_out_what_was_stored(tmp_path: Path, examples: Path) -> None:
    """Another start, whose tendons were left as a stroke the other way leaves them."""
    ideal = [("resolution_rad = 0.00153 ", "homing_rad = 0.2 "), ("command_interval_s = 0.01 ", "gear_ratio = 1.0 ")]
    ideal += [("gear_ratio = 1.0                      # turns", "# turns")]
    path = variant(examples, tmp_path, *ideal, COARSE)
    scenario = load_scenario(path)
    result = design_motors(scenario)
    result.write(tmp_path / "out")
    home, profile = columns(tmp_path / "out" / "homing.csv"), columns(tmp_path / "out" / "profile.csv")
    assert list(home) == ["time_s", "reference_rad", "motor_rad"]
    assert math.degrees(result.profiles["inverse"].rms) < 0.05
    assert abs(profile["motor_inverse_rad"][0] - home["motor_rad"][-1]) < 1e-3
    assert abs(profile["motor_inverse_rad"][0]) > 0.005  # friction stores what the stroke leaves

    wanted = profile["reference_rad"]
    problem = joint_problem(scenario.mechanism, scenario.run.level, result.task.sampled.motion)
    swing = 0.1 * np.sin(np.linspace(0, np.pi, 200)) ** 2  # joint turned and let back before anything begins
    commands = np.concatenate([home["motor_rad"], profile["motor_inverse_rad"]])
    errors = []
    for motor in (commands, profile["motor_inverse_rad"] - profile["motor_inverse_rad"][0]):
        run = simulate_joint(problem, np.concatenate([swing, motor]), scenario.run.step_s).require()
        errors.append(np.rad2deg(np.abs(run.angle_rad[-len(wanted) :] - wanted).max()))
    assert errors[0] < 0.05
    assert errors[1] > 10 * errors[0]


def test_a_compensator_that_fails_does_not_end_the_design(examples, tmp_path):
    def fails(_task):
        raise FloatingPointError("divide by zero")

    scenario = load_scenario(variant(examples, tmp_path, COARSE))
    broken = replace(compensator_of(scenario, "static"), profile=fails)
    given = ("linear", broken, "inverse")
    result = design_motors(scenario, compensators=given)
    assert set(result.profiles) == {"linear", "inverse"}
    assert replace(result, failed={}).is_usable
    pushing = replace(result.inversion, status=JointStatus.WOULD_PUSH)
    assert not replace(result, failed={}, inversion=pushing).is_usable  # the command ends with exit code 1
    assert not result.is_usable
    assert any("static: failed: FloatingPointError: divide by zero" in each for each in result.warnings)


def test_a_cycle_that_has_not_settled_is_said(monkeypatch):
    scenario = load_scenario(Path(__file__).parents[3] / "golden" / "spring_cycle.toml")
    task = joint.JointTask.of(scenario)
    command = task.commanded(task.inversion.motor_rad)
    assert not task.respond(task.mechanism, command).message.startswith(UNSETTLED)
    monkeypatch.setattr(joint, "_STEADY", 0.0)
    assert "after 4 periods" in task.respond(task.mechanism, command).message


def test_notes_asked_first_raise_the_error_that_names_the_file(examples, tmp_path, monkeypatch):
    def fails(*_):
        raise ParameterError("moment arms change their sign")

    monkeypatch.setattr(joint, "inverse_of", fails)
    with pytest.raises(InputError, match=r"s.toml: moment arms change their sign"):
        _ = joint.JointTask.of(load_scenario(variant(examples, tmp_path, COARSE))).notes
