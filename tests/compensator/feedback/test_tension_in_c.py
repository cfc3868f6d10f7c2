"""Feedback of a tension in C: the runtime beside an independent rig, and an exported folder."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.export.fmu import build_fmu
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler
FED = """
[feedback]
sensor = "output_tension"
delay_s = 0.004
sample_s = 0.004

[robust]
mu = 0.2
samples = 2
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """The finger over its first second."""
    file = tmp_path_factory.mktemp("fed") / "finger.toml"
    text = Path("examples/finger.toml").read_text("utf-8").replace("duration_s = 4.0", "duration_s = 1.0")
    file.write_text(text + FED, "utf-8")
    return tf.load_scenario(file)


def test_the_runtime_leaves_less_than_a_quarter_in_the_first_second(scenario, independent_rig, record_property):
    runtime, reference = tf.Runtime(scenario), sample_reference(scenario).tension_N
    plain, errors = tf.Runtime(replace(scenario, feedback=None)), []
    transmission = with_numbers(scenario.transmission, {"mu": 0.8})
    for run in (plain, runtime):
        rig = independent_rig.Rig(transmission, float(reference[0]), step_s=2e-5)
        tension, force = [rig.tension_N], float(reference[0])
        for k, wanted in enumerate(reference[1:].tolist()):
            seen = tension[max(k - 4, 0)] if run is runtime else None
            now = run.step(wanted, measured=seen)
            rig.advance(force, now, 1e-3)
            force = now
            tension.append(rig.tension_N)
        errors.append(float(np.sqrt(np.mean((np.array(tension) - reference) ** 2))))
    record_property("figure", f"finger, mu 20 % low: {errors[0]:.2f} N, with feedback in C {errors[1]:.2f} N")
    assert errors[1] < 0.25 * errors[0]


@pytest.mark.nightly
def test_a_unit_with_feedback_equals_the_runtime(scenario, tmp_path):
    """FMPy records the input a row late: row k + 1 holds what step k used."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    unit = build_fmu(scenario, Kind.FEEDBACK, FmiVersion.V3)
    unit.write(tmp_path)
    assert unit.name == "tff_feedback_fmi3.fmu"
    path = str(tmp_path / unit.name)
    assert validate_fmu(path) == []
    reference, time = sample_reference(scenario).tension_N[:300], np.arange(300) * 1e-3
    rows = list(zip(time, reference, 0.97 * np.roll(reference, 4), strict=True))
    out = fmpy.simulate_fmu(
        path,
        stop_time=time[-1],
        step_size=1e-3,
        output_interval=1e-3,
        input=np.array(rows, dtype=[(name, float) for name in ("time", "reference", "measured")]),
        output=["reference", "measured", "force"],
        fmi_type="CoSimulation",
    )
    runtime, plain = tf.Runtime(scenario), tf.Runtime(replace(scenario, feedback=None))
    for row in out[1:]:
        wanted, measured = float(row["reference"]), float(row["measured"])
        assert row["force"] == pytest.approx(runtime.step(wanted, measured=measured), abs=1e-9)
        least = plain.step(wanted)
    assert abs(out["force"][-1] - least) > 0.1


@pytest.mark.nightly
@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.FLOAT])
def test_an_exported_folder_tests_its_feedback(scenario, precision, tmp_path):
    tf.export_c(scenario, precision=precision).write(tmp_path)
    found = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
    assert "feedback: largest departure" in found.stdout
    assert "tff_feedback" in (tmp_path / "README.md").read_text("utf-8")
