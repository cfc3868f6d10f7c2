"""Co-simulation units of driven joints: valid, and equal to the runtime at any communication step."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.export.driven.table import LiveTable
from tendonff.compensator.export.joint.fmu import build_joint_fmu
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.ocp.codegen.precision import Precision
from tests.compensator.export.test_joint_export import changed

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module", params=[("hand_joint", FmiVersion.V2), ("instrument_pair", FmiVersion.V3)])
def unit(request, examples, tmp_path_factory):
    """A unit on disk, its scenario and its outputs."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    (name, fmi), folder = request.param, tmp_path_factory.mktemp("fmu")
    scenario = changed(examples / f"{name}.toml", folder / "short.toml")
    made = build_joint_fmu(scenario, fmi=fmi)
    error, alone = (float(number) for number in re.findall(r"(?:error|alone) ([\d.]+) deg", made.lines[0]))
    assert error < alone, made.lines[0]
    made.write(folder)
    return folder / made.name, scenario, ["motor"] if name == "hand_joint" else ["motor_open", "motor_close"]


@pytest.mark.parametrize(("step", "parts"), [(1e-3, 1), (2.4e-3, 2)])
def test_a_unit_of_a_joint_is_valid_and_equals_the_runtime(unit, step, parts):
    """FMPy records the input a row late: row k + 1 holds what step k used."""
    from fmpy.validation import validate_fmu

    path, scenario, motors = unit
    if parts == 1:
        assert validate_fmu(str(path)) == []
    time = np.arange(201) * step
    signal = np.array([(t, 0.3 * np.sin(9 * t)) for t in time], dtype=[("time", float), ("angle", float)])
    out = fmpy.simulate_fmu(
        str(path),
        stop_time=time[-1],
        step_size=step,
        output_interval=step,
        input=signal,
        output=["angle", *motors],
        fmi_type="CoSimulation",
    )
    runtime = tf.Runtime(scenario)
    for row in out[1:]:
        commands = [runtime.step(float(row["angle"]), dt=step / parts) for _ in range(parts)]
        assert [row[name] for name in motors] == pytest.approx(np.atleast_1d(commands[-1]), abs=1e-12)
    assert np.ptp(out[motors[0]]) > 0.1


def test_the_command_writes_a_unit_and_refuses_what_a_joint_has_not(examples, tmp_path, capsys):
    path = str(changed(examples / "hand_joint.toml", tmp_path / "short.toml").source)
    assert run(["export-fmu", path, "--fmi", "2.0", "--out", str(tmp_path / "fmu")]) == 0
    assert [file.name for file in (tmp_path / "fmu").iterdir()] == ["tff_joint_fmi2.fmu"]
    assert "knuckle: RMS error" in "".join(capsys.readouterr())
    assert run(["export-fmu", path, "--kind", "capstan", "--out", str(tmp_path / "no")]) == 2
    assert "no unit of the kind capstan: the capstan law gives the ratio" in "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("name", "motors", "tendon"),
    [("hand_joint", ["motor"], "flexor"), ("instrument_pair", ["motor_open", "motor_close"], "open")],
)
def test_the_plant_of_a_joint_undoes_its_inverse(examples, tmp_path, name, motors, tendon):
    """A unit for a loop closed in simulation: angles of the motors in, the joint's angle out."""
    scenario = changed(examples / f"{name}.toml", tmp_path / "short.toml")
    unit = build_joint_fmu(scenario, Kind.PLANT)
    unit.write(tmp_path)
    runtime, time = tf.Runtime(scenario), np.arange(201) * 1e-3
    wanted = 0.15 * (1 - np.cos(9 * time))
    runtime.step(0.0)  # the sample at t = 0, before a first step at rest
    motor = np.array([np.atleast_1d(runtime.step(angle)) for angle in wanted])
    signal = np.array(list(zip(time, *motor.T, strict=True)), dtype=[("time", float), *((m, float) for m in motors)])
    out = fmpy.simulate_fmu(
        str(tmp_path / unit.name),
        stop_time=time[-1],
        step_size=1e-3,
        output_interval=1e-3,
        input=signal,
        output=[*motors, "angle", f"tension_{tendon}"],
        fmi_type="CoSimulation",
    )
    for each, column in zip(motors, motor.T, strict=True):
        assert out[each][1:] == pytest.approx(column[:-1])
    assert out["angle"][1:] == pytest.approx(wanted[:-1], abs=1e-9)
    assert out[f"tension_{tendon}"].min() > 0


def test_the_table_of_a_joint_is_a_unit(examples, tmp_path):
    scenario = changed(examples / "hand_joint.toml", tmp_path / "short.toml")
    unit = build_joint_fmu(scenario, Kind.TABLE)
    unit.write(tmp_path)
    task = JointTask.of(scenario)
    time, angle = task.sampled.time_s, task.sampled.angle_rad
    signal = np.array(list(zip(time, angle, strict=True)), dtype=[("time", float), ("angle", float)])
    out = fmpy.simulate_fmu(
        str(tmp_path / unit.name),
        stop_time=time[-1],
        step_size=1e-3,
        output_interval=1e-3,
        input=signal,
        output=["angle", "motor"],
        fmi_type="CoSimulation",
    )
    command, _ = LiveTable.of(task).respond(out["angle"][1:], Precision.DOUBLE)
    assert out["motor"][1:] == pytest.approx(command[:, 0], abs=1e-12)
    assert np.ptp(command) > 0.5


@pytest.mark.nightly
def test_the_adaptive_unit_of_a_joint_equals_its_runtime(examples, tmp_path):
    """With a measurement that is late and small, so that the factor moves."""
    table = '\n[adaptation]\nsensor = "joint_angle"\n'
    scenario = changed(examples / "hand_joint.toml", tmp_path / "short.toml", head=table)
    unit = build_joint_fmu(scenario, Kind.ADAPTIVE, FmiVersion.V3)
    unit.write(tmp_path)
    names = ["angle", "measured"]
    time = np.arange(301) * 1e-3
    columns = (time, 0.3 * np.sin(9 * time), 0.28 * np.sin(9 * time - 0.02))
    signal = np.array(list(zip(*columns, strict=True)), dtype=[(name, float) for name in ("time", *names)])
    out = fmpy.simulate_fmu(
        str(tmp_path / unit.name),
        stop_time=time[-1],
        step_size=1e-3,
        output_interval=1e-3,
        input=signal,
        output=[*names, "motor", "factor"],
        fmi_type="CoSimulation",
    )
    runtime = tf.Runtime(scenario)
    for row in out[1:]:
        command = runtime.step(float(row["angle"]), dt=1e-3, measured=float(row["measured"]))
        assert (row["motor"], row["factor"]) == pytest.approx((command, runtime.factor), abs=1e-12)
    assert np.ptp(out["factor"]) > 0


@pytest.mark.nightly
@pytest.mark.parametrize(("example", "motors"), [("hand_joint", ["motor"]), ("instrument_pair", None)])
def test_the_unit_with_feedback_equals_its_runtime(examples, tmp_path, example, motors):
    """With a measurement that is late and small, at another step than the scenario's."""
    table = '\n[feedback]\nsensor = "joint_angle"\ndelay_s = 0.01\nsample_s = 0.004\n[robust]\nsamples = 1\n'
    scenario = changed(examples / f"{example}.toml", tmp_path / "short.toml", head=table)
    unit = build_joint_fmu(scenario, Kind.FEEDBACK, FmiVersion.V2)
    unit.write(tmp_path)
    names, motors = ["angle", "measured"], motors or ["motor_open", "motor_close"]
    time = np.arange(201) * 1e-3
    columns = (time, 0.3 * np.sin(9 * time), 0.28 * np.sin(9 * time - 0.02))
    signal = np.array(list(zip(*columns, strict=True)), dtype=[(name, float) for name in ("time", *names)])
    out = fmpy.simulate_fmu(
        str(tmp_path / unit.name),
        stop_time=time[-1],
        step_size=2e-3,
        output_interval=2e-3,
        input=signal,
        output=[*names, *motors],
        fmi_type="CoSimulation",
    )
    runtime, plain = tf.Runtime(scenario), tf.Runtime(replace(scenario, feedback=None))
    apart = 0.0
    for row in out[1:]:
        angle, measured = float(row["angle"]), float(row["measured"])
        for _ in range(2):
            command, alone = runtime.step(angle, dt=1e-3, measured=measured), plain.step(angle, dt=1e-3)
        assert [row[name] for name in motors] == pytest.approx(np.atleast_1d(command), abs=1e-12)
        apart = max(apart, float(np.abs(command - alone).max()))
    assert apart > 1e-3
