"""A joint that tunes itself: exported C and runtime on a plant that is written without the package's models."""

import json
import subprocess

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import parse_joint_scenario, sample_joint
from tendonff.compensator.studies.adapt import loop as study
from tendonff.models.parameters.numbers import with_numbers
from tests.joint_plant import Plant

pytestmark = pytest.mark.compiler
COUNT_RAD = 2 * np.pi / 4096
TABLE = '\n[adaptation]\nsensor = "joint_angle"\nnoise = 4.4e-4\n'


@pytest.fixture(scope="module")
def scenario(examples):
    """The hand's joint at 250 Hz, with an encoder of 12 bits."""
    text = (examples / "hand_joint.toml").read_text("utf-8").replace("step_s = 0.001", "step_s = 0.004")
    return parse_joint_scenario(text + TABLE, examples / "hand_joint.toml")


def follow(scenario, mu, tension, *, kind, stuck_s=np.inf):
    """Errors of the joint's angle over three strokes there and back, and the factors in use."""
    once = sample_joint(scenario).angle_rad
    angle, step = np.concatenate([once, once[1:], once[1:]]), scenario.run.step_s
    pretension = tension * scenario.mechanism.drive.pretension_N
    mechanism = with_numbers(scenario.mechanism, {"mu": mu, "drive.pretension_N": pretension})
    plant = Plant(mechanism, step, float(angle[0]), tensions_N=np.full(2, pretension), masses=16, step_s=5e-6)
    runtime = tf.Runtime(scenario, kind=kind)
    found, factors, last, measured = [float(angle[0])], [], 0.0, 0.0
    for k in range(1, len(angle)):
        measured = measured if k * step > stuck_s else round(found[-1] / COUNT_RAD) * COUNT_RAD
        heard = measured if runtime.kind is tf.RuntimeKind.ADAPTIVE else None
        command = runtime.step(float(angle[k]), measured=heard)
        found.append(plant.turn(np.array([last, command]))[0, 0])
        factors.append(runtime.factor)
        last = command
    return np.rad2deg(np.array(found) - angle)[-len(once) :], np.array(factors), runtime


@pytest.mark.parametrize(("mu", "tension"), [(1.3, 1.0), (0.7, 0.8)])
def test_friction_and_tension_that_are_off_are_found_on_an_independent_plant(scenario, mu, tension):
    """At least five times less error than the inverse alone."""
    plain, _, _ = follow(scenario, mu, tension, kind="joint")
    tuned, factors, _ = follow(scenario, mu, tension, kind="adaptive")
    assert np.sqrt(np.mean(tuned**2)) < 0.2 * np.sqrt(np.mean(plain**2))
    assert np.sqrt(np.mean(plain**2)) > 0.1
    assert (factors[-1] > 1) == (mu * tension > 1)


def test_an_encoder_that_is_stuck_freezes_the_last_good_factor(scenario):
    _, factors, runtime = follow(scenario, 1.3, 1.0, kind="adaptive", stuck_s=6.0)
    good = factors[round(6.0 / scenario.run.step_s)]
    assert good > 1.08
    assert factors[-1] == pytest.approx(good, abs=0.05)
    assert tf.RuntimeStatus.FROZEN in runtime.status


def test_without_measurements_it_is_the_inverse(scenario):
    plain, tuned = tf.Runtime(scenario, kind="joint"), tf.Runtime(scenario)
    for angle in sample_joint(scenario).angle_rad[::3]:
        assert tuned.step(float(angle)) == pytest.approx(plain.step(float(angle)), abs=1e-12)


def test_exported_code_passes_its_own_test(scenario, tmp_path):
    """In single precision; the runtime runs the other one."""
    exported = tf.export_c(scenario, precision=tf.Precision.FLOAT)
    exported.write(tmp_path)
    made = subprocess.run(
        ["make", "-s", "test", "CFLAGS=-O0"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (made.returncode, made.stdout.splitlines()[-1]) == (0, "self test passed"), made.stdout
    assert "a stuck sensor freezes the factor" in made.stdout


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('kind = "loop" ', 'kind = "pair"\nleast_tension_N = 2.0 #', "a pair has none"),
        ('sensor = "joint_angle"', 'sensor = "joint_angle"\nparameters = []', 'must be "mu", "pretension" or both'),
        ("mu_dynamic = 0.2 ", "mu_dynamic = 0.0 ", "must have lost motion"),
    ],
)
def test_what_cannot_be_tuned_is_refused(scenario, old, new, why):
    text = scenario.text.replace(old, new).replace(
        "pretension_N = 5.0 ", "# " if "pair" in new else "pretension_N = 5.0 "
    )
    text = text.replace("mu_static = 0.2", "mu_static = 0.0") if "0.0 " in new else text
    with pytest.raises(InputError, match=why):
        tf.Runtime(parse_joint_scenario(text, scenario.source))


@pytest.mark.usefixtures("unpainted")
def test_adapt_judges_it_on_loops_that_differ(scenario, tmp_path, monkeypatch, capsys):
    file = tmp_path / "joint.toml"
    file.write_text(scenario.text, "utf-8")
    monkeypatch.setattr(study, "VARIATIONS", study.VARIATIONS[2:3])
    monkeypatch.setattr(study, "SHORTEST_S", 6.0)
    assert run(["adapt", str(file), "--out", str(tmp_path / "out")]) == 0
    assert "deg after" in capsys.readouterr().err
    (case,) = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))["plants"].values()
    assert case["settled_rmse_deg"] < 0.5 * case["plain_settled_rmse_deg"]
