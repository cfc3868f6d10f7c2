import math
import time
from dataclasses import replace
from pathlib import Path

import mjcf_models as models
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

import tendonff as tf
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.mjcf.measure import measure
from tendonff.compensator.mjcf.model import read_hand, sweep_poses
from tendonff.compensator.mjcf.run import Import, run_import
from tendonff.compensator.mjcf.tabulate import tabulate
from tendonff.models.fidelity import Level
from tendonff.models.mechanism.static import local_arms_m
from tendonff.ocp.mechanism.compiled import CompiledMechanism, table_parts

EXAMPLE = Path(__file__).parents[3] / "examples" / "tendon_finger.xml"


def written(text: str, folder: Path) -> Path:
    path = folder / "model.xml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Import:
    folder = tmp_path_factory.mktemp("two")
    return run_import(written(models.TWO_JOINTS, folder), out=folder / "hand.toml")


@pytest.mark.parametrize("name", ["TWO_JOINTS", "THREE_JOINTS", "CAPSTAN", "RING"])
def test_intervals_add_up_to_the_length_of_mujoco(name: str, tmp_path: Path) -> None:
    """Direct evaluation, 300 poses: 1e-9 m."""
    hand = read_hand(written(getattr(models, name), tmp_path))
    for found in measure(hand, sweep_poses(hand, 300)):
        assert np.abs(found.length_m.sum(axis=1) - found.whole_m).max() < 1e-9


@pytest.mark.parametrize("name", ["TWO_JOINTS", "THREE_JOINTS", "CAPSTAN", "RING"])
def test_tables_have_lengths_moment_arms_and_bends_of_mujoco_at_unseen_poses(
    name: str, two: Import, tmp_path: Path
) -> None:
    """300 poses: lengths 1e-5 m, moment arms 1e-4 m, bends 2e-3 rad rms."""
    known = two if name == "TWO_JOINTS" else None
    found = known or run_import(written(getattr(models, name), tmp_path), out=tmp_path / "hand.toml")
    for tendon in found.survey.tendons:
        assert tendon.length_error_m < 1e-5
        assert tendon.arm_error_m < 1e-4
        assert tendon.wrap_rms_rad < 2e-3
        assert tendon.fits


def test_a_wrap_of_more_than_half_a_turn_has_its_closed_form(tmp_path: Path) -> None:
    """Bend = pi + 0.5 + q - 2 acos(r/d), here 2.5 to 4.9 rad: more than the angle between the straight parts."""
    hand = read_hand(written(models.CAPSTAN, tmp_path))
    poses = np.linspace(0.0, 2.4, 15)[:, None]
    [found] = measure(hand, poses)
    expected = math.pi + 0.5 + poses[:, 0] - 2 * math.acos(models.RADIUS_M / models.REACH_M)
    assert found.turn_rad[:, 0] == pytest.approx(expected, abs=1e-9)
    assert found.turn_rad.max() > math.pi + 1


def test_a_joint_behind_a_wrap_is_pulled_by_the_tension_behind_it(tmp_path: Path) -> None:
    """The wrap grows at its edge: torque = far tension times moment arm, whatever the friction on the post."""
    scenario = tf.import_mjcf(written(models.CAPSTAN, tmp_path), out=tmp_path / "hand.toml")
    tendon = scenario.mechanism.geometry().tendons[0]
    rough = replace(tendon, friction=replace(tendon.friction, mu_dynamic=0.5, mu_static=0.5))
    [[[arm]]] = scenario.mechanism.moment_arm_m(np.array([[0.7]])).tolist()
    assert local_arms_m(rough, {"turn": 0.7}, {"turn": 1.0})["turn"] == pytest.approx(arm, rel=1e-12)


@pytest.mark.compiler
def test_compiled_paths_are_those_of_python(two: Import) -> None:
    task = FingerTask.of(two.scenario)
    problem = task.problem(task.finger)
    poses = sweep_poses(read_hand(two.scenario.source.with_name("model.xml")), 20)
    engine = CompiledMechanism(problem, task.step_s)
    places = dict(zip(task.finger.names, poses.T, strict=True))
    found = engine.path_at(np.hstack([poses, np.zeros((20, problem.motors))]))
    for chain, rows in zip(problem.chains(), found, strict=True):
        n = chain.count
        expected = chain.elements.path.at(places)
        assert rows[:, :n] == pytest.approx(expected.angle_rad, abs=1e-13)
        assert rows[:, n : 2 * n + 1] == pytest.approx(expected.ratio, rel=1e-12)
        assert rows[:, 2 * n + 1 : -1] == pytest.approx(expected.gained_m, abs=1e-15)


@pytest.mark.compiler
def test_a_table_costs_at_most_two_microseconds_in_c(two: Import) -> None:
    """Processor time of whole paths over the number of their tables, the best of five."""
    task = FingerTask.of(two.scenario)
    problem = task.problem(task.finger)
    engine = CompiledMechanism(problem, task.step_s)
    tables = sum(len(table_parts(chain, problem.names)) for chain in problem.chains())
    rows = np.zeros((2000, 2 + problem.motors))
    rows[:, :2] = sweep_poses(read_hand(two.scenario.source.with_name("model.xml")), len(rows))
    spent = []
    for _ in range(5):
        begun = time.process_time()
        engine.path_at(rows)
        spent.append(time.process_time() - begun)
    assert tables > 5
    assert min(spent) / (len(rows) * tables) < 2e-6


@pytest.mark.compiler
@pytest.mark.slow
def test_an_imported_finger_is_inverted_and_followed_step_by_step(two: Import) -> None:
    """The runtime gives the motors of the inverse, and the mechanism behind them reaches the reference."""
    task = FingerTask.of(two.scenario)
    task.check_reach()
    inverse = task.inversion
    runtime = tf.Runtime(two.scenario)
    rows = [
        runtime.step(angle, torque_N_m=torque)
        for angle, torque in zip(task.wanted_rad[1:200], task.efforts[1:200], strict=True)
    ]
    assert np.array(rows) == pytest.approx(inverse.motor_rad[1:200], abs=1e-9)
    reached = task.respond(task.finger, inverse.motor_rad).position_rad[:, :2]
    assert np.abs(reached - task.wanted_rad).max() < 1e-6


def test_an_import_again_keeps_the_scenario_and_writes_the_torques_of_its_reference(
    two: Import, tmp_path: Path
) -> None:
    source = two.scenario.source
    target = tmp_path / source.name
    text = source.read_text().replace("times_s = [0.0, 0.8, 1.2, 2.4, 3.0]", "times_s = [0.0, 0.4, 0.6, 1.2, 1.5]")
    target.write_text(text)
    again = run_import(source.with_name("model.xml"), out=target)
    assert again.kept
    assert target.read_text() == text
    slow, quick = (
        np.loadtxt(each.with_name("hand_torques.csv"), delimiter=",", skiprows=1) for each in (source, target)
    )
    assert quick[-1, 0] == pytest.approx(1.5)
    assert np.ptp(quick[:, 1]) > np.ptp(slow[:, 1])


def test_gravity_along_the_reference_is_in_the_torques(two: Import) -> None:
    """At rest at the start they hold the bones' weight: 12 g at 63.5 mm and 20 g at 22.5 mm, bent."""
    torque = np.loadtxt(two.scenario.source.with_name("hand_torques.csv"), delimiter=",", skiprows=1)[0, 1:]
    mcp, pip = FingerTask.of(two.scenario).wanted_rad[0]
    first, second = 0.02 * 9.81 * 0.0225, 0.012 * 9.81
    of_pip = -second * 0.0185 * math.cos(mcp + pip)
    assert torque[1] == pytest.approx(of_pip, rel=1e-3)
    assert torque[0] == pytest.approx(of_pip - (first + second * 0.045) * math.cos(mcp), rel=1e-3)


def test_a_fixed_tendon_has_constant_arms(tmp_path: Path) -> None:
    scenario = tf.import_mjcf(written(models.FIXED, tmp_path), out=tmp_path / "hand.toml")
    arms = scenario.mechanism.moment_arm_m(np.array([[0.2, 0.4]]))[0]
    assert arms == pytest.approx(np.array([[0.01, 0.006], [-0.012, 0.0]]), abs=1e-12)


REFUSED = {
    "branches": (lambda text: text.replace('<site site="f3"/>', '<pulley divisor="2"/><site site="f3"/>'), "branches"),
    "spring": (lambda text: text.replace('name="short"', 'name="short" stiffness="100"'), "is a spring"),
    "no tendon": (lambda text: text.split("<tendon>")[0] + "</mujoco>", "has no tendons"),
    "either end": (
        lambda text: text.replace('<site site="m2"/></spatial>', '<site site="m2"/><site site="f0"/></spatial>'),
        "--near m0 or --near f0",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_has_no_meaning_is_refused_by_name_with_the_way_round(what: str, tmp_path: Path) -> None:
    change, message = REFUSED[what]
    with pytest.raises(InputError, match=message):
        read_hand(written(change(models.TWO_JOINTS), tmp_path))


@pytest.mark.parametrize("text", ["schema = 1", "<a/>"])
def test_a_file_that_is_no_mjcf_is_called_so(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be read as MJCF, an XML file <mujoco>"):
        read_hand(written(text, tmp_path))


def test_a_wrap_that_flips_its_side_is_refused_where_it_does(tmp_path: Path) -> None:
    free = models.CAPSTAN.replace(' sidesite="under"', "").replace('range="0 2.4"', 'range="-1 1"')
    hand = read_hand(written(free, tmp_path))
    with pytest.raises(InputError, match=r'flips its side where "turn" is at -0\.5 rad'):
        tabulate(hand, hand.routes[0])


def test_a_joint_is_asked_for_again_with_the_range_that_it_was_given(tmp_path: Path) -> None:
    """So a refusal that names a range of one joint names what keeps the others."""
    hand = read_hand(written(models.TWO_JOINTS, tmp_path), joints=["pip", "mcp=0:1.2"])
    assert [joint.option for joint in hand.joints] == ["mcp=0:1.2", "pip"]


def test_a_motion_beyond_the_tables_is_said(two: Import) -> None:
    text = two.scenario.text.replace("angles_rad = [", "angles_rad = [1.65, ", 1)
    text = text.replace("times_s = [0.0, 0.8,", "times_s = [0.0, 0.7, 0.8,")
    scenario = tf.load_scenario(two.scenario.source)
    motion = FingerTask.of(scenario).sampled.motion
    wide = replace(motion, angle_rad=motion.angle_rad + np.array([1.0, 0.0]))
    assert any('"mcp" leaves the table of section' in message for message in scenario.mechanism.beyond_tables(wide))
    assert text != two.scenario.text


@pytest.mark.compiler
@pytest.mark.slow
def test_four_joints_on_five_tendons_are_designed_for_and_followed_together(tmp_path: Path) -> None:
    """Of examples/tendon_finger.xml: runtime as inverse to 1e-9 rad, joints on the reference to 1e-6 rad."""
    found = run_import(EXAMPLE, out=tmp_path / "finger.toml")
    task = FingerTask.of(found.scenario)
    assert task.finger.names == ("abduction", "mcp", "pip", "dip")
    assert [motor.name for motor in task.finger.motors][:2] == ["deep_motor", "flat_motor"]
    inverse, runtime = task.inversion, tf.Runtime(found.scenario)
    rows = [
        runtime.step(angle, torque_N_m=torque)
        for angle, torque in zip(task.wanted_rad[1:300], task.efforts[1:300], strict=True)
    ]
    assert np.array(rows) == pytest.approx(inverse.motor_rad[1:300], abs=1e-9)
    errors = {
        name: np.abs(task.respond(task.finger, motors).position_rad[:, :4] - task.wanted_rad).max()
        for name, motors in (
            ("inverse", inverse.motor_rad),
            ("static", task.static_rad),
            ("linear", task.lengths_rad),
        )
    }
    assert errors["inverse"] < 1e-6
    assert errors["inverse"] < errors["static"] < errors["linear"]


@pytest.mark.compiler
def test_on_stiff_bristles_tensions_balance_where_masses_turn(two: Import) -> None:
    """There slopes jump tenfold, and no tensions are of the least price by arms without friction."""
    task = FingerTask.of(two.scenario, Level.ELASTIC)
    reached = task.respond(task.finger, task.inversion.motor_rad).position_rad[:, :2]
    assert np.abs(reached - task.wanted_rad).max() < 1e-9


@pytest.mark.compiler
@pytest.mark.slow
def test_the_finger_in_mujoco_follows_within_a_tenth_of_the_error_of_lengths_alone(two: Import) -> None:
    """MuJoCo moves the bones, 24 masses a tendon pull them; 0.3 s of the reference."""
    import mujoco

    from examples.mujoco_finger.imported import ImportedTendons

    task = FingerTask.of(two.scenario)
    model = mujoco.MjModel.from_xml_path(str(two.scenario.source.with_name("model.xml")))
    model.opt.timestep = 0.001
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    address = [model.joint(name).qposadr[0] for name in task.finger.names]
    time = task.sampled.time_s
    worst = {}
    for name, motors in (("inverse", task.inversion.motor_rad), ("linear", task.lengths_rad)):
        data = mujoco.MjData(model)

        def motor_rad(at: float, motors: np.ndarray = motors) -> np.ndarray:
            return np.array([np.interp(at, time, column) for column in motors.T])

        off = []
        with ImportedTendons(model, data, two.scenario, motor_rad, masses=24):
            for row in range(1, 301):
                mujoco.mj_step(model, data)
                off.append(data.qpos[address] - task.wanted_rad[row])
        worst[name] = np.sqrt(np.mean(np.square(off)))
    assert worst["inverse"] < 0.1 * worst["linear"]
