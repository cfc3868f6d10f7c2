"""Blind, with the loop closed through the exported C: 40 masses, hidden friction, noise, 2 ms of delay."""

import shutil
import subprocess

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler
TENSION, POSITION = Sensor.OUTPUT_TENSION, Sensor.ACTUATOR_POSITION
BOTH = (Tunable.MU, Tunable.LOAD_STIFFNESS)


@pytest.mark.each_value
@pytest.mark.parametrize("precision", Precision)
@pytest.mark.parametrize(("sensor", "most"), [(TENSION, 0.6), (POSITION, 1.0)])
@pytest.mark.parametrize("mu", [0.8, 1.2])
def test_the_exported_tuner_finds_friction_that_is_20_percent_off(
    exported, blind, precision, sensor, most, mu, record_property
):
    tuner = exported(sensor, precision=precision)
    left = blind(tuner, sensor, mu=mu)
    record_property("figure", f"exported C, {precision}, {sensor}, mu {mu:g}: {left:.2f} % of range after 2 s")
    assert left <= most
    assert tuner.mu == pytest.approx(0.2 * mu, rel=0.01)


@pytest.mark.parametrize("load", [2 / 3, 1.5])
@pytest.mark.parametrize("mu", [0.8, 1.2])
def test_the_exported_tuner_finds_friction_and_load_from_the_position(exported, blind, load, mu, record_property):
    left = blind(exported(POSITION, BOTH), POSITION, mu=mu, load=load)
    record_property("figure", f"exported C, mu {mu:g} and load {load:.2f} from the position: {left:.2f} %")
    assert left <= 1.0


@pytest.mark.parametrize("sensor", [TENSION, POSITION])
@pytest.mark.parametrize(
    ("hidden", "most"), [({}, 0.5), ({"bristle": 2.0, "mu": 1.2}, 3.0), ({"bristle": 2.0, "mu": 0.8}, 3.0)]
)
def test_the_exported_tuner_bears_what_it_cannot_tune(exported, blind, sensor, hidden, most, record_property):
    left = blind(exported(sensor), sensor, **hidden)
    record_property("figure", f"exported C, {sensor}, {hidden or 'as the scenario'}: {left:.2f} %")
    assert left <= most


def test_estimates_are_kept_over_a_restart(exported, finger, blind):
    reference = Problem.of(finger).reference
    first, second = exported(TENSION), exported(TENSION)
    blind(first, TENSION, mu=1.2)
    assert first.mu == pytest.approx(0.24, rel=0.01)
    first.library.keep(first.address, second.address)
    assert second.mu == first.mu
    # The restored estimate acts at once: the first steps take the force of that friction.
    plain = exported(TENSION)
    forces = np.array([[t.step(w, np.nan) for t in (second, plain)] for w in reference.tension_N[1:800]])
    assert np.abs(forces[:, 0] - forces[:, 1]).max() > 0.1


@pytest.mark.parametrize("precision", [Precision.FLOAT, pytest.param(Precision.DOUBLE, marks=pytest.mark.nightly)])
def test_the_whole_folder_passes_its_own_test(examples, tmp_path, precision):
    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("make or cc is not installed")
    scenario = load_scenario(examples / "finger_adaptive.toml")
    start = Problem.of(scenario).reference.initial_tension_N
    export_project(scenario, precision=precision, profile_N=np.full(3, start)).write(tmp_path)
    done = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "adaptive" in done.stdout


TUNER = "tff_adaptive.c"
MUTANTS = {
    "bad references taken": ("(tff_is_within(reference", "(1 + tff_is_within(reference"),
    "limits bypassed": ("force = tff_output_set(&self->output, ", "force = ("),
    "status bits not set": ("self->output.status |= more;", ""),
    "status bits not gathered": ("self->output.seen |= more;", ""),
    "what is no number is heard": ("int heard = 0;\n    int stuck", "int heard = 1;\n    int stuck"),
    "a stuck sensor teaches": ("(self->stale > t->deviation) ? ", "(self->stale < t->deviation) ? "),
    "a stuck sensor is not said": (
        "(self->lost != 0) || (stuck != 0)) {",
        "(self->lost != 0)) {",
    ),
    "a lost reference not noted": (
        "tff_lose(&self->output, &self->entry, reference)",
        "tff_output_hold(&self->output, TFF_INPUT_HELD)",
    ),
    "missed calls not noted": ("tff_entry_lose(&self->entry, samples);", ""),
    "bad starts taken": (
        "initial_tension, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N)",
        "initial_tension, -1e9, 1e9)",
    ),
    "bad forces of a start taken": ("if ((tff_begin_at(", "if ((1 + tff_begin_at("),
    "limits not taken": ("return tff_output_use(&self->output, given);", "return 0;"),
    "bad estimates restored": ("!= 0) ? good : 0;", ">= 0) ? good : 0;"),
}


@pytest.mark.nightly
def test_the_shipped_self_test_dies_with_every_safety_mutant_of_the_tuner(examples, tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    scenario = load_scenario(examples / "finger_adaptive.toml")
    start = Problem.of(scenario).reference.initial_tension_N
    export_project(scenario, profile_N=np.full(3, start)).write(tmp_path)
    flags = ("-std=c99", "-O0", "-w", "-ffp-contract=off")
    others = [p.name for p in sorted(tmp_path.glob("*.c")) if p.name not in (TUNER, "example_main.c")]
    subprocess.run(["cc", *flags, "-c", *others], cwd=tmp_path, check=True)
    objects = [name.replace(".c", ".o") for name in others]
    text = (tmp_path / TUNER).read_text()

    def lives(changed):
        (tmp_path / TUNER).write_text(changed)
        subprocess.run(["cc", *flags, *objects, TUNER, "-lm", "-o", "st"], cwd=tmp_path, check=True)
        return subprocess.run([tmp_path / "st"], capture_output=True, check=False).returncode == 0

    assert lives(text)
    for what, (old, _) in MUTANTS.items():
        assert old in text, what
    assert [what for what, (old, new) in MUTANTS.items() if lives(text.replace(old, new, 1))] == []
