"""What the exported C lets a controller change while it runs."""

import ctypes
import math
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.text.parameters import parameters_of
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert

pytestmark = pytest.mark.compiler

ROWS = 1600
DRIVER = """
long play_{kind}(long n, const tff_real *given, long change, const tff_parameters *with, tff_real *answer)
{{
    tff_{kind} self;
    long k, good = 1;
    tff_{kind}_init(&self, given[0]);
    for (k = 0; k < n; k++) {{
        if (k == change) {{
            good = tff_{kind}_use(&self, with);
        }}
        answer[k] = tff_{kind}_step(&self, given[k]);
    }}
    return good;
}}
"""
KINDS = ("inverse", "capstan", "table", "stream")


@pytest.fixture(scope="module")
def play(examples, tmp_path_factory):
    """Forces of an exported module for the reference, with other parameters from a sample on."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    made = {}

    def run(example, precision, kind, change, **members):
        scenario = load_scenario(examples / f"{example}.toml")
        key = example, precision
        if key not in made:
            folder = tmp_path_factory.mktemp(f"{example}_{precision}")
            exported = export_project(scenario, precision=precision, profile_N=np.full(3, 30.0), force_export=True)
            exported.write(folder)
            text = "".join(f'#include "tff_{k}.h"\n' for k in KINDS) + "".join(DRIVER.format(kind=k) for k in KINDS)
            (folder / "driver.c").write_text(text)
            sources = [*sorted(folder.glob("tff_*.c")), folder / "driver.c"]
            flags = ("-std=c99", "-O0", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno")
            subprocess.run(["cc", *flags, "-o", folder / "x.so", *sources, "-lm"], check=True)
            made[key] = ctypes.CDLL(str(folder / "x.so"))
        real = np.float32 if precision is Precision.FLOAT else np.float64
        values = {p.name: p.value for p in parameters_of(Problem.of(scenario))} | members
        record = np.array(list(values.values()), dtype=real)
        given = np.ascontiguousarray(sample_reference(scenario).tension_N[:ROWS], dtype=real)
        answer = np.empty_like(given)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (given, record, answer)]
        called = getattr(made[key], f"play_{kind}")
        good = called(ctypes.c_long(ROWS), pointers[0], ctypes.c_long(change), pointers[1], pointers[2])
        return answer.astype(float), good

    return run


def with_friction(scenario, pull, release, adhesion):
    friction = scenario.transmission.friction
    ratio = friction.mu_static / friction.mu_dynamic
    other = replace(
        friction,
        mu_dynamic=pull,
        mu_static=pull * ratio,
        mu_dynamic_release=release,
        mu_static_release=release * friction.release_static / friction.release_dynamic,
        adhesion_N=adhesion,
    )
    return replace(scenario.transmission, friction=other)


@pytest.mark.parametrize(
    ("example", "precision", "tolerance"),
    [
        ("finger", Precision.FLOAT, 0.02),
        pytest.param("finger_stribeck", Precision.DOUBLE, 1e-8, marks=pytest.mark.nightly),
        pytest.param("finger_stribeck", Precision.FLOAT, 0.02, marks=pytest.mark.nightly),
        pytest.param("finger", Precision.DOUBLE, 1e-8, marks=pytest.mark.nightly),
    ],
)
def test_the_inverse_is_that_of_the_friction_that_is_set(play, examples, example, precision, tolerance):
    """Set before the first sample: the inverse that Python makes for both coefficients and the adhesion."""
    scenario = load_scenario(examples / f"{example}.toml")
    other = Chain.of(with_friction(scenario, 0.24, 0.17, 1.5), scenario.run.level)
    reference = sample_reference(scenario).tension_N[:ROWS]
    wanted = invert(other, reference, scenario.run.step_s).force_N
    forces, good = play(example, precision, "inverse", 0, mu_pull=0.24, mu_release=0.17, adhesion=1.5)
    plain, _ = play(example, precision, "inverse", ROWS)
    assert good == 1
    assert forces == pytest.approx(wanted, abs=tolerance)
    assert np.abs(plain - wanted).max() > 5


def test_the_static_law_is_that_of_the_friction_that_is_set(play, examples):
    tension = sample_reference(load_scenario(examples / "finger.toml")).tension_N[:ROWS]
    forces, _ = play("finger", Precision.DOUBLE, "capstan", 0, mu_pull=0.24, mu_release=0.17, adhesion=1.5)
    rising = np.flatnonzero(np.diff(tension) > 0) + 1
    falling = np.flatnonzero(np.diff(tension) < 0) + 1
    assert forces[rising] == pytest.approx((tension[rising] + 1.5) * math.exp(0.24 * math.pi) - 1.5, rel=1e-12)
    assert forces[falling] == pytest.approx((tension[falling] + 1.5) * math.exp(-0.17 * math.pi) - 1.5, rel=1e-12)


def test_a_change_of_friction_in_motion_is_no_jump_in_the_inverse(play, record_property):
    """Five per cent more friction at any of many samples: the force moves off slowly to what that friction asks for."""
    bumps, ends = [], []
    plain, _ = play("finger", Precision.DOUBLE, "inverse", ROWS)
    for change in range(100, 1400, 130):
        forces, _ = play("finger", Precision.DOUBLE, "inverse", change, mu_pull=0.21, mu_release=0.21)
        moved = forces - plain
        assert np.all(moved[:change] == 0)
        bumps.append(np.abs(np.diff(moved[change - 1 : change + 10])).max())
        ends.append(np.abs(moved[change:]).max())
    static, _ = play("finger", Precision.DOUBLE, "capstan", 650, mu_pull=0.21, mu_release=0.21)
    jump = np.abs(np.diff(static - play("finger", Precision.DOUBLE, "capstan", ROWS)[0])).max()
    record_property(
        "figure",
        f"5 % more friction in motion: {max(bumps):.2g} N a sample at most in the inverse, "
        f"which ends {max(ends):.2g} N higher; {jump:.2g} N in the capstan law",
    )
    assert max(ends) > 1
    assert max(bumps) < 0.3
    assert jump > 4 * max(bumps)


@pytest.mark.parametrize("kind", KINDS)
def test_limits_that_are_set_hold_in_every_module(play, kind):
    """The last output is led inside them at the new rate, and never leaves them."""
    plain, _ = play("finger", Precision.DOUBLE, kind, ROWS)
    low, high = (float(np.quantile(plain, share)) for share in (0.2, 0.7))
    forces, good = play("finger", Precision.DOUBLE, kind, 600, force_min=low, force_max=high, force_rate_max=600.0)
    assert good == 1
    assert forces[:600] == pytest.approx(plain[:600], abs=0)
    assert np.abs(np.diff(forces[599:])).max() <= 0.6 + 1e-9
    inside = np.flatnonzero((forces[600:] >= low) & (forces[600:] <= high))
    assert inside[0] < 200
    later = forces[600 + inside[0] :]
    assert later.min() >= low - 1e-9
    assert later.max() <= high + 1e-9
    assert np.ptp(later) == pytest.approx(high - low, rel=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [{"mu_pull": math.nan}, {"mu_release": -0.1}, {"adhesion": math.inf}, {"force_max": 1e6}, {"force_min": 300.0}],
)
def test_a_record_that_is_not_good_changes_nothing(play, wrong):
    """A calibration tool writes into memory, past the setters."""
    plain, _ = play("finger", Precision.DOUBLE, "inverse", ROWS)
    forces, good = play("finger", Precision.DOUBLE, "inverse", 500, **wrong)
    assert good == 0
    assert np.array_equal(forces, plain)


@pytest.mark.parametrize("precision", Precision)
def test_a_calibration_tool_reads_the_description_and_finds_every_member(examples, tmp_path, precision):
    """Strictly by the standard, and with the addresses that the linker gave the members."""
    tool = Path(sys.executable).with_name("a2ltool")
    if not tool.exists() or shutil.which("gcc") is None or not sys.platform.startswith("linux"):
        pytest.skip("a2ltool or gcc is not installed")
    scenario = load_scenario(examples / "finger.toml")
    scenario = replace(scenario, reference=replace(scenario.reference, duration_s=0.5))
    export_project(scenario, precision=precision, profile_N=np.full(3, 30.0), prefix="rig").write(tmp_path)
    described = tmp_path / "rig_parameters.a2l"
    done = subprocess.run([tool, described, "--check", "--strict"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No problems" in done.stdout + done.stderr
    main = (
        '#include "rig_parameters.h"\n#include <stdio.h>\nrig_parameters rig_calibration;\n'
        "int main(void) { rig_parameters_init(&rig_calibration); return 0; }\n"
    )
    (tmp_path / "app.c").write_text(main)
    program = tmp_path / "app"
    subprocess.run(
        ["gcc", "-g", "-no-pie", tmp_path / "app.c", tmp_path / "rig_parameters.c", "-o", program], check=True
    )
    found = tmp_path / "found.a2l"
    subprocess.run(
        [tool, described, "--elffile", program, "--update", "--update-mode", "STRICT", "--output", found],
        check=True,
        capture_output=True,
    )
    symbols = subprocess.run(["nm", program], check=True, capture_output=True, text=True).stdout
    base = int(re.search(r"([0-9a-f]+) B rig_calibration", symbols)[1], 16)
    text = found.read_text()
    addresses = [int(a, 16) - base for a in re.findall(r"VALUE (0x[0-9A-Fa-f]+) rig_real", text)]
    size = 4 if precision is Precision.FLOAT else 8
    assert addresses == [size * k for k in range(len(parameters_of(Problem.of(scenario))))]
    assert ("FLOAT32_IEEE COLUMN_DIR" in text) == (precision is Precision.FLOAT)
    members = [p.name for p in parameters_of(Problem.of(scenario))]
    assert re.findall(r"begin CHARACTERISTIC rig_(\w+)", text) == members
    assert all(f'"rig_calibration.{name}"' in text for name in members[1:])  # as the debugger knows them
