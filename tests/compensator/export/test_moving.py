"""Exported C on paths in sections and on paths that joints move, against the Python model."""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenario.joints import SineJoint
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters import Load
from tendonff.models.parameters.drive import Drive
from tendonff.models.path import SectionKind
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.target_joints import tanh_fraction
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

pytestmark = pytest.mark.compiler

TOLERANCE_N = {Precision.DOUBLE: 1e-9, Precision.FLOAT: 0.02}
ROWS = 1200


@pytest.fixture(scope="module")
def moving(examples):
    return load_scenario(examples / "finger_moving.toml")


def changed(scenario, **sections):
    """The scenario with other fields of its sections, by the place of the section."""
    parts = list(scenario.transmission.path.sections)
    for name, fields in sections.items():
        parts[int(name[1:])] = replace(parts[int(name[1:])], **fields)
    total = sum(part.angle_rad for part in parts)
    path = replace(scenario.transmission.path, sections=tuple(parts), total_angle_rad=total)
    return replace(scenario, transmission=replace(scenario.transmission, path=path))


def straightens(scenario):
    """A wrap angle that vanishes and returns."""
    swing = SineJoint(amplitudes_rad=(1.2,), frequencies_Hz=(2.0,), fade_in_s=0.1)
    return replace(scenario, joints={**scenario.joints, "knuckle": swing})


def far_driven(scenario):
    """The far end follows a joint."""
    old = scenario.transmission.load
    load = Load(
        mass_kg=old.mass_kg, damping_N_s_per_m=0.0, stiffness_N_per_m=3000.0, joint="middle", moment_arm_m=0.005
    )
    slower = {name: replace(joint, amplitudes_rad=(0.1,)) for name, joint in scenario.joints.items()}
    return replace(scenario, transmission=replace(scenario.transmission, load=load), joints=slower)


def at_rest(scenario):
    """Sections without joints: coefficients of their own, a pulley, other friction when releasing, Stribeck effect."""
    still = {"joint": None, "angle_per_rad": 0.0, "length_per_rad_m": 0.0}
    made = changed(
        scenario,
        s0={"mu_dynamic": 0.3, "mu_static": 0.33},
        s1={**still, "kind": SectionKind.PULLEY, "bearing_exponent": 0.02},
        s3={**still, "mu_dynamic_release": 0.15},
    )
    friction = replace(made.transmission.friction, mu_static=0.22, mu_dynamic_release=0.18)
    return replace(made, transmission=replace(made.transmission, friction=friction), joints={})


def without_lengths(scenario):
    """Gained lengths move, shares of the length do not."""
    made = changed(scenario, **{f"s{k}": {"length_m": None} for k in range(5) if k != 2}, s2={"length_m": 0.0})
    return changed(made, s0={"mu_static_release": 0.25})


@pytest.mark.parametrize("turning", [1, 2])
def test_joints_that_change_no_length_leave_no_warning(moving, tmp_path, turning):
    """Nobody asks how fast such a joint turns, be it one of the joints or all."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    parts = [f"s{k}" for k, part in enumerate(moving.transmission.path.sections) if part.joint is not None]
    scenario = changed(moving, **{part: {"length_per_rad_m": 0.0} for part in parts[:turning]})
    modules = [module for module in c_modules(scenario) if module.name in ("inverse", "plant")]
    sources = c_sources(scenario, Problem.of(scenario), modules, Precision.DOUBLE, "tff")
    for name, text in sources.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    compiled = [name for name in sources if name.endswith(".c")]
    flags = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-fsyntax-only")
    said = subprocess.run(["cc", *flags, *compiled], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.stderr == ""


@pytest.mark.each_value
@pytest.mark.parametrize("precision", Precision)
@pytest.mark.parametrize("variant", [None, straightens, far_driven, at_rest, without_lengths])
def test_c_equals_python_wherever_the_path_goes(moving, variant, precision, record_property):
    scenario = moving if variant is None else variant(moving)
    problem = Problem.of(scenario)
    chain, step, precise = problem.chain, problem.reference.step_s, precision is Precision.DOUBLE
    wanted = rounded(problem.reference.tension_N[:ROWS], precision)
    angles = np.zeros((ROWS, 0))
    if chain.motion is not None:
        angles = rounded(chain.motion.at(problem.reference.time_s[:ROWS]), precision)
        chain = replace(chain, motion=replace(chain.motion, time_s=problem.reference.time_s[:ROWS], angle_rad=angles))
    start = float(wanted[0])
    force = problem.limits.apply(invert(chain, wanted, step, initial_tension_N=start).force_N, step, start)
    driven = rounded(force, precision)
    tension = simulate(chain, driven, step, initial_tension_N=start).output_tension_N
    modules = [m for m in c_modules(scenario) if m.name in ("inverse", "plant")]
    sources = c_sources(scenario, problem, modules, precision, "tff")
    if (found := run_on_host(sources, "tff", precision, [{"inverse": wanted, "plant": driven}], [angles])) is None:
        pytest.skip("no C compiler")
    errors = {
        "inverse": float(np.abs(found[0]["inverse"] - force).max()),
        "plant": float(np.abs(found[0]["plant"] - tension).max()),
    }
    said = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
    record_property("figure", f"C on a path in sections, {variant and variant.__name__}, {precision}: {said} N")
    assert np.ptp(force) > 5
    assert max(errors.values()) <= TOLERANCE_N[precision]
    assert precise or errors["inverse"] > 0  # the two are not the same code


@pytest.fixture(scope="module")
def folder(moving, tmp_path_factory):
    """The exported folder of the moving finger in double."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    target = tmp_path_factory.mktemp("moving")
    reference = Problem.of(moving).reference
    export_project(moving, profile_N=reference.tension_N).write(target)
    return target


def test_the_folder_says_what_the_joints_are_and_passes_its_own_test(folder):
    said = subprocess.run(["make", "test"], cwd=folder, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stdout + said.stderr
    content = json.loads((folder / "design.json").read_text())
    assert [joint["name"] for joint in content["joints"]] == ["knuckle", "middle"]
    assert content["table"] is None
    assert content["capstan"] is None
    assert "passes stream: golden vectors of a live reference" in said.stdout
    assert not (folder / "tff_capstan.c").exists()
    assert not (folder / "tff_table.c").exists()
    assert "`knuckle` (-2 to" in (folder / "README.md").read_text()  # where the section would have no length
    assert "#define TFF_JOINTS 2" in (folder / "tff_path.h").read_text()


def test_the_self_test_sees_a_wrong_moment_arm(folder, tmp_path):
    torn = tmp_path / "torn"
    shutil.copytree(folder, torn)
    source = (torn / "tff_path.c").read_text()
    drift = next(line for line in source.splitlines() if ".drift = " in line and "rate_0" in line)
    (torn / "tff_path.c").write_text(source.replace(drift, drift.replace("rate_0", "1.01 * rate_0")))
    said = subprocess.run(["make", "test"], cwd=torn, capture_output=True, text=True, check=False)
    assert "FAILS  inverse: golden vectors" in said.stdout


def servo(scenario):
    """The same with a position drive, whose limits never bind: there the travel is the exact inverse's."""
    bounds = {"force_max_N": 1e4, "force_rate_max_N_per_s": 1e7}
    actuator = replace(scenario.transmission.actuator, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5, **bounds)
    return replace(scenario, transmission=replace(scenario.transmission, actuator=actuator))


@pytest.mark.each_value
@pytest.mark.parametrize("precision", Precision)
@pytest.mark.parametrize("variant", [None, far_driven, at_rest])
def test_a_servo_is_commanded_where_to_go_while_joints_move_the_path(moving, variant, precision, record_property):
    """x_c1 = q_a + (F - T0)/k; after a tenth of a second without angles it is where it would have been."""
    scenario = servo(moving if variant is None else variant(moving))
    problem = Problem.of(scenario)
    wanted = problem.reference.tension_N[:ROWS]
    expected = with_motion(problem, "inverse", compensator("inverse").profile(problem)).command_m[:ROWS]
    angles = np.zeros((ROWS, 0))
    if (motion := problem.chain.motion) is not None:
        angles = motion.at(problem.reference.time_s[:ROWS])
    module = next(m for m in c_modules(scenario) if m.name == "inverse")
    sources = c_sources(scenario, problem, (module,), precision, "tff")
    torn = angles.copy()
    torn[500:600] = np.nan
    found = run_on_host(sources, "tff", precision, [{"inverse": wanted}] * 2, [angles, torn])
    if found is None:
        pytest.skip("no C compiler")
    whole, lost = (run["inverse"] for run in found)
    error = np.abs(whole - expected).max()
    record_property(
        "figure", f"servo on a path in sections, {variant and variant.__name__}, {precision}: {error:.2g} m"
    )
    assert np.ptp(expected) > 1e-3
    assert error < (1e-12 if precision is Precision.DOUBLE else 1e-7)
    if angles.size:
        assert np.all(lost[500:600] == lost[499])
        assert np.abs(lost[-100:] - expected[-100:]).max() < 0.03 * np.ptp(expected)


def test_samples_lost_while_the_joints_moved_cost_a_few_samples(moving):
    """A tenth of a second without a reference, in which the joints go on: then the path is taken as it stands.

    The speed of the joints has changed meanwhile: that jump takes some samples at the limit of the rate.
    """
    problem = Problem.of(moving)
    wanted = problem.reference.tension_N[:ROWS].copy()
    angles = problem.chain.motion.at(problem.reference.time_s[:ROWS])
    module = next(m for m in c_modules(moving) if m.name == "inverse")
    sources = c_sources(moving, problem, (module,), Precision.DOUBLE, "tff")
    torn, blind = wanted.copy(), angles.copy()
    torn[500:600] = np.nan
    blind[500:600, 1] = np.nan
    runs = [{"inverse": wanted}, {"inverse": torn}, {"inverse": wanted}]
    found = run_on_host(sources, "tff", Precision.DOUBLE, runs, [angles, angles, blind])
    if found is None:
        pytest.skip("no C compiler")
    whole, lost, unseen = (run["inverse"] for run in found)
    assert abs(angles[600] - angles[500]).max() > 0.1
    assert np.all(lost[500:600] == lost[499])
    np.testing.assert_array_equal(lost, unseen)
    assert np.abs(lost[600:] - whole[600:]).max() < 10
    assert np.abs(np.diff(lost[608:])).max() <= 1.5 * np.abs(np.diff(whole[600:])).max()
    assert np.abs(lost[900:] - whole[900:]).max() < 0.05 * np.ptp(whole)


@pytest.mark.parametrize(("most", "rounding"), [(0.1, 2.0**-24), (0.3, 2.0**-53), (1.2, 2.0**-53)])
def test_the_fraction_for_tanh_is_exact_to_rounding(most, rounding):
    above, below = tanh_fraction(most, rounding)
    x = np.linspace(1e-6, most, 2001)
    found = x * np.polyval(above[::-1], x * x) / np.polyval(below[::-1], x * x)
    assert np.abs(found / np.tanh(x) - 1).max() <= rounding + 2.0**-51
