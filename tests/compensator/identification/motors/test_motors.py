"""Pairs and fingers identified from angles and torques of their motors, on an explicit plant of its own."""

import json
import shutil
from dataclasses import replace

import finger_plant
import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.fitted import fitted_text
from tendonff.compensator.identification.motors.law import MechanismLaw, promises
from tendonff.compensator.identification.motors.log import read_logs, read_several
from tendonff.compensator.identification.motors.numbers import numbers_of
from tendonff.compensator.identification.motors.run import (
    mechanism_of,
    suggest_motor_routine,
)
from tendonff.compensator.identification.motors.search import that_may_stiffen
from tendonff.compensator.identification.parameters import OF_TENDONS, Parameter
from tendonff.compensator.identification.searches import Role
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario, parse_any
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.fits.mechanism import MotorRun

pytestmark = pytest.mark.compiler

STEP_S = 1e-3
COUNT_RAD = 2 * np.pi / 4096


def drums_of(true):
    """Travel of each tendon per radian of each motor."""
    names, drums = [tendon.name for tendon in true.tendons], np.zeros((len(true.motors), len(true.tendons)))
    for k, each in enumerate(true.motors):
        for name, winding in zip(each.winds, each.winding_m, strict=True):
            drums[k, names.index(name)] = winding
    return drums


def tracking_deg(fitted, true, growth=(0.0, 1.0), **plant):
    """RMS error of the joints of the hidden plant under a design from the fitted scenario, and under `linear`."""
    design = design_motors(load_scenario(fitted))
    time, errors = design.task.target_time_s, []
    wanted = design.task.wanted.reshape(-1, len(time)).T
    start = design.profiles["inverse"].tension_N[0]
    for name in ("inverse", "linear"):
        motor = design.profiles[name].motor_rad
        reached = finger_plant.respond(
            true.joints, true.tendons, drums_of(true), motor - motor[0], time[1] - time[0], wanted[0], start,
            stiffening=growth, **plant,
        ).angle_rad  # fmt: skip
        errors.append(np.degrees(np.sqrt(np.mean((reached - wanted[1:]) ** 2))))
    return errors


def log_of(
    scenario, true, routine, *, coulomb, tension_N, folder, encoder=True, plant_step_s=2e-6, masses=12, growth=0.0
):
    """Angles in 12 bits from any zero, torques with 1 % of noise; stiffness may grow from the tension of the start."""
    time = np.arange(round(routine.time_s[-1] / STEP_S) + 1) * STEP_S
    motor = np.column_stack([np.interp(time, routine.time_s, angle) for angle in routine.motor_rad.T])
    drums, start = drums_of(true), routine.joint_rad[0]
    found = finger_plant.respond(
        true.joints, true.tendons, drums, motor, STEP_S, start, tension_N,
        stiffening=(growth, float(tension_N[0])), masses=masses, step_s=plant_step_s,
    )  # fmt: skip
    held = np.vstack([tension_N, found.drum_N]) @ drums.T
    rng = np.random.default_rng(5)
    columns = {"time_s": time}
    for k, (each, friction) in enumerate(zip(true.motors, coulomb, strict=True)):
        torque = held[:, k] + friction * MotorRun.of_one(motor[:, k], STEP_S, 0.0).way()[:, 0]
        columns[f"motor_{each.name}_rad"] = np.round(motor[:, k] / COUNT_RAD + rng.uniform()) * COUNT_RAD
        columns[f"motor_torque_{each.name}_N_m"] = torque + 0.01 * np.ptp(torque) * rng.standard_normal(len(time))
    if encoder:
        angle = np.vstack([start, found.angle_rad])
        columns |= {
            f"joint_{name}_rad": np.round(q / COUNT_RAD + rng.uniform()) * COUNT_RAD
            for name, q in zip(true.names, angle.T, strict=True)
        }
    write_csv(folder / "log.csv", columns)
    return folder / "log.csv"


@pytest.fixture(scope="module")
def pair(tmp_path_factory, examples):
    """A wrist whose cables rub more and stretch less than the scenario says, and differ."""
    folder = tmp_path_factory.mktemp("pair")
    shutil.copy(examples / "instrument_pair.toml", folder / "pair.toml")
    text = (folder / "pair.toml").read_text().replace("coulomb_N_m = 1.0e-3", "coulomb_N_m = 0.0")
    (folder / "pair.toml").write_text(text)
    scenario = load_scenario(folder / "pair.toml")
    routine = suggest_motor_routine(scenario)
    truth = {
        "tendons.open.friction.mu_dynamic": 0.19,
        "tendons.close.friction.mu_dynamic": 0.12,
        "tendons.open.tendon.stiffness_N_per_m": 4.8e4,
        "tendons.close.tendon.stiffness_N_per_m": 3.4e4,
    }
    true = with_numbers(mechanism_of(scenario)[0], truth)
    start = np.array([5.0, 5.0])
    log = log_of(
        scenario, true, routine, coulomb=(2e-3, 3e-3), tension_N=start, folder=folder, plant_step_s=2e-6, masses=8
    )
    return folder, scenario, truth, log


@pytest.fixture(scope="module")
def fitted(pair, tmp_path_factory):
    """Folder that the command writes."""
    folder, _, _, log = pair
    out = tmp_path_factory.mktemp("fitted") / "fit"
    assert run(["identify", str(folder / "pair.toml"), "--data", str(log), "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_friction_and_stiffness_of_both_cables_of_a_pair_are_found(pair, fitted):
    fit = json.loads((fitted / "fit.json").read_text())
    assert fit["law_describes_the_device"]
    for key, value in pair[2].items():
        assert fit["estimates"][key]["identifiable"], key
        assert fit["estimates"][key]["estimate"] == pytest.approx(value, rel=0.01), key
    assert fit["estimates"]["motors.open.drive.coulomb_N_m"]["estimate"] == pytest.approx(2e-3, rel=0.3)
    assert set(fit["files"][0]["torque_percent_of_range"]) == {"open", "close"}


def test_the_fitted_scenario_has_the_values_and_their_intervals(fitted):
    fit = json.loads((fitted / "fit.json").read_text())["estimates"]
    scenario = load_scenario(fitted / "fitted.toml")
    for tendon in scenario.mechanism.tendons:
        assert tendon.friction.mu_dynamic == fit[f"tendons.{tendon.name}.friction.mu_dynamic"]["estimate"]
    assert scenario.mechanism.drive.coulomb_N_m > 0
    said = (fitted / "report.html").read_text(encoding="utf-8")
    assert "Next: tendonff design fitted.toml</p>" in said
    assert 0 < scenario.robust.mu < 0.2
    assert 0 < scenario.robust.stiffness < 0.2


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("encoder", [True, False])
def test_a_finger_of_three_joints_and_four_tendons_is_found(tmp_path, encoder):
    """Without encoders too: torques of the motors alone."""
    assert run(["new", str(tmp_path / "finger.toml"), "--for", "finger"]) == 0
    text = (tmp_path / "finger.toml").read_text().replace("damping_N_s_per_m = 0.5", "damping_N_s_per_m = 0.02")
    (tmp_path / "finger.toml").write_text(text)
    scenario = load_scenario(tmp_path / "finger.toml")
    rng, truth = np.random.default_rng(3), {}
    for tendon in scenario.mechanism.tendons:
        truth[f"tendons.{tendon.name}.friction.mu_dynamic"] = 0.15 * rng.uniform(0.7, 1.4)
        truth[f"tendons.{tendon.name}.tendon.stiffness_N_per_m"] = 2e4 * rng.uniform(0.75, 1.3)
    true = with_numbers(scenario.mechanism, truth)
    start = np.array([11.5, 11.5, 11.5, 11.5])
    log = log_of(
        scenario,
        true,
        suggest_motor_routine(scenario),
        coulomb=(0.008, 0.004, 0.006, 0.007),
        tension_N=start,
        folder=tmp_path,
        encoder=encoder,
        plant_step_s=4e-6,
        masses=16,
    )
    found = identify(scenario, [log])
    for key, value in truth.items():
        assert found.estimate(key).value == pytest.approx(value, rel=0.03), key
    found.write(tmp_path / "fit")
    after, plain = tracking_deg(tmp_path / "fit" / "fitted.toml", true, masses=16, step_s=4e-6)
    assert after < 0.05
    assert plain > 0.3


@pytest.mark.nightly
@pytest.mark.slow
def test_stiffness_that_grows_with_the_tension_is_found_and_costs_a_design_nothing(pair, tmp_path):
    """30 % from 5 to 10 N. A constant stiffness is 17 % off, and leaves 0.15 deg after design."""
    _, scenario, truth, _ = pair
    true = with_numbers(mechanism_of(scenario)[0], truth)
    log = log_of(
        scenario, true, suggest_motor_routine(scenario), coulomb=(2e-3, 3e-3), tension_N=np.array([5.0, 5.0]),
        folder=tmp_path, masses=8, growth=0.3,
    )  # fmt: skip
    found = identify(scenario, [log])
    low, high = found.estimate("stiffening").interval
    assert low < 0.3 < high
    assert high - low < 0.2
    for key, value in truth.items():
        assert found.estimate(key).value == pytest.approx(value, rel=0.03), key
    found.write(tmp_path / "fit")
    after, _ = tracking_deg(tmp_path / "fit" / "fitted.toml", true, (0.3, 5.0), masses=8, step_s=2e-6)
    assert after < 0.05


@pytest.mark.parametrize("example", ["instrument_pair.toml", "three_joint_finger.toml"])
def test_what_a_log_does_not_identify_has_the_width_that_a_design_assumes(examples, example):
    """One number that is identified says nothing of the others: a design would take them as known."""
    asked = load_scenario(examples / example)
    finger, _ = mechanism_of(asked)
    numbers = [n for n in numbers_of(finger, []).values() if n.search.role is Role.CORE]
    kept = [Estimate(name=n.name, value=n.start, why="too little excitation") for n in numbers]
    first = f"tendons.{finger.tendons[0].name}.friction.mu_dynamic"
    one = [replace(e, interval=(0.99 * e.value, 1.01 * e.value)) if e.name == first else e for e in kept]
    for estimates in (kept, one):
        text = fitted_text(asked, finger, estimates)
        robust = parse_any(text, examples / example).robust
        assert (robust.mu, robust.stiffness) == (ASSUMED_SPREAD, ASSUMED_SPREAD)
        loops = {f"motors.{m.name}.drive.pretension_N" for m in finger.motors if len(m.winds) > 1}
        assert {s.name: s.half_width for s in robust.spread} == dict.fromkeys(loops, ASSUMED_SPREAD)


@pytest.mark.parametrize(
    ("effect", "value"),
    [(Parameter.RELAXING_SHARE, 0.3), (Parameter.ADHESION, 8.0)],
)
def test_an_effect_of_the_tendons_that_the_law_lacks_is_named_and_widens_the_intervals(pair, effect, value):
    """A log of the mechanism itself with that effect; without it nothing is named."""
    _, scenario, _, file = pair
    finger, sampled = mechanism_of(scenario)
    [log] = read_several(finger, [file], sampled.angle_rad[0], Measurement())
    log = log.part(slice(0, len(log.torque_N_m) // 3), 0.0)
    law = MechanismLaw(mechanism=that_may_stiffen(finger, [log]), logs=[log], segments=4)
    own = {
        n.name: 5.0 if n.of_start else n.start for n in law.numbers.values() if n.search.role in (Role.CORE, Role.START)
    }
    noise = 1e-4 * np.random.default_rng(1).standard_normal(log.torque_N_m.shape)

    def lacking(more):
        seen = law.respond(log, {**own, **more})
        written = replace(log, torque_N_m=seen.torque_N_m + noise, joint_rad=seen.angle_rad)
        known = replace(law, logs=[written])
        return promises(known, known.fit(own, most=8), OF_TENDONS)

    found = lacking({effect: value})
    assert found[effect].gain > 4
    assert found[effect].gain == max(each.gain for each in found.values())
    assert np.abs(found[effect].shift).max() > 0
    assert max(each.gain for each in lacking({}).values()) < 4


def test_files_that_a_finger_names_are_found_from_another_folder(examples, tmp_path):
    text = (
        (examples / "three_joint_finger.toml").read_text().replace("[joints.mcp]", '[joints.mcp]\ntorques = "t.csv"', 1)
    )
    (tmp_path / "finger.toml").write_text(text)
    write_csv(tmp_path / "t.csv", {"time_s": np.linspace(0.0, 9.0, 10), "mcp_N_m": np.zeros(10)})
    (tmp_path / "out").mkdir()
    asked = load_scenario(tmp_path / "finger.toml")
    (tmp_path / "out" / "fitted.toml").write_text(asked.text_in(tmp_path / "out"))
    again = load_scenario(tmp_path / "out" / "fitted.toml")
    assert again.torques == {"mcp": "../t.csv"}
    assert [path.resolve() for path in again.inputs] == [path.resolve() for path in asked.inputs]


def test_a_log_without_a_motor_names_the_column(pair, tmp_path):
    _, scenario, _, log = pair
    lines = log.read_text().splitlines()
    cut = [",".join(line.split(",")[:-3]) for line in lines]
    (tmp_path / "short.csv").write_text("\n".join(cut))
    with pytest.raises(InputError, match=r'column "motor_close_rad" is missing.*angle of each motor'):
        identify(scenario, [tmp_path / "short.csv"])


def test_current_needs_the_torque_constant(pair, tmp_path):
    _, scenario, _, log = pair
    text = log.read_text().replace("motor_torque_open_N_m", "motor_current_open_A")
    (tmp_path / "current.csv").write_text(text)
    with pytest.raises(InputError, match="motor_current_open_A needs the torque constant: torque_constant_N_m_per_A"):
        identify(scenario, [tmp_path / "current.csv"])


def test_suggested_motor_angles_lead_the_joints_over_their_range_at_two_levels_of_tension(pair):
    _, scenario, _, _ = pair
    routine = suggest_motor_routine(scenario)
    wide = np.ptp(routine.joint_rad[: len(routine.joint_rad) // 2], axis=0)
    assert wide == pytest.approx(np.ptp(routine.joint_rad, axis=0), rel=1e-6)
    # cables that are both tighter have both been taken in where the joint stands as before
    rows = np.flatnonzero(np.abs(routine.joint_rad[:, 0] - np.median(routine.joint_rad[:, 0])) < 1e-3)
    before, after = (routine.motor_rad[rows[rows < len(routine.time_s) // 3]], routine.motor_rad[rows[-5:]])
    assert (after.mean(axis=0) > before.mean(axis=0)).all()


def test_a_scenario_without_friction_is_refused(pair):
    _, scenario, _, log = pair
    bare = replace(scenario, mechanism=with_numbers(scenario.mechanism, {"mu": 0.0}))
    with pytest.raises(InputError, match="mu_dynamic of tendon"):
        identify(bare, [log])


@pytest.mark.parametrize(("name", "motors"), [("instrument_pair", ("_open", "_close")), ("hand_joint", ("",))])
def test_a_tare_sets_the_torques_of_unloaded_motors_to_zero(examples, tmp_path, name, motors):
    """Half a second without load, then swings; the offsets of the current sensors go."""
    scenario, time = load_scenario(examples / f"{name}.toml"), 1e-3 * np.arange(3001)
    swing = np.sin(2 * np.pi * np.maximum(time - 0.5, 0.0))
    columns = {f"motor{motor}_rad": swing for motor in motors}
    columns |= {f"motor_torque{motor}_N_m": 0.03 * (k + 1) + 0.1 * swing for k, motor in enumerate(motors)}
    write_csv(tmp_path / "log.csv", {"time_s": time} | columns)
    if name == "hand_joint":
        [log] = read_logs(scenario, [tmp_path / "log.csv"], Measurement(tare_s=(0.0, 0.4), skip_s=0.0))
    else:
        finger = mechanism_of(scenario)[0]
        [log] = read_several(finger, [tmp_path / "log.csv"], np.zeros(1), Measurement(tare_s=(0.0, 0.4)))
    torque = log.torque_N_m
    assert torque.shape[1] == len(motors)
    assert np.abs(torque[:20]).max() < 2e-3
    assert np.ptp(torque, axis=0) == pytest.approx(0.2, rel=0.1)
