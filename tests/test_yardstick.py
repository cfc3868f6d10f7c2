"""The yardstick: the chain passes every case, what is simpler does not, and the answers stand on their own."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.yardstick import brute
from benchmarks.yardstick.__main__ import adapters, errors, failures, text_of
from benchmarks.yardstick.answers import answer
from benchmarks.yardstick.brute import coulomb_run
from benchmarks.yardstick.case import Phase, all_cases, error_percent

ROOT = Path(__file__).resolve().parents[1]
CASES = all_cases()
LEVELS = ("tendonff elastic", "tendonff viscoelastic", "tendonff presliding")


@pytest.fixture(scope="module")
def table():
    runs, _ = adapters()
    names = [name for name in runs if name != "Newton"]
    return names, errors(names, runs, CASES)


@pytest.mark.compiler
@pytest.mark.nightly
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
@pytest.mark.nightly
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


def test_between_rigid_holds_a_relaxing_tendon_follows_the_closed_form():
    """Zener element, times a/(1 - e^-a) at the near end of a tendon in full slip, and e^-a less at the far end."""
    case = next(case for case in CASES if case.key == "10_relaxation")
    rigid = replace(case, raw=case.raw | {"hold_N_per_m": np.inf})
    raw, t, a = case.raw, case.time_s, case.path[0].exponents[0]
    ramp_s, travel_m = 0.3, 0.0015
    tau, rate = raw["relaxation_time_s"], travel_m / ramp_s
    ramp, hold = np.minimum(t, ramp_s), np.maximum(t - ramp_s, 0.0)
    relaxing = rate * tau * -np.expm1(-ramp / tau) * np.exp(-hold / tau)
    mean = raw["start_N"] + raw["stiffness_N_per_m"] * rate * ramp + raw["relaxing_stiffness_N_per_m"] * relaxing
    near = mean * a / -np.expm1(-a)
    assert error_percent(case, answer(rigid), {"near_tension_N": near, "far_tension_N": near * np.exp(-a)}) < 0.02


def test_the_answer_to_relaxation_settles_with_the_number_of_contacts(monkeypatch):
    """A tenth of the tolerance with half the contacts, and less with more."""
    case = next(case for case in CASES if case.key == "10_relaxation")
    found = {}
    for pieces in (25, 50, 100):
        monkeypatch.setattr(brute, "PIECES", pieces)
        found[pieces] = answer(case)
    steps = [error_percent(case, found[n], found[2 * n]) for n in (25, 50)]
    assert steps[0] < 0.1 * case.tolerance_percent
    assert steps[1] < 0.5 * steps[0]


@pytest.mark.parametrize(("far_share", "limit_percent"), [(0.0, 1e-9), (0.4, 0.6)])
def test_contacts_between_led_ends_give_the_far_tension_of_the_cones(far_share, limit_percent):
    """The cones are given the near end's tension, the contacts its travel; two ends at once are as good as the rows."""
    pieces, stiffness, start, rng = 20, 2e4, 30.0, np.random.default_rng(1)
    case = next(case for case in CASES if case.key == "02_both_ends")
    t = np.arange(601) * 0.005
    near, far = (
        np.interp(t, np.linspace(0, 3, 13), np.append(0.0, rng.uniform(-0.6, 0.8, 12))) * start / stiffness
        for _ in range(2)
    )
    far *= far_share
    stiff = stiffness * pieces / np.r_[0.5, np.ones(pieces - 1), 0.5]
    contacts = brute.LedContacts(case.path[0].exponents[0], pieces)
    found = np.array(
        [
            contacts.balance(start + stiff * np.r_[a, np.zeros(pieces - 1), b], stiff)
            for a, b in zip(near, far, strict=True)
        ]
    )
    phase = Phase(time_s=t, ends={"near": {"tension_N": found[:, 0]}, "far": {"travel_m": -far}})
    given = replace(case, phases=(phase,), raw=case.raw | {"row_s": 0.005, "start_N": start})
    assert error_percent(given, {"far_tension_N": found[:, -1]}, answer(given)) < limit_percent


def test_cases_and_answers_need_numpy_alone():
    code = (
        "import sys, benchmarks.yardstick.answers;"
        "print([m for m in ('tendonff', 'scipy', 'casadi', 'matplotlib', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
