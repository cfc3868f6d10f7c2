"""The yardstick: the chain passes every case, what is simpler does not, and the answers stand on their own."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.yardstick.__main__ import adapters, errors, failures, text_of
from benchmarks.yardstick.answers import answer
from benchmarks.yardstick.brute import coulomb_run
from benchmarks.yardstick.case import all_cases, error_percent

ROOT = Path(__file__).resolve().parents[1]
CASES = all_cases()
LEVELS = ("tendonff elastic", "tendonff viscoelastic", "tendonff presliding")


@pytest.fixture(scope="module")
def table():
    runs, _ = adapters()
    names = [name for name in runs if name != "Newton"]
    return names, errors(names, runs, CASES)


@pytest.mark.compiler
@pytest.mark.slow
def test_the_chain_passes_every_case_and_a_lower_level_all_but_those_of_the_physics_it_leaves_out(table):
    names, found = table
    assert [failures(found, CASES, name) for name in LEVELS] == [
        ["09_presliding", "10_relaxation"],
        ["09_presliding"],
        [],
    ]
    assert all(row[LEVELS[-1]] is not None for row in found.values())
    assert text_of(found, CASES, names).count("\n") == len(CASES) + 2


@pytest.mark.compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", ["MuJoCo frictionloss", "play over total angle"])
def test_constant_friction_and_one_play_fail_five_cases_or_more(table, name):
    names, found = table
    if name not in names:
        pytest.skip("mujoco is not installed")
    assert len(failures(found, CASES, name)) >= 5


def test_the_cases_are_fifteen_and_each_says_what_it_tests_and_where_its_answer_comes_from():
    assert len(CASES) == 15
    for case in CASES:
        assert case.physics.endswith(".")
        assert case.source.endswith(".")
        assert case.tolerance_percent >= 0


@pytest.mark.parametrize("key", ["01_one_end", "07_asymmetric", "08_load_independent"])
def test_cones_and_brute_force_agree_where_both_apply(key):
    """Two answers that share nothing; the brute force rounds the corner between sticking and slipping."""
    case = next(case for case in CASES if case.key == key)
    coarse = replace(case, raw=case.raw | {"row_s": 0.02, "far_spring_N_per_m": 3000.0})
    assert error_percent(coarse, coulomb_run(coarse), answer(coarse)) < 0.5


def test_a_relaxing_tendon_keeps_the_ratio_of_its_tensions_and_ends_at_the_lasting_stiffness():
    case = next(case for case in CASES if case.key == "10_relaxation")
    longer = replace(case, raw=case.raw | {"duration_s": 20.0})
    found = answer(longer)
    assert found["near_tension_N"] / found["far_tension_N"] == pytest.approx(np.exp(0.2 * 3.1416))
    a = 0.2 * 3.1416
    assert found["near_tension_N"][-1] == pytest.approx((0.05 + 20000 * 0.0015) * a / -np.expm1(-a), rel=1e-6)


def test_cases_and_answers_need_numpy_alone():
    code = (
        "import sys, benchmarks.yardstick.answers;"
        "print([m for m in ('tendonff', 'scipy', 'casadi', 'matplotlib', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
