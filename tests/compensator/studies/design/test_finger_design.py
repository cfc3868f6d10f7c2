"""A finger from its scenario to motor angles."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tendonff as tf
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.sheet import joint_sheets, tendon_sheets
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.runtime.kinds import RuntimeStatus
from tendonff.compensator.scenario.driven.finger import parse_finger_scenario, sample_finger
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.compensator.studies.design.sweep.run import sweep
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.mechanism.response import MechanismStatus

EXAMPLE = Path("examples/three_joint_finger.toml")
SHORT = (
    EXAMPLE.read_text("utf-8")
    .replace("duration_s = 3.0", "duration_s = 0.6")
    .replace("fade_in_s = 0.5", "fade_in_s = 0.3")
)


def scenario(text=SHORT, *changes):
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return parse_finger_scenario(text, EXAMPLE)


@pytest.fixture(scope="module")
def designed():
    return design_motors(scenario())


@pytest.mark.compiler
def test_the_exact_inverse_follows_ten_times_closer_than_the_lengths_of_the_tendons(designed):
    errors = {name: profile.rms for name, profile in designed.profiles.items()}
    assert errors["inverse"] < errors["linear"] / 10
    assert errors["inverse"] < errors["static"] < errors["stretch"]
    assert np.degrees(errors["inverse"]) < 0.05


@pytest.mark.compiler
def test_a_design_is_checked_by_an_integrator(designed):
    brief = scenario(SHORT, ("duration_s = 0.6", "duration_s = 0.1"), ("fade_in_s = 0.3", "fade_in_s = 0.1"))
    check = replace(designed, scenario=brief, task=FingerTask.of(brief)).check(Method.IDAS)
    assert 0 < check.rms_percent_of_range < 0.05
    assert check.compensator == designed.recommended.label


@pytest.mark.compiler
def test_the_files_have_the_columns_of_the_contract(designed, tmp_path):
    designed.write(tmp_path / "out")
    profile = pd.read_csv(tmp_path / "out" / "profile.csv")
    columns = ["time_s", "reference_mcp_rad", "motor_m1_linear_rad", "motor_m1_stretch_rad", "motor_m1_inverse_rad"]
    assert set(columns) | {"motor_m1_torque_inverse_N_m", "tension_extensor_N"} <= set(profile.columns)
    assert set(designed.columns_of(designed.recommended.name)) <= set(profile.columns)
    assert len(profile) == 601
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    errors = summary["compensators"]["inverse"]["presliding"]["rmse_rad"]
    assert set(errors) == {"mcp", "pip", "dip", "all"}
    assert summary["inverse"]["lowest_tension_N"] > 0
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.compiler
def test_a_runtime_gives_the_motor_angles_of_the_design(designed):
    runtime = tf.Runtime(scenario())
    wanted = sample_finger(scenario()).angle_rad
    live = np.array([runtime.step(row) for row in wanted[1:200]])
    assert live == pytest.approx(designed.inversion.motor_rad[1:200], abs=1e-9)
    before = runtime.step({"mcp": float("nan"), "pip": 0.0, "dip": 0.0})
    assert runtime.status == (RuntimeStatus.INPUT_HELD,)
    assert before == pytest.approx(live[-1])
    state = runtime.state()
    after = runtime.step(wanted[200])
    runtime.restore(state)
    assert runtime.step(wanted[200]) == pytest.approx(after, abs=0)
    broken = bytes([state.content[0] ^ 1]) + state.content[1:]
    with pytest.raises(InputError, match="damaged"):
        runtime.restore(replace(state, content=broken))
    with pytest.raises(ParameterError, match="must hold an angle of each of mcp, pip, dip"):
        runtime.step(0.7)


@pytest.mark.compiler
def test_two_tendons_on_a_drum_are_a_loop():
    """Three loops on three joints, with tendons that pass the others: no tension is free."""
    text = SHORT[: SHORT.index("[[tendons]]")]
    arms = {"mcp": (0.010, 0.0, 0.0), "pip": (0.002, 0.010, 0.0), "dip": (0.002, 0.002, 0.008)}
    for name, arm in arms.items():
        for side, sign in (("flexor", 1), ("extensor", -1)):
            text += f'[[tendons]]\nname = "{name}_{side}"\n[tendons.path]\nsegments = 12\n'
            text += '[[tendons.path.sections]]\nname = "channel"\nangle_rad = 2.0\nlength_m = 0.25\n'
            for joint, r in zip(arms, arm, strict=True):
                if r:
                    text += f'[[tendons.path.sections]]\nname = "at_{joint}"\nangle_rad = 0.3\nlength_m = 0.03\n'
                    text += f'joint = "{joint}"\nlength_per_rad_m = {-sign * r}\n'
    for name in arms:
        text += f'[[motors]]\nname = "{name}"\ndrums_m = {{ {name}_flexor = 0.008, {name}_extensor = -0.008 }}\n'
        text += "pretension_N = 12.0\n"
    text += SHORT[SHORT.index("[reference]") :]
    found = design_motors(parse_finger_scenario(text, EXAMPLE))
    errors = {name: profile.rms for name, profile in found.profiles.items()}
    assert errors["inverse"] < errors["linear"] / 10
    assert found.inversion.motor_rad.shape[1] == 3


def test_a_torque_that_no_tensions_give_is_refused_with_joint_and_pose():
    weak = scenario(SHORT, ("length_per_rad_m = 0.008", "length_per_rad_m = -0.008"))
    with pytest.raises(InputError, match=r"hold the joints at the start|give dip its torque"):
        design_motors(weak)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("m4", "m 4", "name must be letters"),
        (
            "drums_m = { extensor = 0.008 }",
            "drums_m = { extenso = 0.008 }",
            'a motor winds "extenso", which is no tendon',
        ),
        ('joint = "mcp"', 'joint = "mpc"', 'moves no driven joint, but "?mpc"?; driven: mcp, pip, dip'),
        ("[reference.joints.dip]", "[reference.joints.dop]", 'no driven joint "dop"'),
        ("[sharing]", "[sharin]", "unknown table"),
        ("[sharing]", "[feedback]", "here joints share motors; let an integral action at the encoders correct"),
        ("smooth_N = 2.0", "smooth_N = 0.0", "smooth_N must be a finite number > 0"),
        ("length_per_rad_m = 0.014", "length_per_rad = 0.014", 'unknown key "length_per_rad"'),
    ],
)
def test_slips_are_named_with_the_way_out(before, after, message):
    with pytest.raises(InputError, match=message):
        scenario(SHORT, (before, after))


def test_moment_arms_at_the_far_end_are_those_of_sections():
    given = load_scenario(EXAMPLE)
    tendon = given.mechanism.tendons[0]
    by_sections = given.mechanism.geometry().moment_arm_m(np.zeros((1, 3)))[0, 0]
    plain = scenario(
        SHORT,
        ('name = "mcp_flexor"', 'name = "mcp_flexor"\nmoment_arms_m = { mcp = 0.010 }'),
        ('length_per_rad_m = -0.010\n\n[[tendons]]\nname = "pip_flexor"', '\n[[tendons]]\nname = "pip_flexor"'),
    )
    assert plain.mechanism.geometry().moment_arm_m(np.zeros((1, 3)))[0, 0] == pytest.approx(by_sections)
    assert replace(tendon, arms=plain.mechanism.tendons[0].arms).arm.moment_arm_m == 0.010


UNDER = """
schema = 1
[joints.a]
kind = "driven"
inertia_kg_m2 = 8e-5
damping_N_m_s_per_rad = 2e-3
stiffness_N_m_per_rad = 0.12
rest_rad = -0.3
[joints.b]
kind = "driven"
inertia_kg_m2 = 3e-5
damping_N_m_s_per_rad = 2e-3
stiffness_N_m_per_rad = 0.10
rest_rad = -0.3
[[tendons]]
name = "flexor"
[tendons.path]
segments = 10
[[tendons.path.sections]]
name = "channel"
angle_rad = 1.5
length_m = 0.2
[[tendons.path.sections]]
name = "at_a"
angle_rad = 0.3
length_m = 0.03
joint = "a"
length_per_rad_m = -0.010
[[tendons.path.sections]]
name = "at_b"
angle_rad = 0.3
length_m = 0.03
joint = "b"
length_per_rad_m = -0.007
[drive]
drum_radius_m = 0.008
"""


@pytest.mark.compiler
def test_one_tendon_moves_two_springed_joints_of_which_one_is_wanted():
    rope = SHORT[SHORT.index("[tendon]") : SHORT.index("# A section that follows")]
    text = UNDER + rope + '[reference]\nkind = "sine"\nduration_s = 0.6\nfade_in_s = 0.3\n'
    text += "[reference.joints.a]\noffset_rad = 0.6\namplitudes_rad = [0.2]\nfrequencies_Hz = [1.5]\n"
    text += '[run]\nstep_s = 1e-3\nlevel = "presliding"\n'
    found = design_motors(parse_finger_scenario(text, EXAMPLE))
    errors = {name: profile.rms for name, profile in found.profiles.items()}
    assert found.goal.names == ("a",)
    assert errors["inverse"] < errors["linear"] / 10
    assert np.ptp(found.inversion.position_rad[:, 1]) > 0.05


LOOP = Path("examples/hand_joint.toml")


@pytest.fixture(scope="module")
def loop():
    """The joint of a hand, written with a motor that winds both tendons."""
    text = LOOP.read_text("utf-8")
    for sign in ("", "-"):
        text = text.replace(f"moment_arm_m = {sign}0.008 ", f"moment_arms_m = {{ knuckle = {sign}0.008 }} ")
    text = text.replace('kind = "loop" ', "").replace("[drive]", "[[motors]]\nname = 'servo'")
    text = text.replace("drum_radius_m = 0.008 ", "drums_m = { flexor = 0.008, extensor = -0.008 } ")
    before, after = text.split("[reference]")
    reference, run = after.split("[run]")
    for key in ("quantity", "angles_rad"):
        reference = "\n".join(line for line in reference.splitlines() if not line.startswith(key))
    angles = "[reference.joints.knuckle]\nangles_rad = [0.0, 0.9, 0.9, 0.3, 1.1, 0.0]\n"
    return parse_finger_scenario(f"{before}[reference]{reference}\n{angles}[run]{run}", LOOP)


@pytest.mark.compiler
def test_a_joint_on_a_loop_is_designed_the_same_with_a_motor_of_two_tendons(loop):
    found, before = FingerTask.of(loop), design_motors(load_scenario(LOOP))
    ours, theirs = found.inversion.motor_rad, before.inversion.motor_rad
    assert ours == pytest.approx(theirs, abs=1e-8)  # both solve to a tolerance


@pytest.mark.compiler
def test_the_data_sheet_has_the_closed_forms_of_a_loop(loop):
    """Lost motion and drive friction of both tendons together; the least pre-tension keeps both taut."""
    task, known = FingerTask.of(loop), design_motors(load_scenario(LOOP)).sheet
    [joint], tendons = joint_sheets(task), tendon_sheets(task)
    weightless = replace(loop.mechanism, joints=(replace(loop.mechanism.joints[0], gravity_N_m=0.0),))
    [light] = joint_sheets(replace(task, finger=weightless))
    assert light.lost_motion_rad == pytest.approx(known.lost_motion_rad, rel=0.05)
    assert sum(each.drive_friction_N for each in tendons) == pytest.approx(known.drive_force_N, rel=0.1)
    least = tendons[0].least_pretension_N
    for share, status in ((1.01, MechanismStatus.DONE), (0.98, MechanismStatus.SLACK)):
        finger = with_numbers(loop.mechanism, {"motors.servo.drive.pretension_N": share * least})
        assert task.with_system(finger).inversion.status is status
    low, high = joint.torque_N_m
    ratio = tendons[0].tension_ratio
    assert high == pytest.approx(0.008 * (1.0 / 0.008 / ratio - loop.mechanism.sharing.least_tension_N), rel=1e-6)
    assert low == pytest.approx(-high)


@pytest.mark.compiler
def test_a_finger_is_compared_and_swept_over_its_uncertainty(tmp_path):
    coarse = scenario(SHORT, ("duration_s = 0.6", "duration_s = 0.2"), ("step_s = 1e-3", "step_s = 2e-3"))
    text = coarse.text.replace("segments = 12", "segments = 4") + "[robust]\nmu = 0.2\nstiffness = 0.3\nsamples = 2\n"
    stated = parse_finger_scenario(text, EXAMPLE)
    found = compare(stated, compensators=("linear", "static", "inverse"))
    errors = {c.name: found.entry(c.name, Level.PRESLIDING, "presliding") for c in found.compensators}
    assert set(errors) == {"linear", "static", "inverse"}
    assert errors["inverse"].rmse_percent_of_range < 0.1 * errors["static"].rmse_percent_of_range
    units = sweep(stated, tmp_path / "sweep", samples=3)
    assert len(units.rows) == 3
    assert units.compensators == ("linear", "stretch", "static", "inverse", "robust")


@pytest.mark.compiler
def test_a_cycle_of_a_finger_is_judged_where_it_repeats():
    text = SHORT.replace("fade_in_s = 0.3", "fade_in_s = 0.0\nperiodic = true").replace(
        "step_s = 1e-3", "step_s = 2e-3"
    )
    for before, after in (("0.6", "0.5"), ("[0.7]", "[2.0]"), ("[1.1]", "[2.0]"), ("[0.9]", "[4.0]")):
        text = text.replace(before, after, 1)
    task = FingerTask.of(parse_finger_scenario(text.replace("segments = 12", "segments = 4"), EXAMPLE))
    run = task.respond(task.finger, task.inversion.motor_rad)
    assert run.position_rad[:, :3] == pytest.approx(task.sampled.angle_rad, abs=1e-4)
    assert run.position_rad[-1] == pytest.approx(run.position_rad[0], abs=1e-4)
    with pytest.raises(InputError, match=r"ends .* rad from where it starts"):
        sample_finger(parse_finger_scenario(text.replace("[4.0]", "[4.5]"), EXAMPLE))
