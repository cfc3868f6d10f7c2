"""Scenario files of a driven joint."""

from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.driven.joint import parse_joint_scenario, sample_joint
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.models.joint.parameters import DriveKind


@pytest.fixture(scope="module")
def hand() -> str:
    return (Path(__file__).parents[3] / "examples" / "hand_joint.toml").read_text("utf-8")


@pytest.mark.parametrize(("rig", "example"), [("hand", "hand_joint"), ("instrument", "instrument_pair")])
def test_new_writes_the_example(tmp_path: Path, examples: Path, rig: str, example: str) -> None:
    assert run(["new", str(tmp_path / "mine.toml"), "--for", rig]) == 0
    assert (tmp_path / "mine.toml").read_text("utf-8") == (examples / f"{example}.toml").read_text("utf-8")
    scenario = load_scenario(tmp_path / "mine.toml")
    assert scenario.mechanism.drive.kind is (DriveKind.LOOP if rig == "hand" else DriveKind.PAIR)
    assert sample_joint(scenario).range > 0.5


def test_new_names_the_joint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "index.toml"
    assert run(["new", str(file), "--for", "hand", "--joint", "index_base"]) == 0
    assert load_scenario(file).mechanism.joint.name == "index_base"
    assert run(["new", str(tmp_path / "b.toml"), "--for", "hand", "--joint", "index base"]) == 2
    assert run(["new", str(tmp_path / "b.toml"), "--joint", "index_base"]) == 2
    assert "the other rigs have none or several" in capsys.readouterr().err


def test_joints_of_a_hand_share_a_base(hand: str, tmp_path: Path) -> None:
    base = hand.replace("[joints.knuckle]", "[joints.old]")
    (tmp_path / "hand.toml").write_text(base, "utf-8")
    own = 'schema = 1\nbase = "hand.toml"\n[joints.tip]\nkind = "driven"\ninertia_kg_m2 = 1.0e-5\n'
    own += "[path]\ntotal_angle_rad = 4.0\n"
    (tmp_path / "tip.toml").write_text(own, "utf-8")
    found = load_scenario(tmp_path / "tip.toml")
    assert (found.mechanism.joint.name, found.mechanism.joint.gravity_N_m) == ("tip", 0.0)  # a joint is its own
    path = found.mechanism.tendons[0].path
    assert (path.total_angle_rad, path.segments) == (4.0, 6)
    assert found.mechanism.drive.pretension_N == 5.0
    before = found.digest()
    (tmp_path / "hand.toml").write_text(base.replace("pretension_N = 5.0", "pretension_N = 6.0"), "utf-8")
    assert load_scenario(tmp_path / "tip.toml").digest() != before
    (tmp_path / "other.toml").write_text('schema = 1\nbase = "tip.toml"\n[path]\nsegments = 8\n', "utf-8")
    below = load_scenario(tmp_path / "other.toml")  # a base has a base: keys of the nearest file win
    path = below.mechanism.tendons[0].path
    assert (below.mechanism.joint.name, path.total_angle_rad, path.segments) == ("tip", 4.0, 8)
    assert below.mechanism.drive.pretension_N == 6.0
    assert [file.name for file in below.inputs] == ["tip.toml", "hand.toml"]
    (tmp_path / "hand.toml").write_text('schema = 1\nbase = "tip.toml"\n', "utf-8")
    with pytest.raises(
        InputError, match=r'hand.toml: base = "tip.toml" .* leads back to tip.toml; take one of them out'
    ):
        load_scenario(tmp_path / "other.toml")


def test_a_tendon_may_state_its_own_parts(hand: str) -> None:
    own = hand.replace(
        "moment_arm_m = -0.008 ",
        "moment_arm_m = -0.006\n[tendons.friction]\nmu_dynamic = 0.1\nmu_static = 0.1\nviscous_N_s_per_m = 0.0\n"
        "bristle_stiffness_N_per_m = 1e6\nsoft_bristle_stiffness_N_per_m = 1e5\n",
    )
    first, second = parse_joint_scenario(own).mechanism.tendons
    assert (first.friction.mu_dynamic, second.friction.mu_dynamic) == (0.2, 0.1)
    assert first.tendon == second.tendon


def test_lengths_of_a_file_are_moment_arms(hand: str, tmp_path: Path) -> None:
    (tmp_path / "flexor.csv").write_text("angle_rad,length_m\n-1,0.208\n0,0.2\n1,0.192\n2,0.184\n", "utf-8")
    (tmp_path / "s.toml").write_text(hand.replace("moment_arm_m = 0.008", 'lengths = "flexor.csv"'), "utf-8")
    scenario = load_scenario(tmp_path / "s.toml")
    assert scenario.mechanism.arms_at(0.3) == pytest.approx((0.008, -0.008))
    before = scenario.digest()
    (tmp_path / "flexor.csv").write_text("angle_rad,length_m\n-1,0.209\n0,0.2\n1,0.191\n2,0.182\n", "utf-8")
    assert load_scenario(tmp_path / "s.toml").digest() != before


@pytest.mark.parametrize(
    ("example", "old", "new", "who"),
    [
        ("hand_joint", "moment_arm_m = 0.008", 'lengths = "nothere.csv"', r"\[tendons 1\]: lengths"),
        ("finger_moving", "", '[joints.{name}]\nkind = "csv"\nfile = "nothere.csv"\n', r"\[joints.\w+\]: file"),
        (
            "three_joint_finger",
            'kind = "driven"',
            'kind = "driven"\ntorques = "nothere.csv"',
            r"\[joints.\w+\]: torques",
        ),
    ],
)
def test_a_file_of_a_joint_or_tendon_that_is_missing_is_refused_with_who_names_it(
    example: str, old: str, new: str, who: str, examples: Path, tmp_path: Path
) -> None:
    text = (examples / f"{example}.toml").read_text("utf-8")
    if not old:
        old = text[text.index("[joints.") :].split("\n[")[0]
        new = new.format(name=old.partition("[joints.")[2].partition("]")[0])
    (tmp_path / "s.toml").write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError, match=f"{who} names nothere.csv, which is not in /"):
        tf.design(load_scenario(tmp_path / "s.toml"))


def test_the_fade_of_a_sine_has_no_jump_in_its_rate() -> None:
    example = Path(__file__).parents[3] / "examples" / "instrument_pair.toml"
    angle = sample_joint(load_scenario(example)).angle_rad
    assert np.abs(np.diff(angle, 2)).max() < 5e-4
    assert angle[0] == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[drive]",
            "[actuator]\nmass_kg = 1\n[drive]",
            r"\[actuator\] does not belong .* the motors stand in \[drive\]",
        ),
        ("[drive]", "[stiffness]\nx = 1\n[drive]", "no stiffness to choose"),
        ("[drive]", "[drives]", r"unknown table \[drives\], did you mean drive"),
        ('kind = "driven"', 'kind = "constant"\nangle_rad = 0.0', "one joint must have kind"),
        ('kind = "driven"', 'kind = "drivn"', 'got "drivn"'),
        ("moment_arm_m = -0.008", "moment_arm_m = 0.008", None),
        ("pretension_N = 5.0", "", "needs pretension_N"),
        ("pretension_N = 5.0", "pretension_N = -1.0", "pretension_N must be a finite number >= 0"),
        ("moment_arm_m = 0.008", "moment_arms_m = 0.008", 'unknown key "moment_arms_m", did you mean "moment_arm_m"'),
        ("moment_arm_m = 0.008 ", "", "moment_arm_m or lengths, one of them"),
        ('quantity = "joint_angle"', 'quantity = "joint_torque"', "angles_rad is not for quantity"),
        ('name = "extensor"', 'name = "flexor"', "need different names"),
        ("angles_rad = [0.0, 0.9, 0.9, 0.3, 1.1, 0.0]", "angles_rad = [0, 0, 0, 0, 0, 0]", "it never changes"),
        ("[path] ", "[pathx] ", r"unknown table \[pathx\]"),
        ("drum_radius_m = 0.008", "drum_radius_m = [0.008, 0.008, 0.008]", "one for each of 2 tendons"),
    ],
)
def test_what_is_wrong_is_refused_with_the_way_out(hand: str, old: str, new: str, message: str | None) -> None:
    assert old in hand
    if message is None:  # refused where the joint stands
        scenario = parse_joint_scenario(hand.replace(old, new))
        with pytest.raises(ValueError, match="must pull opposite ways"):
            scenario.mechanism.arms_at(0.0)
        return
    with pytest.raises(InputError, match=message):
        sample_joint(parse_joint_scenario(hand.replace(old, new)))


STOPS = "stop_high_rad = {high}\nstop_low_rad = {low}\nstop_stiffness_N_m_per_rad = 100.0\n[path] "


def stopped(hand: str, low: float, high: float) -> str:
    return hand.replace("[path] ", STOPS.format(low=low, high=high), 1)


def test_a_reference_beyond_a_stop_is_taken_back_to_it_smoothly_and_says_stop_and_time(hand: str) -> None:
    free = sample_joint(parse_joint_scenario(hand))
    kept = sample_joint(parse_joint_scenario(stopped(hand, -0.5, 1.0)))
    (warning,) = kept.warnings
    assert "it goes to 1.1 rad at t = 2.2 s, beyond stop_high_rad = 1 of the joint" in warning
    assert kept.angle_rad.max() <= 1.0
    assert kept.angle_rad.max() == pytest.approx(1.0, abs=1e-12)
    far = free.angle_rad < 0.95
    assert np.array_equal(kept.angle_rad[far], free.angle_rad[far])
    bend, clipped = (np.abs(np.diff(x, 2)).max() for x in (kept.angle_rad, np.minimum(free.angle_rad, 1.0)))
    assert bend < 0.1 * clipped  # the speed does not jump
    assert np.array_equal(kept.wanted, kept.angle_rad)
    assert sample_joint(parse_joint_scenario(stopped(hand, -0.5, 1.2))).warnings == ()


@pytest.mark.compiler
def test_a_design_names_the_stop_or_refuses_it_where_strict(
    hand: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "hand.toml"
    file.write_text(stopped(hand, 0.2, 1.25), "utf-8")
    assert run(["design", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "start within the stops" in capsys.readouterr().err
    quick = hand.replace("0.9, 0.3, 1.1", "0.9, 0.3, 3.1").replace("step_s = 0.001", "step_s = 0.004")
    file.write_text(stopped(quick.replace("segments = 6", "segments = 2"), -0.5, 1.0), "utf-8")
    assert run(["design", str(file), "--out", str(tmp_path / "out"), "--strict"]) == 2
    assert "it goes to 3.1 rad at t = 2.2 s, beyond stop_high_rad = 1" in capsys.readouterr().err
    result = design_motors(load_scenario(file), strict=False)
    assert any("taken back to the stop" in text for text in result.warnings)
    assert result.inversion.tension_N.max() < 60.0  # in silence it was 3 kN


def test_one_tendon_without_a_spring_is_refused(hand: str) -> None:
    head, _, rest = hand.partition('[[tendons]]\nname = "extensor"')
    alone = head + "[drive]" + rest.partition("[drive]")[2]
    with pytest.raises(InputError, match="needs two tendons, got 1"):
        parse_joint_scenario(alone)
    pair = alone.replace('kind = "loop" ', 'kind = "pair" ').replace("pretension_N = 5.0 ", "least_tension_N = 2.0 ")
    with pytest.raises(InputError, match="needs a spring that pulls the other way"):
        parse_joint_scenario(pair)


def test_commands_of_a_tension_refuse_a_joint_and_say_why(
    tmp_path: Path, examples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["experiment", str(examples / "hand_joint.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "holds one tendon between two motors" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
