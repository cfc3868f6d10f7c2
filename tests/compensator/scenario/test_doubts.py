"""What is asked about a scenario before anything is computed."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError, read_csv
from tendonff.compensator.files.writing import write_text
from tendonff.compensator.scenario.doubts import (
    feedback_doubts,
    force_doubts,
    force_notes,
    length_doubts,
    out_of_reach,
    reference_doubts,
    scenario_doubts,
)
from tendonff.compensator.scenario.driven.finger import FingerScenario, parse_finger_scenario
from tendonff.compensator.scenario.driven.finger_doubts import finger_doubts
from tendonff.compensator.scenario.driven.joint_doubts import driven_doubts, joint_doubts
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, SineJoint, WaypointJoint
from tendonff.compensator.scenario.sampled.first_look import first_look
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario
from tendonff.compensator.scenario.settings import Feedback, FeedbackSensor
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.drive import Motor

ROOT = Path(__file__).resolve().parents[3]
FILES = (*(ROOT / "examples").glob("*.toml"), *(ROOT / "compensator" / "scenario").rglob("*.toml"))
OF_A_TENDON = sorted(path for path in FILES if isinstance(load_scenario(path), Scenario))
OF_JOINTS = sorted(path for path in FILES if not isinstance(load_scenario(path), Scenario))
OF_A_FINGER = [path for path in OF_JOINTS if isinstance(load_scenario(path), FingerScenario)]
OF_A_JOINT = [path for path in OF_JOINTS if path not in OF_A_FINGER]


@pytest.fixture(scope="module")
def finger() -> Scenario:
    return load_scenario(ROOT / "examples" / "finger.toml")


@pytest.mark.parametrize("path", OF_A_TENDON, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_nothing_is_asked_about_a_sound_scenario(path: Path) -> None:
    found = first_look(load_scenario(path))
    assert [note for note in found if "?" in note or "needs" in note] == []


@pytest.mark.parametrize("path", OF_A_JOINT, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_nothing_is_asked_about_a_sound_joint(path: Path) -> None:
    assert joint_doubts(load_scenario(path)) == ()


@pytest.mark.parametrize("path", OF_A_FINGER, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_nothing_is_asked_about_a_sound_finger(path: Path) -> None:
    assert finger_doubts(load_scenario(path)) == ()


def refusal(scenario: Scenario) -> str:
    """Message with which a scenario is refused at the first look."""
    with pytest.raises(InputError) as refused:
        first_look(scenario)
    return str(refused.value)


def changed(scenario: Scenario, key: str, factor: float) -> Scenario:
    """The scenario with a key of its transmission, or step_s, times a factor."""
    table, name = key.split(".")
    if table == "run":
        return replace(scenario, run=replace(scenario.run, **{name: factor * scenario.run.step_s}))
    part = getattr(scenario.transmission, table)
    values = {name: factor * getattr(part, name)}
    if name == "mu_dynamic":
        values["mu_static"] = values[name]
    part = replace(part, **values)
    return replace(scenario, transmission=replace(scenario.transmission, **{table: part}))


@pytest.mark.parametrize("example", ["finger", "bowden", "surgical"])
@pytest.mark.parametrize(
    ("key", "factor", "question"),
    [
        ("path.total_angle_rad", 180 / math.pi, "turns: degrees?"),
        ("path.radius_m", 1e3, "millimetres?"),
        ("tendon.mass_kg", 1e3, "grams?"),
        ("tendon.stiffness_N_per_m", 1e-3, "N/mm?"),
        ("tendon.stiffness_N_per_m", 1e6, "a diameter in millimetres?"),
        ("friction.mu_dynamic", 100, "per cent?"),
        ("friction.soft_bristle_stiffness_N_per_m", 1e-3, "N/mm?"),
        ("actuator.mass_kg", 1e3, "grams?"),
        ("load.mass_kg", 1e3, "grams?"),
        ("load.stiffness_N_per_m", 1e-3, "N/mm?"),
        ("path.segments", 100, "so many masses take long"),
        ("run.step_s", 1e3, "milliseconds? Then it is 0.001"),
        ("actuator.force_max_N", 1e-3, "kN? Then it is"),
    ],
)
def test_a_value_in_another_unit_is_refused_by_its_key_and_accepted_by_it(
    example: str, key: str, factor: float, question: str
) -> None:
    """The usual wrong units of every rig that is shipped, by their factor."""
    scenario = load_scenario(ROOT / "examples" / f"{example}.toml")
    odd = changed(scenario, key, factor)
    message, (table, name) = refusal(odd), key.split(".")
    assert re.search(rf"\[{table}\] {name} = .*{re.escape(question)}", message)
    assert re.search(rf'--yes .* accept = \[.*"{key}".*\] in \[run\]$', message)
    accepted = replace(odd, run=replace(odd.run, accept=(key,)))
    assert not any(doubt.key == key for doubt in scenario_doubts(accepted))
    follows = key not in ("run.step_s", "friction.mu_dynamic")  # whose reference has no meaning then
    assert any(question in note for note in first_look(odd, follows_reference=follows, accept=True))


@pytest.mark.parametrize(
    ("changes", "question"),
    [
        ({"delay_s": 10.0}, "[feedback] delay_s = 10: milliseconds? Then it is 0.01"),
        ({"phase_margin_deg": 0.78}, "[feedback] phase_margin_deg = 0.78: radians? Then it is 44.69"),
        ({"resolution": 4096.0}, "[feedback] resolution = 4096: steps a turn? Then it is 0.001534"),
    ],
)
def test_a_feedback_in_another_unit_is_asked_about(changes: dict[str, float], question: str) -> None:
    usual = Feedback(sensor=FeedbackSensor.JOINT_ANGLE, delay_s=0.01, resolution=2 * math.pi / 4096)
    assert not list(feedback_doubts(usual))
    assert [str(doubt) for doubt in feedback_doubts(replace(usual, **changes))] == [question]


@pytest.mark.parametrize("example", ["hand_joint", "instrument_pair"])
def test_a_tension_at_rest_that_no_tendon_bears_is_asked_about_by_its_key(example: str) -> None:
    """Not the stiffness of its tendons."""
    scenario = load_scenario(ROOT / "examples" / f"{example}.toml")
    drive = scenario.mechanism.drive
    key = "pretension_N" if drive.pretension_N else "least_tension_N"
    odd = replace(scenario, mechanism=replace(scenario.mechanism, drive=replace(drive, **{key: 15000.0})))
    assert {doubt.key for doubt in joint_doubts(odd, follows_reference=False)} == {f"drive.{key}"}


def test_the_range_of_a_live_joint_in_degrees_is_asked_about() -> None:
    """It guards a live reference: with degrees nothing is held."""
    scenario = load_scenario(ROOT / "examples" / "hand_joint.toml")
    joint = replace(scenario.mechanism.joint, range_rad=(-30.0, 90.0))
    [doubt] = driven_doubts(joint, 0.008)
    assert str(doubt).endswith("range_rad = 90: degrees? Then it is 1.571")


@pytest.mark.parametrize(
    ("duration_s", "step_s", "key"), [(4.0, 1e-7, "run.step_s"), (4000.0, 1e-3, "reference.duration_s")]
)
def test_too_many_steps_are_blamed_on_what_is_out_of_proportion(
    finger: Scenario, duration_s: float, step_s: float, key: str
) -> None:
    spec, run = replace(finger.reference, duration_s=duration_s), replace(finger.run, step_s=step_s)
    assert [doubt.key for doubt in length_doubts(spec, duration_s, run)] == [key]


@pytest.mark.parametrize(
    ("changes", "question"),
    [
        ({"drum_radius_m": 20.0}, "drum_radius_m = 20: millimetres?"),
        ({"inertia_kg_m2": 10.0}, "inertia_kg_m2 = 10 is 2.5e+06 kg at the drum: g cm2?"),
        ({"torque_max_N_m": 500.0}, "torque_max_N_m = 500 is 2.5e+05 N at the drum: mN m?"),
        ({"torque_max_N_m": 100.0}, "torque_max_N_m = 100 is 5e+04 N at the drum: mN m?"),
        ({"speed_max_rad_per_s": 9000.0}, "speed_max_rad_per_s = 9000: turns a minute? Then it is 942.5"),
        ({"gear_ratio": 0.05}, "gear_ratio = 0.05: the drum would turn faster than the motor; drum over motor?"),
    ],
)
def test_a_motor_in_another_unit_is_asked_about_by_its_key(
    finger: Scenario, changes: dict[str, float], question: str
) -> None:
    usual = Motor(
        drum_radius_m=0.02, gear_ratio=10.0, inertia_kg_m2=1e-5, torque_max_N_m=0.5, speed_max_rad_per_s=300.0
    )
    for motor, asked in ((usual, False), (replace(usual, **changes), True)):
        actuator = replace(finger.transmission.actuator, motor=motor, **motor.at_the_drum)
        found = scenario_doubts(replace(finger, transmission=replace(finger.transmission, actuator=actuator)))
        assert any(str(doubt).startswith(f"[actuator.motor] {question}") for doubt in found) is asked
        assert all(doubt.key.startswith("actuator.") for doubt in found)  # not the tendon that it would stretch


@pytest.mark.parametrize(
    "joint",
    [
        ConstantJoint(angle_rad=-45.0),
        SineJoint(amplitudes_rad=(30.0,), frequencies_Hz=(1.0,)),
        WaypointJoint(times_s=(0.0, 1.0), angles_rad=(0.0, 90.0)),
    ],
)
def test_a_joint_in_degrees_is_asked_about(finger: Scenario, joint: ConstantJoint | SineJoint | WaypointJoint) -> None:
    [doubt] = scenario_doubts(replace(finger, joints={"wrist": joint}))
    assert re.fullmatch(r"\[joints\.wrist\]: it turns to \d+ rad: degrees\? Then it is [\d.]+", str(doubt))


def test_a_joint_file_in_degrees_is_asked_about(finger: Scenario, tmp_path: Path) -> None:
    write_text(tmp_path / "j.csv", "time_s,wrist_rad\n0,0\n1,45\n4,0\n")
    moving = replace(finger, source=tmp_path / "x.toml", joints={"wrist": CsvJoint(file="j.csv")})
    assert "j.csv: wrist: it turns to 45 rad: degrees? Then it is 0.7854" in refusal(moving)


FILE = """
[reference]
kind = "csv"
file = "r.csv"
"""


def from_file(folder: Path, text: str, **keys: str) -> Scenario:
    """The finger with a reference from a file."""
    write_text(folder / "r.csv", text)
    scenario = (ROOT / "examples" / "finger.toml").read_text(encoding="utf-8")
    start, end = scenario.index("[reference]"), scenario.index("[run]")
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return parse_scenario(f"{scenario[:start]}{FILE}{lines}\n{scenario[end:]}", folder / "x.toml")


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "kN?"), (1.0, ""), (1e3, "mN?")])
def test_a_reference_file_in_another_unit_is_asked_about(tmp_path: Path, factor: float, unit: str) -> None:
    tensions = factor * np.array([20.0, 45.0, 20.0])
    rows = "".join(f"{t},{tension}\n" for t, tension in zip((0, 1, 2), tensions, strict=True))
    scenario = from_file(tmp_path, f"time_s,tension_N\n{rows}")
    if unit:
        assert f"{unit} Nothing was computed" in refusal(scenario)
    else:
        assert first_look(scenario) == ()


def test_the_peak_of_a_file_is_that_behind_its_low_pass(tmp_path: Path) -> None:
    """A spike of one sample, far out of reach, that the low-pass takes away."""
    time = np.arange(0, 2.0005, 1e-3)
    tension = np.where(np.arange(len(time)) == 1000, 200.0, 30.0 + 5 * time)
    rows = "time_s,tension_N\n" + "".join(f"{t:.3f},{v}\n" for t, v in zip(time, tension, strict=True))
    raw, filtered = (first_look(from_file(tmp_path, rows, **keys)) for keys in ({}, {"cutoff_Hz": "5"}))
    assert any("the peak of 200 N at t = 1 s needs" in doubt for doubt in raw)
    assert not any("the peak of" in doubt for doubt in filtered)


def test_reversed_columns_are_asked_about(tmp_path: Path) -> None:
    text = "time_s,tension_N\n30,0\n35,1\n32,2\n"
    with pytest.raises(InputError, match=r"tension_N starts at 0 and increases: are the two columns reversed\?"):
        first_look(from_file(tmp_path, text))
    write_text(tmp_path / "f.csv", "time_s,force_N\n0,30\n2,35\n1,32\n")
    with pytest.raises(InputError, match=r"time_s must increase, got 1 after 2$"):
        read_csv(tmp_path / "f.csv", ("time_s", "force_N"))


def test_what_the_peak_needs_is_the_capstan_law_and_the_drives_friction(finger: Scenario) -> None:
    """(T + p) e^{mu theta} - p + F_c."""
    rig = finger.transmission
    rig = replace(rig, actuator=replace(rig.actuator, coulomb_N=7.0), friction=replace(rig.friction, adhesion_N=3.0))
    needed = (150 + 3) * math.exp(0.2 * math.pi) - 3 + 7
    assert f"the peak of 150 N at t = 1.5 s needs {needed:.4g} N through the friction" in out_of_reach(rig, 1.5, 150.0)


@pytest.mark.parametrize(("force_N", "asked"), [(3e4, "mN?"), (0.03, "kN?"), (300.0, ""), (-40.0, "another sign?")])
def test_a_force_file_in_another_unit_is_asked_about(finger: Scenario, force_N: float, asked: str) -> None:
    force = np.array([0.5, 1.0]) * force_N
    found = force_doubts(finger.transmission, force, finger.run, file="f.csv")
    assert [str(doubt).endswith(asked) for doubt in found] == ([True] if asked else [])
    notes = force_notes(finger.transmission, force, 30.0, file="f.csv")
    assert any(note.endswith("simulated as it is") for note in notes) is (force_N > 200 or force_N < 0)


@pytest.mark.parametrize(
    ("table", "key", "value", "question"),
    [
        ("actuator", "servo_time_s", 20.0, "milliseconds? Then it is 0.02"),
        ("actuator", "delay_s", 5.0, "milliseconds? Then it is 0.005"),
        ("friction", "soft_bristle_stiffness_N_per_m", 600.0, "N/mm? Then it is 600000"),
    ],
)
def test_a_slip_by_a_thousand_of_a_lag_or_a_contact_is_refused(
    table: str, key: str, value: float, question: str
) -> None:
    """Bristles of 600 N/m for 600 N/mm made 0.4 % of 8.7, and a lag of 20 s a command of 120 kN."""
    scenario = load_scenario(ROOT / "examples" / "bowden.toml")
    part = replace(getattr(scenario.transmission, table), **{key: value})
    odd = replace(scenario, transmission=replace(scenario.transmission, **{table: part}))
    assert [doubt.key for doubt in scenario_doubts(odd)] == [f"{table}.{key}"]
    assert question in str(next(iter(scenario_doubts(odd))))


def test_a_reference_in_kN_is_asked_for() -> None:
    scenario = load_scenario(ROOT / "examples" / "bowden.toml")
    found = reference_doubts(scenario.transmission, np.linspace(0.04, 0.3, 9), scenario.run)
    assert [str(doubt) for doubt in found] == ["[reference] the tension stays below 0.3 N: kN?"]


@pytest.mark.parametrize(
    ("old", "new", "asked"),
    [
        ("rad = [0.0, 0.9, 0.9, 0.3, 1.1", "rad = [0, 50, 50, 20, 60", "[reference] angles_rad = 60: degrees? Then"),
        ("moment_arm_m = 0.008", "moment_arm_m = 8", "[tendons] moment_arm_m = 8: millimetres? Then it is 0.008"),
        ("drum_radius_m = 0.008", "drum_radius_m = 8.0", "[drive] drum_radius_m = 8: millimetres? Then it is 0.008"),
        ("gear_ratio = 1.0", "gear_ratio = 0.01", "[drive] gear_ratio = 0.01: the drum would turn faster"),
        ("step_s = 0.001", "step_s = 1", "[run] step_s = 1: milliseconds? Then it is 0.001"),
        ("command_interval_s = 0.01", "delay_s = 10", "[drive] delay_s = 10: milliseconds? Then it is 0.01"),
        ("command_interval_s = 0.01", "command_interval_s = 10", "[drive] command_interval_s = 10: milliseconds?"),
        ("times_s = [0.0, 0.6, 1.0, 1.5, 2.2, 3.0]", "times_s = [0, 600, 1000, 1500, 2200, 4000]", "4000000 steps"),
        ("total_angle_rad = 3.0", "total_angle_rad = 170", "[path] total_angle_rad = 170 is 27.1 turns: degrees?"),
        ("stiffness_N_per_m = 2.0e4", "stiffness_N_per_m = 20.0", "[tendon] stiffness_N_per_m = 20: softer"),
        ("mass_kg = 0.001", "mass_kg = 1.0", "[tendon] mass_kg = 1: grams? Then it is 0.001"),
        ("mu_dynamic = 0.2", "mu_dynamic = 2 #", "[friction] mu_dynamic = 2: per cent? Then it is 0.02"),
        ("torque_max_N_m = 1.0", "torque_max_N_m = 1000.0", "[drive] torque_max_N_m = 1000 is 1.25e+05 N at the drum"),
        ("speed_max_rad_per_s = 8.0", "speed_max_rad_per_s = 5000.0", "speed_max_rad_per_s = 5000: turns a minute?"),
        ("# stop_stiffness_N_m_per_rad", "stop_high_rad = 72\nstop_stiffness_N_m_per_rad", "high_rad = 72: degrees?"),
    ],
)
def test_a_joint_in_another_unit_is_refused_by_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, asked: str
) -> None:
    """The first mistakes that users made: thirty degrees as 30 rad ended in "1700 deg RMS, next: export-c"."""
    text = (ROOT / "compensator" / "scenario" / "templates" / "hand.toml").read_text(encoding="utf-8")
    assert old in text
    write_text(tmp_path / "odd.toml", text.replace(old, new, 1))
    assert run(["design", str(tmp_path / "odd.toml"), "--out", str(tmp_path / "o")]) == 2
    message = capsys.readouterr().err
    assert asked in message
    assert "Nothing was computed" in message
    assert not (tmp_path / "o").exists()
    [key] = re.findall(r'accept = \["([^"]*)"\]', message)
    write_text(tmp_path / "odd.toml", text.replace(old, new, 1).replace("[run]\n", f'[run]\naccept = ["{key}"]\n'))
    assert joint_doubts(load_scenario(tmp_path / "odd.toml")) == ()


def test_the_file_of_a_joints_reference_is_asked_about_by_its_name(tmp_path: Path) -> None:
    text = (ROOT / "compensator" / "scenario" / "templates" / "hand.toml").read_text(encoding="utf-8")
    head, tail = text.split("[reference]")
    reference = '[reference]\nkind = "csv"\nfile = "wanted.csv"\n'
    write_text(tmp_path / "hand.toml", head + reference + tail[tail.index("[run]") :])
    write_text(tmp_path / "wanted.csv", "time_s,angle_rad\n0,0\n400,60\n900,0\n")
    long, turned = joint_doubts(load_scenario(tmp_path / "hand.toml"))
    assert long.key == turned.key == "reference.file"
    assert str(long).startswith("[reference] file: 900 s in steps of 0.001 s are 900000 steps")
    assert str(turned) == "wanted.csv: angle_rad: it turns to 60 rad: degrees? Then it is 1.047"


@pytest.mark.parametrize(
    ("old", "new", "key", "asked"),
    [
        ("offset_rad = 0.7", "offset_rad = 40", "reference.joints.mcp.offset_rad", "= 40: degrees? Then it is 0.698"),
        ("[0.35]", "[20.0]", "reference.joints.pip.amplitudes_rad", "amplitudes_rad = 20: degrees?"),
        ("duration_s = 3.0", "duration_s = 3000.0", "reference.duration_s", "3000000 steps"),
        ("_m = 0.014", "_m = 14", "tendons.path.sections.length_per_rad_m", "length_per_rad_m = 14: millimetres?"),
        ("{ extensor = 0.008 }", "{ extensor = 8 }", "motors.drums_m", "drums_m = 8: millimetres? Then it is 0.008"),
        ('name = "m4"', 'name = "m4"\ngear_ratio = 0.01', "motors.gear_ratio", "the drum would turn faster"),
        ("step_s = 1e-3", "step_s = 1", "run.step_s", "step_s = 1: milliseconds?"),
        (
            "inertia_kg_m2 = 1e-4",
            "inertia_kg_m2 = 1e-4\nrest_rad = 30",
            "joints.mcp.rest_rad",
            "rest_rad = 30: degrees?",
        ),
    ],
)
def test_a_finger_in_another_unit_is_asked_about_by_its_key(old: str, new: str, key: str, asked: str) -> None:
    text = (ROOT / "examples" / "three_joint_finger.toml").read_text(encoding="utf-8")
    assert old in text
    [doubt] = finger_doubts(parse_finger_scenario(text.replace(old, new)))
    assert (doubt.key, asked in doubt.text) == (key, True)
    accepted = text.replace(old, new).replace("[run]\n", f'[run]\naccept = ["{key}"]\n')
    assert finger_doubts(parse_finger_scenario(accepted)) == ()


def test_doubts_said_before_the_work_are_not_said_again_after_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "examples" / "finger.toml").read_text(encoding="utf-8").replace("0.15  ", "150.0  ", 1)
    write_text(tmp_path / "odd.toml", text)
    write_text(tmp_path / "f.csv", "time_s,force_N\n0,30\n0.01,31\n")
    files = ["--force", str(tmp_path / "f.csv"), "--out", str(tmp_path / "o.csv")]
    assert run(["simulate", str(tmp_path / "odd.toml"), *files]) == 2
    capsys.readouterr()
    for _ in range(2):  # and each command says them anew
        assert run(["simulate", str(tmp_path / "odd.toml"), *files, "--yes"]) == 0
        assert capsys.readouterr().err.count("[actuator] mass_kg = 150: grams?") == 1


def test_a_filtered_peak_out_of_reach_is_said_without_the_filter(tmp_path: Path) -> None:
    """Which takes a second to import; what a mean over half its period keeps is no spike."""
    time = np.arange(0, 2.0005, 1e-3)
    rows = "time_s,tension_N\n" + "".join(f"{t:.3f},{30 + 170 * (0.8 < t < 1.2)}\n" for t in time)
    found = first_look(from_file(tmp_path, rows, cutoff_Hz="5"))
    assert [
        doubt for doubt in found if "the peak of 200 N" in doubt and doubt.endswith("(before the low-pass at 5 Hz)")
    ]
