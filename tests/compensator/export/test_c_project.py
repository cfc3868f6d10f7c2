"""The exported C against the Python model, and what the folder says of itself."""

import ctypes
import functools
import json
import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.golden import answers
from tendonff.compensator.export.modules import check_prefix
from tendonff.compensator.export.text.c_text import harmless
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.codegen.precision import Precision

KINDS = ("inverse", "capstan", "table", "plant")
TOLERANCE_N = {Precision.DOUBLE: 1e-9, Precision.FLOAT: 0.02}
DRIVER = """
void run_{kind}(long first, long n, const tff_real *given, tff_real *answer)
{{
    tff_{kind} self;
    long k;
    tff_{kind}_init(&self, given[0]);
    for (k = first; k < n; k++) {{
        answer[k] = tff_{kind}_step(&self, given[k]);
    }}
}}
"""


@pytest.fixture(scope="module")
def library(examples, tmp_path_factory):
    """The exported C of an example as a library, with its scenario and table."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    made = {}

    def load(example, precision):
        key = (example, precision)
        if key not in made:
            folder = tmp_path_factory.mktemp(f"{example}_{precision}")
            scenario = load_scenario(examples / f"{example}.toml")
            exported = export_project(scenario, precision=precision, profile_N=np.full(3, 30.0), force_export=True)
            exported.write(folder)
            includes = "".join(f'#include "tff_{kind}.h"\n' for kind in KINDS)
            (folder / "driver.c").write_text(includes + "".join(DRIVER.format(kind=k) for k in KINDS))
            sources = [*sorted(folder.glob("tff_*.c")), folder / "driver.c"]
            flags = ("-std=c99", "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno")
            subprocess.run(["cc", *flags, "-o", folder / "x.so", *sources, "-lm"], check=True)
            made[key] = ctypes.CDLL(str(folder / "x.so")), scenario, exported
        return made[key]

    return load


@pytest.fixture(scope="module")
def finger_files(examples):
    """Files of the finger's export in a precision, made once."""

    @functools.cache
    def made(precision=Precision.DOUBLE):
        scenario = load_scenario(examples / "finger.toml")
        return export_project(scenario, precision=precision, profile_N=np.full(3, 30.0)).files

    return made


def play(code, kind, given, precision, first=0):
    real = np.float32 if precision is Precision.FLOAT else np.float64
    given = np.ascontiguousarray(given, dtype=real)
    answer = given.copy()
    pointers = (ctypes.c_void_p(values.ctypes.data) for values in (given, answer))
    getattr(code, f"run_{kind}")(ctypes.c_long(first), ctypes.c_long(len(given)), *pointers)
    return answer.astype(np.float64)


def a_minute(scenario):
    """The scenario's reference, there and back, until 60 s are full."""
    once = sample_reference(scenario).tension_N
    loop = np.concatenate([once, once[::-1]])
    rows = round(60 / scenario.run.step_s) + 1
    return np.tile(loop, -(-rows // len(loop)))[:rows]


@pytest.mark.compiler
@pytest.mark.parametrize(
    ("example", "precision"),
    [
        pytest.param("finger", Precision.DOUBLE, marks=pytest.mark.nightly),
        pytest.param("finger", Precision.FLOAT, marks=pytest.mark.nightly),
        pytest.param("bowden", Precision.DOUBLE, marks=pytest.mark.nightly),
        ("bowden", Precision.FLOAT),
        pytest.param("finger_stribeck", Precision.FLOAT, marks=pytest.mark.nightly),
        pytest.param("surgical", Precision.FLOAT, marks=pytest.mark.nightly),
    ],
)
def test_c_equals_python_over_a_minute(library, example, precision, record_property):
    """1e-9 N in double, 0.02 N in float; bowden holds its reference, which is where a float would drift."""
    code, scenario, exported = library(example, precision)
    reference = rounded(a_minute(scenario), precision)
    problem = Problem.of(scenario)
    course = answers(problem, exported.built.table, reference, precision, problem.chain)
    force, expected = course.plant_force_N, course.columns
    worst = {}
    for kind in KINDS:
        given = force if kind == "plant" else reference
        worst[kind] = float(np.abs(play(code, kind, given, precision) - expected[kind]).max())
    said = ", ".join(f"{kind} {error:.2g}" for kind, error in worst.items())
    record_property("figure", f"C against Python, {example}, {precision}, 60 s: {said} N")
    assert max(worst.values()) <= TOLERANCE_N[precision]


@pytest.mark.compiler
def test_the_first_call_may_be_the_sample_at_zero_or_the_one_after_it(library):
    code, scenario, _ = library("finger", Precision.DOUBLE)
    reference = sample_reference(scenario).tension_N[:500]
    for kind in KINDS:
        assert np.array_equal(play(code, kind, reference, "double"), play(code, kind, reference, "double", first=1))


@pytest.mark.compiler
@pytest.mark.parametrize("level", [Level.ELASTIC, pytest.param(Level.VISCOELASTIC, marks=pytest.mark.nightly)])
def test_every_level_exports_and_passes_its_own_test(examples, tmp_path, level):
    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("make or cc is not installed")
    scenario = load_scenario(examples / "finger_fast.toml")
    export_project(scenario, level=level, profile_N=np.full(3, 30.0), prefix="rig_2").write(tmp_path)
    said = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "self test passed" in said.stdout, said.stdout + said.stderr


NIGHTLY = {"one mass, unlike directions, adhesion"}  # `spread bounds` has one mass and unlike directions too
ODD = {
    "one mass, unlike directions, adhesion": (
        {"segments": 1},
        {"mu_static": 0.25, "mu_dynamic_release": 0.1, "adhesion_N": 2.0},
    ),
    "spread bounds": (
        {"segments": 1},
        {"mu_dynamic_release": 0.1, "adhesion_N": 0.5, "pull_spread": 0.8, "release_spread": 0.4},
    ),
    "a straight path": ({"total_angle_rad": 0.0}, {"viscous_N_s_per_m": 0.0}),
}


@pytest.mark.compiler
@pytest.mark.parametrize("case", [pytest.param(k, marks=pytest.mark.nightly) if k in NIGHTLY else k for k in ODD])
def test_odd_transmissions_export_and_pass_their_own_test(examples, tmp_path, case):
    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("make or cc is not installed")
    scenario = load_scenario(examples / "finger.toml")
    path, friction = ODD[case]
    whole = scenario.transmission
    whole = replace(whole, path=replace(whole.path, **path), friction=replace(whole.friction, **friction))
    export_project(replace(scenario, transmission=whole), profile_N=np.full(3, 30.0)).write(tmp_path)
    said = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "self test passed" in said.stdout, said.stdout + said.stderr
    # Structured Text has the law with one dead band alone.
    assert (tmp_path / "structured_text" / "tff_capstan.st").exists() == ("pull_spread" not in friction)


@pytest.mark.compiler
def test_equal_input_gives_equal_bytes_and_no_date(examples, finger_files):
    again = export_project(load_scenario(examples / "finger.toml"), profile_N=np.full(3, 30.0)).files
    assert again == finger_files()
    assert not any(re.search(r"20\d\d-\d\d-\d\d", text) for text in again.values())


@pytest.mark.compiler
def test_references_are_accepted_up_to_what_the_largest_force_delivers_through_the_friction(examples):
    """T = (F + p) e^{-mu theta} - p; limits and sample time as in the scenario."""
    scenario = load_scenario(examples / "finger.toml")
    t = replace(scenario.transmission, friction=replace(scenario.transmission.friction, adhesion_N=1.5))
    text = export_project(replace(scenario, transmission=t), profile_N=np.ones(3)).files["tff_types.h"]

    def stated(name):
        return float(re.search(rf"#define TFF_{name} \(*(\S+?)\)*\n", text)[1])

    most = (t.actuator.force_max_N + 1.5) * math.exp(-t.friction.mu_dynamic * t.path.total_angle_rad) - 1.5
    assert stated("REFERENCE_MAX_N") == pytest.approx(most, rel=1e-12)
    assert 0 < stated("REFERENCE_MIN_N") < sample_reference(scenario).tension_N.min()
    assert stated("FORCE_MAX_N") == t.actuator.force_max_N
    assert stated("FORCE_MIN_N") == t.actuator.force_min_N
    assert stated("CHANGE_MAX_N") == pytest.approx(t.actuator.force_rate_max_N_per_s * scenario.run.step_s, rel=1e-12)
    assert stated("STEP_S") == scenario.run.step_s


@pytest.mark.compiler
def test_float_code_holds_no_double(finger_files):
    for name, text in finger_files(Precision.FLOAT).items():
        if name.startswith("tff_") and name.endswith((".c", ".h")):
            code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
            assert "double" not in code, name
            assert not re.search(r"(?<![\w.])\d+\.\d+(?![\df.e-])", code), name


@pytest.mark.compiler
def test_a_name_that_would_end_a_comment_does_not(examples):
    evil = "evil */ #error \n line /* (* *) #error ??/ \u202e \x1b /*/ (*)"
    scenario = replace(load_scenario(examples / "finger.toml"), name=evil)
    exported = export_project(scenario, profile_N=np.ones(3))
    for name, text in exported.files.items():
        if name.endswith((".c", ".h", ".cpp")):
            code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
            assert text.count("/*") == text.count("*/"), name
            assert "evil" not in code
            assert "??" not in text
        if name.endswith(".st"):
            assert text.count("(*") == text.count("*)"), name
            assert "evil" not in re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
        if not name.endswith(".json"):  # which has the name as it is
            assert not {"\u202e", "\x1b"} & set(text), name


@pytest.mark.parametrize("name", ["a /* b", "a */ b", "(* *)", "/*/", "(*)", "???/", "a\nb"])
def test_a_harmless_name_keeps_its_letters_and_has_no_mark(name):
    safe = harmless(name)
    assert safe.replace(" ", "") == "".join(name.split())
    assert not any(mark in safe for mark in ("/*", "*/", "(*", "*)", "??", "\n"))


@pytest.mark.parametrize("bad", ["9x", "int", "a b", "", "_x", "x_", "a__b", "ä", "x" * 25, "a-b"])
def test_a_prefix_that_is_no_good_c_name_is_refused(bad):
    with pytest.raises(InputError, match="--prefix must be a C identifier"):
        check_prefix(bad)


@pytest.mark.compiler
def test_the_command_exports_the_agreed_files(examples, tmp_path):
    out = tmp_path / "c"
    arguments = [
        "export-c",
        str(examples / "finger.toml"),
        "--out",
        str(out),
        "--precision",
        "float",
        "--prefix",
        "rig",
    ]
    assert run(arguments) == 0
    modules = ("inverse", "capstan", "table", "profile", "plant")
    expected = {f"rig_{m}.{s}" for m in modules for s in "ch"}
    expected |= {
        "design.json",
        "self_test.c",
        "self_test_data.h",
        "example_main.c",
        "Makefile",
        "CMakeLists.txt",
        "README.md",
    }
    assert expected <= {p.name for p in out.iterdir()}
    assert json.loads((out / "design.json").read_text())["precision"] == "float"
    assert "typedef float rig_real;" in (out / "rig_types.h").read_text()
    assert run([*arguments[:3], str(tmp_path / "d"), "--prefix", "1"]) == 2
    assert not (tmp_path / "d").exists()


@pytest.mark.compiler
def test_two_exports_build_under_one_cmake_project(examples, tmp_path):
    for tool in ("cmake", "cc", "make"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    scenario = load_scenario(examples / "finger.toml")
    scenario = replace(scenario, reference=replace(scenario.reference, duration_s=0.5))
    for prefix in ("left", "right"):
        export_project(scenario, profile_N=np.full(3, 30.0), prefix=prefix, force_export=True).write(tmp_path / prefix)
    lines = [
        "cmake_minimum_required(VERSION 3.13)",
        "project(hand C)",
        "add_subdirectory(left)",
        "add_subdirectory(right)",
    ]
    lines += ["add_executable(hand main.c)", "target_link_libraries(hand left::left right::right)"]
    (tmp_path / "CMakeLists.txt").write_text("\n".join(lines))
    main = '#include "left_inverse.h"\n#include "right_stream.h"\nint main(void) { left_inverse a; right_stream b;'
    main += " left_inverse_init(&a, 30); right_stream_init(&b, 30); return 0; }\n"
    (tmp_path / "main.c").write_text(main)
    for command in (("cmake", "-S", ".", "-B", "build"), ("cmake", "--build", "build"), ("build/hand",)):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.compiler
def test_every_source_says_whose_it_is(finger_files):
    for name, text in finger_files().items():
        if name.endswith((".c", ".h")):
            assert "The licence of tendonff does not cover what it writes" in text, name
