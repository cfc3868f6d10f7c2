"""Where joints move the path: the study, and the exported tuner around an independent plant."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.tuning import tuned_chain, tuning_of
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.adapt.result import Scheme
from tendonff.compensator.studies.adapt.tension import TensionTrials
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.compiler import find_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError
from tests.moving_plant import MovingPlant


@pytest.fixture(scope="module")
def moving(examples):
    settings = Adaptation(sensor=Sensor.ACTUATOR_POSITION, noise=2e-5, delay_samples=2)
    return replace(load_scenario(examples / "finger_moving.toml"), adaptation=settings)


@pytest.mark.compiler
@pytest.mark.nightly
def test_friction_that_is_off_is_tuned_away_while_joints_move(moving, monkeypatch):
    """On four of the study's plants: 40 masses, another step; the joints go on beyond the reference with it."""
    from tendonff.compensator.studies.adapt import tension as run

    names = ("friction \N{MINUS SIGN}20 %", "friction +20 %", "load +20 %", "friction drifts by +30 % in a minute")
    every = run.variations
    monkeypatch.setattr(
        run, "variations", lambda *given, **named: tuple(v for v in every(*given, **named) if v.name in names)
    )
    study = TensionTrials.run(moving)
    errors = {case.variation.name: {s: t.settled_percent for s, t in case.traces.items()} for case in study.cases}
    for name in names[:2]:
        assert errors[name][Scheme.FEEDFORWARD] > 5
        assert errors[name][Scheme.SELF_TUNING] < 0.5
    assert errors[names[2]][Scheme.SELF_TUNING] < 1.3 * errors[names[2]][Scheme.FEEDFORWARD]
    assert errors[names[3]][Scheme.SELF_TUNING] < 0.15 * errors[names[3]][Scheme.FEEDFORWARD]
    assert study.interval is None


@pytest.fixture(scope="module")
def problem(moving):
    return Problem.of(moving)


@pytest.fixture(scope="module", params=Precision)
def exported(moving, problem, tuner_of, request):
    """Exported C, at rest."""
    return tuner_of(moving, problem, request.param)


@pytest.mark.compiler
@pytest.mark.each_value
@pytest.mark.parametrize("mu", [0.8, 1.2])
def test_exported_it_finds_friction_that_is_20_percent_off_on_an_independent_plant(
    exported, problem, mu, record_property
):
    """60 masses at half the step; joint angles measured, 20 um of noise, two samples of delay."""
    reference, rig = problem.reference, problem.transmission
    friction = replace(rig.friction, mu_dynamic=mu * rig.friction.mu_dynamic, mu_static=mu * rig.friction.mu_static)
    plant = MovingPlant(replace(rig, friction=friction), reference.initial_tension_N, reference.step_s / 2, 15)
    angles = problem.chain.motion.at(reference.time_s)
    noise = 2e-5 * np.random.default_rng(1).normal(size=len(angles))
    exported.begin_at(reference.initial_tension_N, angles[0])
    force, position, seen, tension = reference.initial_tension_N, 0.0, [], []
    for k in range(1, len(angles)):
        seen.append(position + noise[k])
        new = exported.step(reference.tension_N[k], seen[max(0, k - 3)], angles[k])
        for part in (0.5, 1.0):
            output = plant.step(force + part * (new - force))
            position += plant.h * float(plant.v[0])
        force = new
        tension.append(output)
    late = slice(round(2 / reference.step_s), None)
    error = np.array(tension)[late] - reference.tension_N[1:][late]
    left = 100 * float(np.sqrt(np.mean(error**2))) / reference.range_N
    record_property("figure", f"moving path, exported C, actuator's position, mu {mu:g}: {left:.2f} % of range")
    assert left <= 0.8
    assert exported.mu == pytest.approx(mu * rig.friction.mu_dynamic, rel=0.02)
    assert exported.status == 0


@pytest.mark.compiler
def test_joint_angles_of_a_stated_age_are_taken_on_in_python_and_c_alike(moving, tuner_of):
    """10 ms late: the error is that of angles in time, but for what they accelerate meanwhile."""
    errors, age, late_s = {}, 10, 0.01
    for stated in (0, age):
        scenario = replace(moving, adaptation=replace(moving.adaptation, joint_delay_samples=stated))
        problem = Problem.of(scenario)
        reference, tuning = problem.reference, tuning_of(problem, scenario.adaptation)
        tuned, start, step = tuned_chain(problem, tuning), reference.initial_tension_N, reference.step_s
        tuner = SelfTuner(tuned, step, tuning, problem.limits, start, joints_late_s=late_s - stated * step)
        rig, wanted = SimulatedRig(tuned.chain, step, 1, start), reference.tension_N[1:]
        run = tuner.run(rig, wanted, np.zeros(len(wanted)))
        moving_on = (run.tension_N - wanted)[1000:3400]  # then the joints stop at once
        errors[stated] = float(np.sqrt(np.mean(moving_on**2))) / reference.range_N
    assert errors[0] > 0.005
    assert errors[age] < 0.15 * errors[0]
    exported = tuner_of(scenario, problem, Precision.DOUBLE)
    arrived = tuned.chain.motion.at(np.maximum(reference.time_s[1:] - late_s, 0.0))
    force = [exported.step(*row) for row in zip(wanted, run.measured, arrived, strict=True)]
    assert np.array(force) == pytest.approx(run.force_N, abs=1e-8)


@pytest.mark.compiler
def test_it_starts_at_rest_where_the_joints_stand(exported, problem):
    """Nothing moves: the force stays that of the start."""
    exported.begin_at(30.0, (0.35, -0.2))
    assert [exported.step(30.0, 0.0, (0.35, -0.2)) for _ in range(40)] == pytest.approx([30.0] * 40, abs=1e-4)
    assert exported.status == 0


@pytest.mark.compiler
def test_joint_angles_that_are_lost_for_a_while_are_flagged_and_teach_nothing(exported, problem, moving):
    reference, settings = problem.reference, tuning_of(problem, moving.adaptation)
    tuned, start = tuned_chain(problem, settings), reference.initial_tension_N
    rig = SimulatedRig(tuned.with_factors({Tunable.MU: 1.2}), reference.step_s, 1, start)
    wanted = reference.tension_N[1:2001]
    run = SelfTuner(tuned, reference.step_s, settings, problem.limits, start).run(rig, wanted, np.zeros(len(wanted)))
    angles = problem.chain.motion.at(reference.time_s[1:])
    exported.begin_at(start, problem.chain.motion.at(np.zeros(1))[0])
    forces, flagged, mus = [], [], []
    for k, (tension, measured) in enumerate(zip(wanted, run.measured, strict=True)):
        lost = 1400 <= k < 1420
        forces.append(exported.step(tension, measured, [np.nan, angles[k, 1]] if lost else angles[k]))
        flagged.append(exported.status & 1)
        mus.append(exported.mu)
    assert forces[:1400] == pytest.approx(run.force_N[:1400], abs=0.01)
    assert np.flatnonzero(flagged).tolist() == list(range(1400, 1420))
    assert np.ptp(mus[1402:1422]) < 1e-6  # two samples are still on their way
    assert np.abs(np.array(forces) - run.force_N)[1400:].max() < 2.0  # what the rate limit lets through in a sample
    assert forces[-1] == pytest.approx(run.force_N[-1], abs=0.05)
    assert mus[-1] == pytest.approx(0.24, rel=0.02)


@pytest.mark.nightly
@pytest.mark.compiler
@pytest.mark.parametrize("joints", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_the_exported_folder_compiles_without_a_warning_and_passes_its_self_test(moving, joints, tmp_path):
    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("make or cc is not installed")
    scenario = moving
    if not joints:  # the same sections, at rest
        still = {"joint": None, "angle_per_rad": 0.0, "length_per_rad_m": 0.0}
        path = moving.transmission.path
        path = replace(path, sections=tuple(replace(s, **still) for s in path.sections))
        scenario = replace(moving, joints={}, transmission=replace(moving.transmission, path=path))
    profile = Problem.of(scenario).inversion.force_N
    export_project(scenario, profile_N=profile).write(tmp_path / "c")
    run = subprocess.run(["make", "-s", "test"], cwd=tmp_path / "c", capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "passes adaptive: golden vectors" in run.stdout
    assert ("passes bounds" in run.stdout) is not joints


def test_without_a_compiler_it_is_said_what_brings_one(moving, monkeypatch):
    from tendonff.ocp.adaptation import code

    assert find_compiler is code.find_compiler
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(code, "find_compiler", lambda: None)
    with pytest.raises(CodeError, match=r"self-tuning runs as compiled C only.*ziglang"):
        TensionTrials.run(moving)
