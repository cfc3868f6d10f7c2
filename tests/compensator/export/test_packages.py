"""What carries the exported C into other tools: built, run, and compared with the C."""

import itertools
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources, package_files
from tendonff.compensator.runtime.runtime import Runtime
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.codegen.precision import Precision
from tests.compensator.export.structured_text import Block

pytestmark = pytest.mark.compiler

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def scenario(examples):
    """A rate limit that binds and friction that differs both ways."""
    found = load_scenario(examples / "finger_fast.toml")
    friction = replace(found.transmission.friction, mu_dynamic_release=0.15, mu_static_release=0.15, adhesion_N=0.7)
    return replace(found, transmission=replace(found.transmission, friction=friction))


@pytest.fixture(scope="module")
def files(scenario):
    return export_project(scenario, profile_N=np.full(3, 30.0), force_export=True).files


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    target = tmp_path_factory.mktemp("package")
    for name, text in files.items():
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).write_text(text)
    return target


@pytest.fixture(scope="module")
def course(scenario):
    """The reference, then reversals at many depths, holds, jumps, and what is no reference."""
    chance, tension = np.random.default_rng(2), sample_reference(scenario).tension_N
    low, high = tension.min(), tension.max()
    turns = [tension[-1]]
    while len(turns) < 300:
        turns.append(
            float(np.clip(turns[-1] + (high - low) * 10 ** chance.uniform(-3, 0) * (-1) ** len(turns), low, high))
        )
    legs = [np.linspace(a, b, 1 + chance.integers(1, 5))[1:] for a, b in itertools.pairwise(turns)]
    return np.concatenate(
        [tension[::4], *legs, [high, low, np.nan, low, -1.0, 1e6, high, high, np.inf, middle(low, high)]]
    )


def middle(low, high):
    return 0.5 * (low + high)


@pytest.mark.parametrize("kind", ["capstan", "table"])
def test_structured_text_answers_what_the_c_answers(files, course, kind):
    """To rounding, status too, over limits, reversals in unfinished transitions and bad references."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    sources = {name: text for name, text in files.items() if name.startswith("tff_") and name.endswith((".c", ".h"))}
    (answered,) = run_on_host(sources, "tff", Precision.DOUBLE, [{kind: course}])
    block = Block(files[f"structured_text/tff_{kind}.st"])
    block(Init=True, InitialTension=float(course[0]))
    assert block["Status"] == 0
    forces, bits = [], set()
    for reference in course.tolist():
        block(Init=False, Setpoint=reference)
        forces.append(block["Force"])
        bits.add(block["Status"])
    assert {0, 1, 4} <= bits
    assert np.ptp(forces) > 20
    assert forces == pytest.approx(answered[kind], rel=1e-12, abs=1e-11)
    block(Init=True, InitialTension=float("nan"))
    assert block["Status"] == 1


@pytest.mark.parametrize("kind", ["capstan", "table"])
def test_structured_text_is_read_by_a_parser_of_the_standard(files, kind):
    """Of lists of numbers the first and the last line: the parser takes 20 s for all of them."""
    blark = pytest.importorskip("blark", reason="blark is not installed")
    rows = re.compile(r"(^ {8}[-+.e\d, ]+,\n)(?:^ {8}[-+.e\d, ]+,\n)+", re.MULTILINE)
    parsed = blark.parse_source_code(rows.sub(r"\1", files[f"structured_text/tff_{kind}.st"]))
    assert parsed.exception is None


def controller(folder, built, modules):
    """The exported controller and its C, with a program that takes it through its life."""
    flags = ("-O0", "-Wall", "-Wextra", "-Werror", "-I", folder, "-ffp-contract=off")
    objects = []
    for name in modules:
        objects.append(built / f"{name}.o")
        subprocess.run(["gcc", *flags, "-c", folder / f"tff_{name}.c", "-o", objects[-1]], check=True)
    subprocess.run(
        [
            *("g++", "-std=c++17", *flags, "-I", HERE / "ros2", HERE / "ros2" / "main.cpp"),
            *(folder / "ros2" / "tff_controller" / "tff_controller.cpp", *objects, "-lm", "-o", built / "controller"),
        ],
        check=True,
    )
    return built / "controller"


def lived(program, *arguments, given):
    """Commands and status of every update of a controller, and of its deactivation."""
    done = subprocess.run([program, *arguments], input=given, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    commands, status = np.array([list(map(float, line.split())) for line in done.stdout.splitlines()]).T
    return commands, status.astype(int), done.stderr


def test_the_ros_2_controller_takes_the_joints_that_move_the_path_from_their_states(examples, tmp_path):
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    scenario = load_scenario(examples / "finger_moving.toml")
    program = built(scenario, tmp_path, ("parameters", "limits", "path", "state", "inverse"))
    problem = Problem.of(scenario)
    reference, runtime = sample_reference(scenario), Runtime(scenario, kind="inverse")
    rows = slice(0, 400)
    angles = problem.chain.motion.at(reference.time_s)[rows]
    tensions = reference.tension_N[rows]
    expected = [runtime.step(float(t), joints=q) for t, q in zip(tensions, angles.tolist(), strict=True)]
    given = "\n".join(" ".join(map(repr, row)) for row in np.column_stack([tensions, angles]).tolist())
    commands, _, _ = lived(program, repr(reference.step_s), "effort", "30", *runtime.joints, given=given)
    assert commands[:-1] == pytest.approx(expected, rel=1e-12)


def built(scenario, folder, names):
    """The controller of a scenario's inverse, whose C has these modules."""
    modules = [module for module in c_modules(scenario, True) if module.name == "inverse"]
    arguments = (scenario, Problem.of(scenario), modules, Precision.DOUBLE, "tff")
    for name, text in (c_sources(*arguments) | package_files(*arguments)).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return controller(folder, folder, names)


def test_the_ros_2_controller_of_a_position_drive_commands_positions_from_where_the_actuator_is(scenario, tmp_path):
    """Metres never reach an effort interface; deactivated it holds its last position."""
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    actuator = replace(scenario.transmission.actuator, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    servo = replace(scenario, transmission=replace(scenario.transmission, actuator=actuator))
    program = built(servo, tmp_path, ("parameters", "limits", "state", "inverse"))
    reference, runtime = sample_reference(servo), Runtime(servo, kind="inverse")
    tensions = reference.tension_N[:300]
    expected = np.array([0.37 + runtime.step(float(tension)) for tension in tensions])
    given = "\n".join(map(repr, tensions.tolist()))
    commands, _, _ = lived(program, repr(reference.step_s), "position", "0.37", given=given)
    assert commands[:-1] == pytest.approx(expected, abs=1e-12)
    assert np.ptp(expected) > 1e-4
    assert commands[-1] == commands[-2]


def test_the_ros_2_controller_answers_what_the_c_answers_at_any_rate(files, folder, course, tmp_path, scenario):
    """Compiled against minimal headers with the names and signatures of ros2_control, not against ROS itself; at the
    scenario's rate and at 400 Hz."""
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    sources = {name: text for name, text in files.items() if name.startswith("tff_") and name.endswith((".c", ".h"))}
    (answered,) = run_on_host(sources, "tff", Precision.DOUBLE, [{"inverse": course}])
    program = controller(folder, tmp_path, ("parameters", "limits", "state", "inverse"))
    given = "\n".join(repr(float(v)) for v in course)
    runtime = Runtime(scenario, kind="inverse", start=float(course[0]))
    slower = np.array([runtime.step(float(reference), dt=2.5e-3) for reference in course])
    start = repr(float(course[0]))
    for period, expected in (("1e-3", answered["inverse"]), ("2.5e-3", slower)):
        commands, status, said = lived(program, period, "effort", start, given=given)
        assert "update_rate must be 33.3333 to 2000 Hz, got 20" in said
        assert 'start must be "measured" or "rest", got "now"' in said
        assert "the effort of finger is no number" in said
        assert commands[:-1] == pytest.approx(expected, rel=1e-12)
        assert {0, 1, 4} <= set(status.tolist())
        assert commands[-1] == 0  # deactivated


def test_the_ros_2_controller_goes_on_from_the_effort_that_acts(folder, course, tmp_path):
    """5 N more than the reference: friction is taken to hold them, and no update changes the effort by a newton."""
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    program = controller(folder, tmp_path, ("parameters", "limits", "state", "inverse"))
    given = "\n".join([repr(float(course[0]))] * 400)
    commands, _, _ = lived(program, "1e-3", "effort", repr(float(course[0]) + 5), given=given)
    assert commands[0] == pytest.approx(course[0] + 5, abs=0.5)
    assert np.abs(np.diff(commands[:-1])).max() < 1


@pytest.fixture(scope="module")
def fed(examples, tmp_path_factory):
    """A folder with feedback, and its scenario."""
    folder = tmp_path_factory.mktemp("fed")
    text = (examples / "finger_moving.toml").read_text("utf-8").replace("duration_s = 4.0", "duration_s = 0.5")
    table = '\n[feedback]\nsensor = "output_tension"\ndelay_s = 0.004\nsample_s = 0.004\n[robust]\nsamples = 1\n'
    (folder / "fed.toml").write_text(text + table, "utf-8")
    scenario = load_scenario(folder / "fed.toml")
    export_project(scenario, profile_N=np.full(3, 30.0), force_export=True).write(folder / "c")
    return folder / "c", scenario


@pytest.mark.nightly
def test_the_ros_2_controller_with_feedback_takes_the_tension_from_its_sensor(fed, tmp_path):
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    folder, scenario = fed
    modules = ("parameters", "limits", "path", "state", "inverse", "feedback", "control")
    program = controller(folder, tmp_path, modules)
    reference, runtime = sample_reference(scenario), Runtime(scenario)
    tensions, angles = reference.tension_N[:300], np.array([0.6, 0.35])[: len(runtime.joints)]
    measured = 0.97 * tensions
    rows = [[tension, *angles, seen] for tension, seen in zip(tensions, measured, strict=True)]
    given = "\n".join(" ".join(map(repr, map(float, row))) for row in rows)
    expected = [runtime.step(float(row[0]), measured=float(row[-1]), joints=angles.tolist()) for row in rows]
    start = repr(float(tensions[0]))
    joints = (*runtime.joints, "tendon/force")
    commands, _, _ = lived(program, repr(reference.step_s), "effort", start, *joints, given=given)
    assert commands[:-1] == pytest.approx(expected, rel=1e-12)
    assert np.ptp(commands[:-1] - tensions) > 1


def test_the_zephyr_module_builds_every_source(folder, tmp_path):
    """With CMake, and the functions of Zephyr's build system reduced to what they do to a library."""
    for tool in ("cmake", "cc", "make"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    (tmp_path / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.13)
project(app C)
set(CONFIG_TFF_FEEDFORWARD y)
macro(zephyr_library_named name)
  set(ZEPHYR_CURRENT_LIBRARY ${{name}})
  add_library(${{name}} STATIC)
endmacro()
macro(zephyr_library_sources)
  target_sources(${{ZEPHYR_CURRENT_LIBRARY}} PRIVATE ${{ARGN}})
endmacro()
macro(zephyr_include_directories)
  target_include_directories(${{ZEPHYR_CURRENT_LIBRARY}} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}}/${{ARGN}})
endmacro()
macro(zephyr_library_compile_options)
  target_compile_options(${{ZEPHYR_CURRENT_LIBRARY}} PRIVATE ${{ARGN}})
endmacro()
add_subdirectory({folder}/zephyr module)
"""
    )
    for command in (("cmake", "-S", ".", "-B", "build"), ("cmake", "--build", "build")):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    (library,) = tmp_path.glob("build/module/*.a")
    held = subprocess.run(["ar", "t", library], capture_output=True, text=True, check=True).stdout.split()
    assert {name.split(".")[0] for name in held} == {path.stem for path in folder.glob("tff_*.c")}


def test_tools_that_compile_every_file_find_no_second_main(folder, tmp_path):
    """The Arduino tools take each C file of the folder; PlatformIO those that its manifest names."""
    if shutil.which("cc") is None or shutil.which("nm") is None:
        pytest.skip("cc or nm is not installed")
    sources = sorted(folder.glob("*.c"))
    subprocess.run(["cc", "-DARDUINO=10819", "-O0", "-c", *sources], check=True, cwd=tmp_path)
    symbols = subprocess.run(["nm", *tmp_path.glob("*.o")], capture_output=True, text=True, check=True).stdout
    assert " T tff_inverse_step" in symbols
    assert " T main" not in symbols
    manifest = json.loads((folder / "library.json").read_text())
    assert manifest["build"]["srcFilter"] == ["-<*>", "+<tff_*.c>"]
    assert all((folder / header).exists() for header in manifest["headers"])
    lines = (folder / "library.properties").read_text().split("\n")
    known = dict(line.split("=", 1) for line in lines if line)
    assert set(known) >= {"name", "version", "author", "maintainer", "sentence", "category", "architectures"}
    assert all((folder / header).exists() for header in known["includes"].split(","))
