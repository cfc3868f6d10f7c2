"""The judgement at export, and the self test that is shipped: what it must see and what it must let pass."""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.golden import golden_vectors
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.judgement import judge, profiles_of
from tendonff.compensator.export.modules import OBSERVER
from tendonff.compensator.export.observer import ObserverDesign, observer_golden
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.self_test import tension_test
from tendonff.compensator.export.tension.data import checksum, limit_cases
from tendonff.compensator.export.tension.following import Status
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.inverse import invert

FLAGS = ("-std=c99", "-O0", "-w", "-ffp-contract=off", "-fno-math-errno")


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def small_moves(finger):
    """Moves within the transition of a reversal, where the capstan law jumps from branch to branch."""
    tensions = (30.0, 31.0, 30.0, 31.0, 30.0)
    moves = WaypointReference(times_s=(0.0, 0.1, 0.2, 0.3, 0.4), tensions_N=tensions, shape=Shape.SMOOTH)
    return replace(finger, reference=moves)


@pytest.mark.compiler
def test_a_module_that_is_worse_than_none_is_left_out_and_said(small_moves, tmp_path, capsys):
    scenario = tmp_path / "s.toml"
    scenario.write_text(scenario_to_toml(small_moves), encoding="utf-8")
    exported = export_project(small_moves)
    worse = {each.module for each in exported.judged if each.fault}
    nothing = exported.judged[0].score.rmse
    assert worse == {each.module for each in exported.judged[1:] if each.score.rmse > 1.01 * nothing}
    assert "capstan" in worse
    assert run(["export-c", str(scenario), "--out", str(tmp_path / "c")]) == 0
    said = capsys.readouterr().err
    content = json.loads((tmp_path / "c" / "design.json").read_text())
    for module in worse:
        assert f"{module} is not exported: RMS error" in said
        assert not (tmp_path / "c" / f"tff_{module}.c").exists()
        assert content["scores"][module]["rmse_N"] > content["scores"]["none"]["rmse_N"]
        assert f"tff_{module}" not in content["files"]
    assert "unfit" in said
    assert "worse than none: not exported" in (tmp_path / "c" / "README.md").read_text()
    assert run(["export-c", str(scenario), "--out", str(tmp_path / "d"), "--force-export"]) == 0
    for module in worse:
        assert (tmp_path / "d" / f"tff_{module}.c").exists()


@pytest.mark.compiler
def test_nothing_is_exported_where_all_modules_do_harm(finger, monkeypatch):
    from tendonff.compensator.export import c_project

    def all_bad(problem, forces):
        nothing, *others = judge(problem, forces)
        return (nothing, *(replace(each, fault="bad") for each in others))

    monkeypatch.setattr(c_project, "judge", all_bad)
    with pytest.raises(SolveError, match=r"nothing to export: .*inverse: bad.*--force-export"):
        export_project(finger, profile_N=sample_reference(finger).tension_N)


@pytest.mark.compiler
def test_the_judgement_is_an_independent_simulation_of_each_force(finger):
    """A force that is the reference itself has the error of no compensation, and a constant one the reference's own."""
    problem = Problem.of(finger)
    tension = problem.reference.tension_N
    constant = Profile(force_N=np.full(len(tension), tension[0]))
    none, same, still = judge(problem, {"same": Profile(force_N=tension), "still": constant})
    assert same.score == none.score
    assert still.score.rmse == pytest.approx(float(np.sqrt(np.mean((tension - tension[0]) ** 2))), rel=0.02)


@pytest.mark.compiler
def test_a_module_is_judged_by_what_it_answers_live_and_the_drive_lets_through(examples):
    """The last reversal, which `design` does not begin, is in its answer; a drive's speed limit is not, but binds."""
    problem = Problem.of(load_scenario(examples / "bowden.toml"))
    assert problem.kept is not None
    reference, names = problem.reference, ("inverse",)
    exact = invert(problem.chain, reference.tension_N, reference.step_s).force_N
    answer = profiles_of(problem, None, names=names)["inverse"]
    assert np.abs(answer.force_N - exact).max() <= 1e-9
    assert np.abs(answer.force_N - problem.inversion.force_N).max() > 1
    inverse = judge(problem, {"inverse": answer})[1]
    assert inverse.score.rmse_percent_of_range < 0.1
    slow = replace(problem.transmission, actuator=replace(problem.transmission.actuator, speed_max_m_per_s=0.02))
    held = replace(problem, transmission=slow)
    given = profiles_of(held, None, names=names)["inverse"]
    assert np.ptp(given.force_N) < 0.99 * np.ptp(answer.force_N)
    assert judge(held, {"inverse": given})[1].score.rmse > 10 * inverse.score.rmse


def test_every_branch_of_the_limiter_is_among_the_cases():
    cases = limit_cases(0.0, 200.0, 5.0, Precision.DOUBLE)
    assert {case.status for case in cases} >= {
        Status.OK,
        Status.FORCE_LIMITED,
        Status.RATE_LIMITED,
        Status.FORCE_LIMITED | Status.RATE_LIMITED,
        Status.FAILED,
    }
    for case in cases:
        assert Status.FAILED in case.status or abs(case.force_N - case.before_N) <= 5.0 + 1e-12


def test_limits_are_those_that_the_compiler_reads():
    """Nine digits of a double round to another float than the double itself where it lies next to a tie."""
    chance = np.random.default_rng(0)
    torn = next(
        value
        for value in chance.uniform(100, 2000, 10**6).tolist()
        if np.float32(float(f"{value:.9g}")) != np.float32(value)
    )
    forces = {case.force_N for case in limit_cases(0.0, torn, 5.0, Precision.FLOAT)}
    assert float(np.float32(float(f"{torn:.9g}"))) in forces
    assert float(np.float32(torn)) not in forces


def test_a_checksum_is_that_of_the_published_function():
    """FNV-1a of the eight bytes of 1.0, worked out by hand as of the byte string."""
    value = 2166136261
    for byte in b"\x00\x00\x00\x00\x00\x00\xf0\x3f":
        value = (value ^ byte) * 16777619 % 2**32
    assert checksum([1.0], Precision.DOUBLE) == value
    assert checksum([1.0, 2.0], Precision.DOUBLE) != checksum([2.0, 1.0], Precision.DOUBLE)


@pytest.fixture(scope="module")
def exported(examples):
    """The slow example in both precisions; its rate limit binds, and no bound of its is a float."""
    scenario = load_scenario(examples / "finger_fast.toml")
    actuator = replace(scenario.transmission.actuator, force_max_N=202.6471, force_min_N=0.1)
    scenario = replace(scenario, transmission=replace(scenario.transmission, actuator=actuator))
    profile = sample_reference(scenario).tension_N
    return {p: export_project(scenario, precision=p, profile_N=profile) for p in Precision}


MUTANTS = {
    "force_max times ten": ("types.h", "TFF_FORCE_MAX_N ", "TFF_FORCE_MAX_N 10 * "),
    "the rate limit off upwards": ("limits.c", "force > high", "force > TFF_LARGEST_N"),
    "the rate limit off downwards": ("limits.c", "force < low", "force < -TFF_LARGEST_N"),
    "no upper clamp": ("limits.c", "force = self->high;", "force = wanted;"),
    "no lower clamp": ("limits.c", "force = self->low;", "force = wanted;"),
    "no bit of the rate": ("limits.c", "status |= TFF_RATE_LIMITED", "status |= TFF_OK"),
    "what is not a number passes": ("limits.c", "/* not a number, or minus infinity */", "force = wanted;"),
    "REFERENCE_MAX times ten": ("types.h", "TFF_REFERENCE_MAX_N ", "TFF_REFERENCE_MAX_N 10 * "),
    "no WOULD_PUSH": ("inverse.c", "status |= TFF_WOULD_PUSH", "status |= TFF_OK"),
    "no FAILED of the plant": ("plant.c", "self->status = TFF_FAILED;", ""),
    "the actuator's position is the load's": ("plant.c", "x[TFF_PLANT_REALS - 2]", "x[TFF_PLANT_REALS - 1]"),
    "every sample of the profile halved": (
        "profile.c",
        "return profile[(index",
        "return (tff_real)0.5 * profile[(index",
    ),
}


@pytest.mark.compiler
@pytest.mark.nightly
@pytest.mark.parametrize("precision", Precision)
def test_the_self_test_passes_and_dies_with_every_safety_mutant(exported, precision, tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    right, wrong = tmp_path / "right", tmp_path / "wrong"
    right.mkdir()
    exported[precision].write(right)
    names = [p.name for p in (*sorted(right.glob("tff_*.c")), right / "self_test.c")]

    def result(folder, changed):
        """With the objects of the folder but for what is changed."""
        subprocess.run(["cc", *FLAGS, "-c", *([changed] if changed.endswith(".c") else names)], check=True, cwd=folder)
        objects = [name.replace(".c", ".o") for name in names]
        subprocess.run(["cc", *objects, "-lm", "-o", "st"], check=True, cwd=folder)
        return subprocess.run([folder / "st"], capture_output=True, text=True, check=False)

    said = result(right, "")
    assert said.returncode == 0, said.stdout
    alive = []
    for what, (end, old, new) in MUTANTS.items():
        text = (right / f"tff_{end}").read_text()
        assert old in text, what
        shutil.copytree(right, wrong, dirs_exist_ok=True)
        (wrong / f"tff_{end}").write_text(text.replace(old, new, 1))
        if result(wrong, f"tff_{end}").returncode == 0:
            alive.append(what)
    assert alive == []


@pytest.mark.compiler
def test_a_profile_alone_passes_its_own_test_with_either_compiler(finger, monkeypatch, tmp_path):
    """No data and no function of the self test are left over, where modules that follow a reference do harm."""
    from tendonff.compensator.export import c_project

    if shutil.which("make") is None:
        pytest.skip("make is not installed")

    def only_the_profile(problem, forces):
        return tuple(replace(e, fault="" if e.module in ("none", "profile") else "bad") for e in judge(problem, forces))

    monkeypatch.setattr(c_project, "judge", only_the_profile)
    export_project(finger, profile_N=sample_reference(finger).tension_N).write(tmp_path)
    for compiler in filter(shutil.which, ("gcc", "clang")):
        command = ["make", "-s", "clean", "test", f"CC={compiler}", "CFLAGS=-O0"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.compiler
def test_what_single_precision_loses_is_measured_and_said(exported, finger):
    """finger_fast loses little; a chain of light, stiff links at a tiny step loses much, and its report says so."""
    losses = json.loads(exported[Precision.FLOAT].files["design.json"])["float_loss"]
    assert 0 < losses["inverse"]["rms_N"] < 0.01
    assert "Single precision, measured" in exported[Precision.FLOAT].files["README.md"]
    assert not json.loads(exported[Precision.DOUBLE].files["design.json"])["float_loss"]
    tendon = replace(finger.transmission.tendon, stiffness_N_per_m=2e6)
    short = WaypointReference(times_s=(0.0, 0.02, 0.04), tensions_N=(30.0, 40.0, 30.0), shape=Shape.SMOOTH)
    hard = replace(
        finger,
        reference=short,
        run=replace(finger.run, step_s=2e-5),
        transmission=replace(finger.transmission, tendon=tendon),
    )
    found = export_project(hard, precision=Precision.FLOAT, profile_N=np.ones(3), force_export=True)
    much = {
        name
        for name, loss in json.loads(found.files["design.json"])["float_loss"].items()
        if loss["percent_of_range"] > 0.1
    }
    assert much == warned(found.warnings) == {"inverse"}
    assert warned(exported[Precision.FLOAT].warnings) == set()


def warned(warnings):
    """Modules that are said to lose much in single precision."""
    return {warning.split()[0] for warning in warnings if "use --precision double" in warning}


def test_golden_vectors_of_a_cycle_know_the_joints_beyond_its_period(examples):
    """The course goes on after the scenario's reference: its model must have its joints where they are commanded."""
    scenario = load_scenario(examples / "finger_moving.toml")
    problem = Problem.of(scenario)
    motion = problem.chain.motion
    rows = np.arange(60) * problem.reference.step_s
    short = replace(motion, time_s=rows, angle_rad=motion.at(rows * 5), period_s=float(rows[-1]))
    reference = problem.reference
    sampled = replace(reference, time_s=rows, tension_N=30 + np.sin(2 * np.pi * rows / rows[-1]), periodic=True)
    transmission = replace(problem.transmission, motion=short)
    course = golden_vectors(
        replace(problem, reference=sampled, transmission=transmission), None, Precision.DOUBLE
    ).course
    time = np.arange(len(course.reference_N)) * reference.step_s
    assert time[-1] > 2 * rows[-1]
    assert course.chain.motion.at(time) == pytest.approx(course.joint_rad, abs=1e-12)


@pytest.mark.compiler
def test_golden_vectors_of_the_observer_end_before_what_rounding_leaves_grows(finger):
    """A cycle under static friction above dynamic, where roundings grow by 2700: they would come near the tolerance."""
    rig = finger.transmission
    friction = replace(rig.friction, mu_dynamic=0.147, mu_static=0.176, viscous_N_s_per_m=1.55, adhesion_N=1.68)
    rig = replace(
        rig,
        path=replace(rig.path, total_angle_rad=3.61, segments=8),
        tendon=replace(rig.tendon, stiffness_N_per_m=4.8e4, damping_N_s_per_m=1.5),
        friction=replace(friction, bristle_stiffness_N_per_m=4.5e5),
        actuator=replace(rig.actuator, mass_kg=0.17, damping_N_s_per_m=10.3, force_max_N=250.0),
        load=replace(rig.load, mass_kg=0.0078, stiffness_N_per_m=3950.0),
    )
    cycle = SineReference(
        initial_tension_N=74.7,
        amplitudes_N=(19.5,),
        frequencies_Hz=(2.5,),
        duration_s=0.4,
        fade_in_s=0.0,
        periodic=True,
    )
    run_as = replace(finger.run, step_s=5e-4, level=Level.ELASTIC)
    problem = Problem.of(scenario := replace(finger, transmission=rig, reference=cycle, run=run_as))
    course = golden_vectors(problem, None, Precision.DOUBLE).course
    golden = observer_golden(ObserverDesign(problem=problem), course.chain, course.reference_N, Precision.DOUBLE)
    assert 200 < len(golden.output_N) < len(course.reference_N)
    sources = c_sources(scenario, problem, [OBSERVER], Precision.DOUBLE, "tff")
    given = {OBSERVER.name: golden.given(without_position=True)}
    (found,) = run_on_host(sources, "tff", Precision.DOUBLE, [given])
    assert np.abs(found[OBSERVER.name] - golden.output_N).max() < 1e-10 * golden.input_N.max()


@pytest.mark.compiler
def test_a_course_with_a_far_end_that_is_moved_is_not_compared_where_a_step_takes_long(finger):
    """The exported observer gives such a step up; here one takes 360 evaluations."""
    rig = finger.transmission
    friction = replace(rig.friction, mu_dynamic=0.214, mu_static=0.214, viscous_N_s_per_m=1.56, adhesion_N=0.724)
    rig = replace(
        rig,
        path=replace(rig.path, total_angle_rad=5.783, segments=2),
        tendon=replace(
            rig.tendon,
            mass_kg=1.15e-3,
            stiffness_N_per_m=16733.0,
            relaxing_stiffness_N_per_m=3746.0,
            relaxation_time_s=0.566,
            damping_N_s_per_m=5.66,
        ),
        friction=replace(friction, bristle_stiffness_N_per_m=1.338e6, soft_bristle_stiffness_N_per_m=2.908e5),
        actuator=replace(rig.actuator, mass_kg=0.26, damping_N_s_per_m=14.85, force_max_N=493.0),
        load=replace(rig.load, mass_kg=9.0e-3, stiffness_N_per_m=3127.0, damping_N_s_per_m=12.04),
    )
    times, tensions = (0.0, 0.5123, 1.0247, 1.537), (21.085, 13.282, 14.97, 12.356)
    ways = WaypointReference(times_s=times, tensions_N=tensions, shape=Shape.LINEAR)
    run_as = replace(finger.run, step_s=1e-3, level=Level.VISCOELASTIC)
    problem = Problem.of(replace(finger, transmission=rig, reference=ways, run=run_as))
    course = golden_vectors(problem, None, Precision.DOUBLE).course
    golden = observer_golden(ObserverDesign(problem=problem), course.chain, course.reference_N, Precision.DOUBLE)
    assert len(golden.output_N) > 200
    assert len(golden.position_m) == len(golden.far_output_N) == 0


def test_bits_of_a_position_drive_follow_forces_not_by_commands(finger):
    """Jumps of a finger behind a stiff servo with a wide rate limit never meet it."""
    bounds = {"force_max_N": 1e6, "force_rate_max_N_per_s": 1e9}
    actuator = replace(finger.transmission.actuator, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5, **bounds)
    servo = replace(finger, transmission=replace(finger.transmission, actuator=actuator))
    problem = Problem.of(servo)
    golden = golden_vectors(problem, None, Precision.DOUBLE)
    script = Script(precision=Precision.DOUBLE, prefix="tff")
    test = tension_test(problem, None, np.full(3, 0.0), golden, None, script, ["inverse"], ())
    assert not Status(test.jump_bits["inverse"]) & Status.RATE_LIMITED
