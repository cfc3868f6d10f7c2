"""Exported code of drives: dry friction of their own, position servos, cycles."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.fmu import build_fmu
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.reference import Shape, WaypointReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


def actuated(scenario, **values):
    rig = scenario.transmission
    return replace(scenario, transmission=replace(rig, actuator=replace(rig.actuator, **values)))


def exported(scenario, name, inputs, precision=Precision.DOUBLE):
    """Answers of one module of an export."""
    modules = [module for module in c_modules(scenario) if module.name == name]
    sources = c_sources(scenario, Problem.of(scenario), modules, precision, "tff")
    return run_on_host(sources, "tff", precision, [{name: inputs}])[0][name]


@pytest.mark.parametrize(
    "level",
    [
        Level.ELASTIC,
        pytest.param(Level.VISCOELASTIC, marks=pytest.mark.nightly),  # the code of presliding, other numbers
        Level.PRESLIDING,
    ],
)
def test_the_exported_inverse_of_a_rubbing_drive_is_that_of_python(finger, level):
    scenario = actuated(replace(finger, run=replace(finger.run, level=level)), coulomb_N=4.0, gear_efficiency=0.9)
    problem = Problem.of(scenario)
    wanted, step = problem.reference.tension_N, problem.reference.step_s
    expected = invert(problem.chain, wanted, step).force_N
    assert exported(scenario, "inverse", wanted) == pytest.approx(expected, abs=1e-9)
    smooth = invert(Chain.of(finger.transmission, level), wanted, step).force_N
    assert np.abs(expected - smooth).max() > 3.9
    if level is Level.PRESLIDING:  # stiff bristles cost single precision 0.02 N, with and without a drive that rubs
        single = exported(scenario, "inverse", wanted, Precision.FLOAT)
        assert single == pytest.approx(expected, abs=1e-3)


def test_without_dry_friction_the_text_names_none(finger):
    short = replace(finger, reference=replace(finger.reference, duration_s=0.5))
    files = export_project(short, profile_N=np.full(3, 30.0), force_export=True).files
    assert not any(re.search(r"coulomb|\bf_d", text) for name, text in files.items() if name != "design.json")
    rubbing = export_project(actuated(short, coulomb_N=4.0), profile_N=np.full(3, 30.0)).files
    assert "f_d" in rubbing["tff_inversion.h"]


SERVO = {"drive": Drive.POSITION, "servo_stiffness_N_per_m": 2e5}


def test_the_exported_inverse_of_a_servo_answers_with_the_command(finger, record_property):
    """x_c1 = q_a + (F - T0)/k: against the command column of a design, whose travel the same inverse has."""
    scenario = actuated(finger, **SERVO)
    problem = Problem.of(scenario)
    profile = with_motion(problem, "inverse", compensator("inverse").profile(problem))
    wanted = problem.reference.tension_N
    assert exported(scenario, "inverse", wanted) == pytest.approx(profile.command_m, abs=1e-12)
    single = exported(scenario, "inverse", wanted, Precision.FLOAT)
    loss = np.abs(single - profile.command_m).max()
    record_property("figure", f"command of a servo in float: {1e9 * loss:.2g} nm off in {len(wanted)} samples")
    assert loss < 1e-7


def test_a_servo_in_float_does_not_creep(finger):
    """The command follows from elongations and tensions, so rounding does not add up over many samples."""
    short = replace(finger, reference=replace(finger.reference, duration_s=0.5))
    scenario = actuated(short, **SERVO)
    wave = 30 + 8 * np.sin(2 * np.pi * 2.0 * np.arange(60_000) * 1e-3)
    single = exported(scenario, "inverse", wave, Precision.FLOAT)
    exact = invert(Problem.of(scenario).chain, wave, 1e-3, record=True)
    rest = exact.states[0, -2]
    command = exact.states[:, -2] - rest + (exact.force_N - 30.0) / 2e5
    assert np.abs(single - command)[-1000:].max() < 1e-7


@pytest.mark.parametrize("precision", [pytest.param(Precision.DOUBLE, marks=pytest.mark.nightly), Precision.FLOAT])
def test_the_folder_of_a_servo_passes_its_own_test(finger, tmp_path, precision):
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    scenario = actuated(finger, coulomb_N=2.0, **SERVO)
    made = export_project(scenario, precision=precision, profile_N=np.full(3, 1e-3))
    assert "tff_capstan.c" not in made.files
    assert "tff_stream.c" in made.files
    made.write(tmp_path)
    said = subprocess.run(["make", "test", "example"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "self test passed" in said.stdout, said.stdout + said.stderr
    rows = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=True).stdout.splitlines()
    _, reference, command, tension, _ = map(float, rows[-1].split(","))
    assert tension == pytest.approx(reference, abs=0.01)
    assert rows[0].split(",")[2] == "command_m"
    assert abs(command) < 0.05


def test_the_cycle_of_a_servo_is_exported_as_commands_that_loop(finger):
    cycle = WaypointReference(times_s=(0, 0.2, 0.4), tensions_N=(20.0, 40.0, 20.0), shape=Shape.SMOOTH, periodic=True)
    scenario = actuated(replace(finger, reference=cycle), **SERVO)
    made = export_project(scenario)
    problem = Problem.of(scenario)
    optimal = with_motion(problem, "optimal", compensator("optimal").profile(problem))
    assert made.profile_N == pytest.approx(optimal.command_m[:-1], abs=1e-12)
    assert "Command [m] of the next sample of the cycle" in made.files["tff_profile.h"]
    worst = max(each.score.rmse_percent_of_range for each in made.judged if each.module in ("inverse", "profile"))
    assert worst < 0.05  # on 40 masses


def test_self_tuning_behind_a_servo_is_refused(finger, examples):
    tuned = load_scenario(examples / "finger_adaptive.toml")
    with pytest.raises(InputError, match="self-tuning needs a force drive"):
        export_project(actuated(tuned, **SERVO))


@pytest.mark.parametrize("kind", [Kind.INVERSE, Kind.PLANT])
def test_the_unit_of_a_servo_speaks_of_commands(finger, tmp_path, kind):
    fmpy, validation = pytest.importorskip("fmpy"), pytest.importorskip("fmpy.validation")
    scenario = actuated(finger, **SERVO)
    unit = build_fmu(scenario, kind, FmiVersion.V2)
    unit.write(tmp_path)
    problem = Problem.of(scenario)
    profile = with_motion(problem, "inverse", compensator("inverse").profile(problem))
    time, step = problem.reference.time_s, problem.reference.step_s
    name, given = ("reference", problem.reference.tension_N) if kind is Kind.INVERSE else ("command", profile.command_m)
    rows = np.array(list(zip(time, given, strict=True)), dtype=[("time", float), (name, float)])
    wanted = "command" if kind is Kind.INVERSE else "tension"
    assert validation.validate_fmu(str(tmp_path / unit.name)) == []
    found = fmpy.simulate_fmu(
        str(tmp_path / unit.name), input=rows, output=[wanted], step_size=step, output_interval=step, stop_time=time[-1]
    )
    expected = profile.command_m if kind is Kind.INVERSE else problem.reference.tension_N
    steady = slice(1, len(found) - 1)  # row k + 1 holds what step k used
    assert found[wanted][steady] == pytest.approx(
        expected[: len(found) - 2], abs=1e-9 if kind is Kind.INVERSE else 1e-4
    )
