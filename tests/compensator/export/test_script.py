"""Scripts of self tests: every kind of expectation passes where it holds, and fails where it does not."""

import math
import shutil
import subprocess

import pytest

from tendonff.compensator.export.script import ANSWER, EACH, ModuleRecord, Port, Script
from tendonff.compensator.export.tension.data import checksum
from tendonff.ocp.codegen.precision import Precision

HEADER = """
#include <stdint.h>
typedef double tff_real;
typedef struct { tff_real total, parts[2]; uint32_t status; } tff_sum;
static void tff_sum_init(tff_sum *self) { self->total = 0; self->parts[0] = 0; self->parts[1] = 0; self->status = 0u; }
static double tff_sum_step(tff_sum *self, tff_real value, const tff_real *parts)
{
    self->total += value;
    self->parts[0] += parts[0];
    self->parts[1] += parts[1];
    self->status = (self->total > 2.5) ? 5u : 1u;
    return self->total;
}
"""
SUM = ModuleRecord(
    name="sum",
    type="tff_sum",
    inputs={"value": 0, "parts": 2},
    calls={"init": "tff_sum_init(self)", "step": "answer = tff_sum_step(self, {value}, &{parts})"},
    ports=(
        Port(name="total [N]", member="total"),
        Port(name="parts [N]", member="parts", count=2),
        Port(name="status", member="status", kind="u"),
    ),
)


def began():
    """Three steps of 1 N, the parts 0, 1, 2 and 0, 2, 4 N."""
    script = Script(precision=Precision.DOUBLE, prefix="tff")
    check = script.check(SUM, "steps add up").call("init").call("init", 1).then(3)
    return script, check.call("step", value=1.0, parts=[[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]])


EXPECTATIONS = {
    "a number": lambda c, right: c.near("total", [1.0, 2.0, 3.0 if right else 3.1], 1e-9),
    "what was returned": lambda c, right: c.near(ANSWER, [1.0, 2.0, 3.0 if right else math.inf], 1e-9),
    "every number of an array": lambda c, right: c.near("parts", [[0, 0], [1, 2], [3, 6 if right else 7]], 1e-9),
    "bounds": lambda c, right: c.within("total", 1.0, 3.0 if right else 2.9),
    "a change": lambda c, right: c.moved("total", 1.0 if right else 0.9),
    "no change": lambda c, right: c.held("status" if right else "total", 4.0 if right else 0.5),
    "another slot": lambda c, right: c.apart("total", [1.0, 2.0, 3.0 if right else 2.0], 1e-9),
    "bits": lambda c, right: c.bits("status", some=1, none=2 if right else 4),
    "exact bits": lambda c, right: c.when("total", 2.5, 9.0, lambda d: d.bits("status", exactly=5 if right else 4)),
    "bits at times": lambda c, right: c.when_bits("status", 4, lambda d: d.within("total", 2.5 if right else 3.5, 9.0)),
    "a checksum": lambda c, right: c.checksum(checksum([1.0, 2.0, 3.0 if right else 4.0], Precision.DOUBLE)),
    "means": lambda c, right: c.then(20).call("step", value=0.0).near("total", 3.0, 1e-9 if right else -1.0, mean=True),
}  # fmt: skip


def result(script, folder):
    """What the program prints, and its exit status."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    for name, text in (script.text(["tff_sum.h"], " * A test.") | {"tff_sum.h": HEADER}).items():
        (folder / name).write_text(text, encoding="utf-8")
    subprocess.run(
        ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "self_test.c", "-lm", "-o", "st"], cwd=folder, check=True
    )
    done = subprocess.run([folder / "st"], capture_output=True, text=True, check=False)
    return done.stdout, done.returncode


@pytest.mark.compiler
def test_each_kind_of_expectation_can_fail_and_says_where(tmp_path):
    right, wrong = Script(precision=Precision.DOUBLE, prefix="tff"), Script(precision=Precision.DOUBLE, prefix="tff")
    for name, add in EXPECTATIONS.items():
        for script, holds in ((right, True), (wrong, False)):
            check = script.check(SUM, name).call("init").call("init", 1).then(3)
            add(check.call("step", value=1.0, parts=[[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]]), holds)
    said, code = result(right, tmp_path)
    assert code == 0, said
    assert said.count("passes sum: ") == len(EXPECTATIONS)
    said, code = result(wrong, tmp_path)
    assert code == 1
    assert [name for name in EXPECTATIONS if f"FAILS  sum: {name}; row " not in said] == []
    assert "FAILS  sum: a number; row 3 of 3, total [N]: got 3, expected 3.1" in said


@pytest.mark.compiler
def test_states_can_be_written_copied_and_filled_and_inputs_can_be_ramps(tmp_path):
    script = Script(precision=Precision.DOUBLE, prefix="tff")
    check = script.check(SUM, "states").fill(1, 0xFF).call("init").write("total", 4.0).copy(1, 0)
    check.call("step", 1, value=1.0, parts=[0.0, 0.0]).near("total", 4.0).near("total", 5.0, slot=1)
    check = check.then(3)
    check.call("step", value=EACH).near("total", [4.0, 5.0, 7.0])
    assert result(script, tmp_path)[1] == 0


def test_numbers_are_stored_once_and_rows_must_be_as_many_as_the_check_has():
    script, check = began()
    stored = len(script.numbers)
    check.near("parts", [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]], 1.0)
    assert len(script.numbers) == stored
    with pytest.raises(ValueError, match='"steps add up": 2 rows of numbers for 3 of the check'):
        check.near("total", [1.0, 2.0], 1e-9)
