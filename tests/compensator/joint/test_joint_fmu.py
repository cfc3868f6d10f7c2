"""Co-simulation units of driven joints: valid, and equal to the runtime at any communication step."""

import re
import shutil

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.export.joint.fmu import build_joint_fmu
from tendonff.compensator.export.kinds import FmiVersion
from tests.compensator.joint.test_joint_export import changed

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module", params=[("hand_joint", FmiVersion.V2), ("instrument_pair", FmiVersion.V3)])
def unit(request, examples, tmp_path_factory):
    """A unit on disk, its scenario and its outputs."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    (name, fmi), folder = request.param, tmp_path_factory.mktemp("fmu")
    scenario = changed(examples / f"{name}.toml", folder / "short.toml")
    made = build_joint_fmu(scenario, fmi)
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
    assert run(["export-fmu", path, "--kind", "plant", "--out", str(tmp_path / "no")]) == 2
    assert "have the kind inverse only" in "".join(capsys.readouterr())
