"""Motors whose gear and servo give way: ahead of their drums, on plants that share no code with the package."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tendonff as tf
from benchmarks.crossings import PARTS, behind
from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.files.reading import InputError
from tendonff.models.joint.parameters.drive import DriveKind
from tests import finger_plant, joint_plant

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
GEAR = 5.0
"""Stiffness that costs degrees where it is not known [N m/rad]."""


def joint_of(kind: DriveKind, gear: float | None = GEAR, **more: Any) -> JointTask:
    """The joint of a hand behind a drive that does nothing else."""
    scenario = tf.load_scenario(EXAMPLES / "hand_joint.toml")
    ideal: dict[str, Any] = {"command_interval_s": None, "resolution_rad": 0.0, "speed_max_rad_per_s": None}
    ideal["gear_stiffness_N_m_per_rad"] = gear
    if kind is DriveKind.PAIR:
        ideal |= {"kind": kind, "pretension_N": None, "least_tension_N": 5.0}
    mechanism = scenario.mechanism
    return JointTask.of(
        replace(scenario, mechanism=replace(mechanism, drive=replace(mechanism.drive, **(ideal | more))))
    )


def rms_deg(off_rad: np.ndarray) -> float:
    return float(np.rad2deg(np.sqrt(np.mean(off_rad**2))))


@pytest.mark.parametrize(("kind", "gear_ratio"), [(DriveKind.LOOP, 1.0), (DriveKind.PAIR, 3.0)])
@pytest.mark.compiler
def test_the_motor_of_a_joint_is_ahead_by_what_its_gear_gives(kind: DriveKind, gear_ratio: float) -> None:
    stiff, task = (joint_of(kind, gear, gear_ratio=gear_ratio) for gear in (None, GEAR / gear_ratio**2))
    command = task.answer(compensator_of(task, "inverse"))
    windings = np.array(task.problem.windings_m) / gear_ratio
    drums = task.inversion.drum_N * windings
    held = drums.sum(axis=1, keepdims=True) if kind is DriveKind.LOOP else drums
    assert command - stiff.answer(compensator_of(stiff, "inverse")) == pytest.approx(
        (held - held[0]) * gear_ratio**2 / GEAR, abs=1e-9
    )

    start, pulls = float(task.target[0, 0]), task.inversion.tension_N[0]
    inner = task.step_s / round(task.step_s / 2e-6)
    seen = joint_plant.respond(task.mechanism, command, task.step_s, start, tensions_N=pulls, step_s=inner)
    assert rms_deg(seen.angle_rad - task.target[:, 0]) < 0.01
    unknown = stiff.answer(compensator_of(stiff, "inverse"))
    lost = joint_plant.respond(task.mechanism, unknown, task.step_s, start, tensions_N=pulls, step_s=inner)
    assert rms_deg(lost.angle_rad - task.target[:, 0]) > 0.1

    said = task.respond(task.mechanism, unknown, masses=task.masses)
    assert rms_deg(said.output[:, 0] - lost.angle_rad) < 0.02
    assert said.motor_rad == pytest.approx(unknown)


@pytest.mark.compiler
def test_a_joint_behind_a_lag_of_20_ms_is_within_0_05_deg_on_a_plant_of_its_own() -> None:
    """The drive, too, is written without the package: a trapezoidal rule."""
    task = joint_of(DriveKind.LOOP, servo_time_s=0.02)
    command = task.answer(compensator_of(task, "inverse"))
    drums = behind(task.mechanism.drive.servo, command, task.step_s)
    row_s, start, pulls = task.step_s / PARTS, float(task.target[0, 0]), task.inversion.tension_N[0]
    stiff = replace(task.mechanism, drive=replace(task.mechanism.drive, gear_stiffness_N_m_per_rad=GEAR))
    seen = joint_plant.respond(stiff, drums, row_s, start, tensions_N=pulls, step_s=row_s / 100)
    assert rms_deg(seen.angle_rad[::PARTS] - task.target[:, 0]) < 0.05


@pytest.mark.compiler
def test_the_motors_of_a_finger_are_ahead_by_what_their_gears_give() -> None:
    scenario = tf.load_scenario(EXAMPLES / "three_joint_finger.toml")
    system = scenario.mechanism
    drive = {"command_interval_s": None, "resolution_rad": 0.0, "gear_stiffness_N_m_per_rad": GEAR}
    bare = {"relaxing_stiffness_N_per_m": 0.0, "damping_N_s_per_m": 0.02}  # explicit steps stand little damping
    system = replace(
        system,
        motors=tuple(replace(m, drive=replace(m.drive, **drive)) for m in system.motors),
        tendons=tuple(replace(t, tendon=replace(t.tendon, **bare)) for t in system.tendons),
    )
    task = FingerTask.of(replace(scenario, mechanism=system))
    command = task.answer(compensator_of(task, "inverse"))
    rows, start, pulls = 500, task.target[0], task.inversion.tension_N[0]
    radius = np.zeros((len(system.motors), len(system.tendons)))
    names = [tendon.name for tendon in system.tendons]
    for row, motor in enumerate(system.motors):
        for name, winding in zip(motor.winds, motor.winding_m, strict=True):
            radius[row, names.index(name)] = winding
    plain = np.full(len(system.motors), GEAR)
    torque = GEAR * command[: rows + 1] + radius @ pulls
    seen = finger_plant.respond(
        *(system.joints, system.tendons, radius, torque, task.step_s, start, pulls),
        forced=np.full(len(plain), 2e-8),
        stiff=plain,
        masses=24,
    )
    assert rms_deg(seen.angle_rad - task.target[1 : rows + 1]) < 0.05
    said = task.respond(task.finger, command, masses=24).output[1 : rows + 1]
    assert rms_deg(said - seen.angle_rad) < 0.05


@pytest.mark.parametrize("stiffness", [50.0, 5e4])
@pytest.mark.compiler
def test_simulations_through_a_gear_undo_its_inverse_however_stiff_it_is(stiffness: float) -> None:
    task = joint_of(DriveKind.PAIR, stiffness)
    command = task.answer(compensator_of(task, "inverse"))
    assert rms_deg(task.respond(task.mechanism, command).output - task.target) < 1e-3


@pytest.mark.parametrize("kind", list(DriveKind))
@pytest.mark.compiler
def test_a_runtime_commands_what_the_inverse_does(kind: DriveKind) -> None:
    task = joint_of(kind)
    expected = task.answer(compensator_of(task, "inverse"))[1:200]
    runtime = tf.Runtime(task.scenario)
    found = np.array([np.atleast_1d(runtime.step(float(q))) for q in task.target[1:200, 0]])
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_gear_that_gives_is_refused_where_it_is_not_followed() -> None:
    task = joint_of(DriveKind.LOOP)
    with pytest.raises(InputError, match="gear_stiffness_N_m_per_rad is not taken into account by opti"):
        tf.opti(task.scenario)
    with pytest.raises(tf.ParameterError, match="simulate the scenario"):
        tf.simulate(task.problem, np.zeros(3), 1e-3)
