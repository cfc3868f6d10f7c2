"""The exported C under every compiler and checker that is here."""

import functools
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.joint.text import joint_sources
from tendonff.compensator.export.modules import ADAPTIVE, ADAPTIVE_MODULES
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler

STIFFNESSES = (Tunable.MU, Tunable.TENDON_STIFFNESS)

STRICT = ("-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wdouble-promotion", "-Werror", "-O2")
# Only GCC finds more where it optimises, and that in C as in C++.
LANGUAGES = {
    "gcc": ("-std=c99", "-c"),
    "clang": ("-std=c99", "-fsyntax-only"),
    "g++": ("-x", "c++", "-std=c++11", "-fsyntax-only"),
    "clang++": ("-x", "c++", "-std=c++11", "-fsyntax-only"),
}


@pytest.mark.each_value
@pytest.mark.parametrize("precision", Precision)
@pytest.mark.parametrize("compiler", LANGUAGES)
def test_strict_compilers_have_nothing_to_say_in_c_and_in_cplusplus(toolbox, exported, compiler, precision, tmp_path):
    toolbox.need(compiler)
    folder = exported(precision)
    sources = sorted(folder.glob("*.c"))
    assert len(sources) > len(toolbox.modules)
    toolbox.run(compiler, *LANGUAGES[compiler], *STRICT, *sources, cwd=tmp_path)


@pytest.mark.parametrize("precision", [Precision.FLOAT, pytest.param(Precision.DOUBLE, marks=pytest.mark.nightly)])
def test_a_copied_folder_passes_its_own_test_elsewhere(toolbox, exported, precision, tmp_path):
    toolbox.need("make", "cc")
    folder = shutil.copytree(exported(precision), tmp_path / "elsewhere")
    as_shipped = {name: value for name, value in os.environ.items() if name != "CFLAGS"}
    said = toolbox.run("make", "test", cwd=folder, env=as_shipped).stdout
    assert "self test passed" in said
    assert said.count("passes") > 40
    assert "FAILS" not in said


@pytest.mark.parametrize(
    ("module", "right", "wrong"),
    [("capstan", r"(self->pull = )[0-9.]+", r"\g<1>1.8744"), ("table", r"if \(ratio >= ", "if (ratio < ")],
)
def test_the_self_test_fails_when_the_code_is_wrong(toolbox, exported, tmp_path, module, right, wrong):
    toolbox.need("make", "cc")
    folder = shutil.copytree(exported(Precision.DOUBLE), tmp_path / "broken")
    source = folder / f"tff_{module}.c"
    text, found = re.subn(right, wrong, source.read_text(), count=1)
    assert found == 1
    source.write_text(text)
    done = subprocess.run(["make", "test"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "SELF TEST FAILED" in done.stdout


def test_cmake_builds_and_tests_the_folder(toolbox, exported, tmp_path):
    toolbox.need("cmake", "ctest", "cc")
    toolbox.run("cmake", "-S", exported(Precision.DOUBLE), "-B", tmp_path)
    toolbox.run("cmake", "--build", tmp_path)
    assert "100% tests passed" in toolbox.run("ctest", cwd=tmp_path).stdout
    assert toolbox.run(tmp_path / "tff_example").stdout.startswith("time_s,reference_N,force_N,tension_N,status\n")


@pytest.mark.parametrize("precision", [Precision.FLOAT, pytest.param(Precision.DOUBLE, marks=pytest.mark.nightly)])
def test_sanitizers_find_nothing_in_fuzzed_input_and_limits_hold(toolbox, exported, precision, tmp_path):
    toolbox.need("gcc")
    folder = exported(precision)
    files = [folder / f"tff_{name}.c" for name in toolbox.modules if name != "observer"]
    program = tmp_path / "fuzz"
    sanitize = (
        "-g",
        "-fsanitize=address,undefined,float-divide-by-zero,float-cast-overflow",
        "-fno-sanitize-recover=all",
    )
    toolbox.run("gcc", "-std=c99", *sanitize, "-I", folder, toolbox.here / "fuzz.c", *files, "-lm", "-o", program)
    assert toolbox.run(program).stdout == "0 failures\n"


@pytest.mark.parametrize("precision", Precision)
def test_cppcheck_and_its_misra_rules_are_quiet(toolbox, exported, precision, tmp_path):
    """One advisory rule is set aside: 8.9 wants the table's arrays inside the function that reads them."""
    folder = shutil.copytree(exported(precision), tmp_path / "c")
    shorten_the_profile(folder)
    # In float the inverse alone is other code; the rest differs by its literals.
    files = sorted(folder.glob("tff_*.c")) if precision is Precision.DOUBLE else [folder / "tff_inverse.c"]
    assert [hit for hit in checked(toolbox, files) if not ("8.9]" in hit and "tff_table_data.h" in hit)] == []


@pytest.mark.parametrize(
    ("example", "sensor", "parameters", "precision"),
    [
        ("finger", Sensor.OUTPUT_TENSION, (), Precision.DOUBLE),
        pytest.param("finger", Sensor.ACTUATOR_POSITION, (), Precision.FLOAT, marks=pytest.mark.nightly),
        pytest.param("finger", Sensor.ACTUATOR_POSITION, STIFFNESSES, Precision.DOUBLE, marks=pytest.mark.nightly),
        pytest.param("finger_moving", Sensor.OUTPUT_TENSION, (), Precision.FLOAT, marks=pytest.mark.nightly),
        pytest.param("finger_moving", Sensor.ACTUATOR_POSITION, (), Precision.DOUBLE, marks=pytest.mark.nightly),
    ],
)
def test_cppcheck_and_its_misra_rules_are_quiet_about_the_tuner(
    toolbox, examples, tmp_path, example, sensor, parameters, precision
):
    scenario = load_scenario(examples / f"{example}.toml")
    late = 3 if example == "finger_moving" else 0
    settings = Adaptation(sensor=sensor, parameters=parameters, delay_samples=2, joint_delay_samples=late, noise=1e-5)
    scenario = replace(scenario, adaptation=settings)
    modules = (ADAPTIVE,) if late else ADAPTIVE_MODULES
    for name, text in c_sources(scenario, Problem.of(scenario), modules, precision, "tff").items():
        (tmp_path / name).write_text(text)
    files = [path for name in ("adaptive", "bounds", "path") if (path := tmp_path / f"tff_{name}.c").exists()]
    # The record of the recursion's numbers is that of every sensor.
    assert checked(toolbox, files, "--suppress=unusedStructMember") == []


@pytest.mark.nightly
def test_cppcheck_and_its_misra_rules_are_quiet_about_a_joint(toolbox, examples, tmp_path):
    """One advisory rule is set aside: 8.9 wants the records of hinges inside the function that reads them."""
    for name, text in joint_sources([load_scenario(examples / "hand_joint_adaptive.toml")]).items():
        (tmp_path / name).write_text(text)
    more = ("--suppress=unusedStructMember", "--suppress=variableScope", "--suppress=unreadVariable")
    hits = checked(toolbox, sorted(tmp_path.glob("*.c")), *more)
    assert [hit for hit in hits if "8.9]" not in hit] == []


@pytest.mark.nightly
def test_cppcheck_and_its_misra_rules_are_quiet_about_profile_and_table_of_a_joint(toolbox, examples, tmp_path):
    """8.9 is set aside: records are arrays of their own."""
    tf.export_c(tf.load_scenario(examples / "hand_joint.toml")).write(tmp_path)
    hits = checked(toolbox, [tmp_path / "tff_profile.c", tmp_path / "tff_table.c"])
    assert [hit for hit in hits if "8.9]" not in hit] == []


@pytest.mark.nightly
@pytest.mark.parametrize(("example", "sensor"), [("finger_moving", "output_tension"), ("hand_joint", "joint_angle")])
def test_cppcheck_and_its_misra_rules_are_quiet_about_the_feedback(toolbox, examples, tmp_path, example, sensor):
    text = (examples / f"{example}.toml").read_text("utf-8").partition("[robust]")[0]
    more = f'\n[feedback]\nsensor = "{sensor}"\ndelay_s = 0.004\n[robust]\nsamples = 1\n'
    (tmp_path / "fed.toml").write_text(text.replace("duration_s = 4.0", "duration_s = 0.5") + more, "utf-8")
    tf.export_c(tf.load_scenario(tmp_path / "fed.toml")).write(tmp_path / "c")
    assert checked(toolbox, [tmp_path / "c" / f"tff_{name}.c" for name in ("feedback", "control")]) == []


def shorten_the_profile(folder):
    """Leave eight rows of the profile: the rules look at each number, and thousands are alike."""
    header, code = folder / "tff_profile.h", folder / "tff_profile.c"
    head, found = re.subn(r"(define TFF_PROFILE_LENGTH) \d+", r"\1 8", header.read_text())
    before, opened, rest = code.read_text().partition("profile[TFF_PROFILE_LENGTH] = {\n")
    numbers, closed, after = rest.partition("\n    };")
    assert found == 1
    assert opened
    assert closed
    header.write_text(head)
    code.write_text(before + opened + "    " + ", ".join(re.findall(r"[^\s,]+", numbers)[:8]) + closed + after)


@functools.cache
def misra():
    """The rules, or None where they are not installed; folders of documentation are large and hold none."""
    known = ("/usr/lib", "/usr/share", "/usr/local")
    return next((p for place in known for p in Path(place).glob("**/cppcheck/addons/misra.py")), None)


def checked(toolbox, files, *more):
    """Violations of MISRA's rules that cppcheck finds, where its own checks find nothing."""
    toolbox.need("cppcheck")
    toolbox.run(
        *("cppcheck", "--std=c99", "--quiet", "--dump", "--enable=warning,style,performance,portability"),
        *("--suppress=missingIncludeSystem", "--error-exitcode=1", *more, "-I", files[0].parent, *files),
    )
    addon = misra()
    if addon is None:
        pytest.skip("cppcheck's misra.py is not installed")
    dumps = [f"{file}.dump" for file in files]
    said = subprocess.run([sys.executable, addon, *dumps], capture_output=True, text=True, check=False)
    return [line for line in (said.stdout + said.stderr).splitlines() if "[misra-c2012" in line]
