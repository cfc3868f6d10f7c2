"""Compensation tables: how they are made and looked up."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_examples import tried_on

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.lookup_table import BranchTable, LookupTable, TableLookup, table_force
from tendonff.compensator.compensators.table import CompensationTable, sweep, table_of
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def reference(finger):
    return sample_reference(finger)


@pytest.fixture(scope="module")
def built(finger, reference):
    return table_of(Problem.of(finger))


def test_the_interpolation_error_stays_under_its_bound(built):
    assert 0 < built.error_N <= built.bound_N


def test_a_table_is_at_least_as_sharp_as_the_samples(finger, built):
    """A step counts as met within less than the tension that passes between two samples."""
    assert 0 < built.resolution_N < built.rate_N_per_s * finger.run.step_s


@pytest.mark.parametrize("branch", Branch)
def test_reversals_that_the_table_was_not_made_from_are_met_within_the_bound(finger, built, branch):
    """Sweeps at tensions between those of the making, with the masses of the chain left out of the comparison."""
    chain = Chain.of(finger.transmission, finger.run.level)
    light = replace(
        chain,
        elements=replace(chain.elements, piece=replace(chain.elements.piece, mass_kg=1e-9)),
        near=replace(chain.near, mass_kg=1e-9),
        far=replace(chain.far, mass_kg=1e-9),
    )
    turn = 29.37
    end = 44.0 if branch is Branch.PULL else 14.0
    way, force = sweep(light, branch, turn, end, built.rate_N_per_s)
    answer = built.table.force_N(way, branch, np.abs(way - turn) / way)
    order = np.argsort(way)
    near = [np.interp(way + shift * built.resolution_N, way[order], force[order]) for shift in (-1, 0, 1)]
    outside = np.maximum(np.min(near, axis=0) - answer, answer - np.max(near, axis=0))
    assert outside.max() < 1.2 * built.bound_N


@pytest.mark.compiler
def test_a_smaller_bound_needs_more_nodes_and_gives_less_error(finger, reference, built):
    finer = table_of(Problem.of(finger), bound_N=0.3 * built.bound_N)
    assert finer.table.nodes > built.table.nodes
    assert finer.error_N <= 0.3 * built.bound_N


def test_with_a_stiff_bristle_the_table_ends_in_the_capstan_law_and_viscous_drag(finger, reference):
    law = CapstanLaw.of(finger.transmission)
    table = table_of(Problem.of(finger, level=Level.ELASTIC), bound_N=0.5).table
    for branch in Branch:
        slip = table.branch(branch).force_N[:, -1]
        assert slip == pytest.approx(law.input_for_N(table.reference_N, branch), abs=0.5)


def test_the_force_does_not_jump_at_a_reversal(built):
    compensator = TableLookup(built.table, 30.0)
    way = np.concatenate([np.linspace(30, 34, 40), np.linspace(34, 33, 11)[1:], np.linspace(33, 33.5, 6)[1:]])
    force = np.array([compensator.step(t) for t in way])
    steps = np.abs(np.diff(force))
    assert steps.max() < 45 * 0.11  # steeper than 45 is no branch of this table; a jump to the other branch is 40 N


def test_the_force_goes_on_without_a_jump_out_of_a_transition_in_any_state(built):
    """Legs of all lengths; after each a step back by a nanonewton moves the force by next to nothing."""
    noise, compensator, here = np.random.default_rng(3), TableLookup(built.table, 30.0), 30.0
    for sign in (1, -1) * 300:
        end = float(np.clip(here + sign * 30 * 10 ** noise.uniform(-4, 0), 14.5, 46.5))
        before = [compensator.step(t) for t in np.linspace(here, end, 5)[1:]][-1]
        here = end - sign * 1e-9
        assert compensator.step(here) == pytest.approx(before, abs=1e-5)


@given(seed=st.integers(0, 2**32 - 1))
@tried_on(25)
def test_the_force_lies_between_the_branches_for_any_history(built, seed):
    noise = np.random.default_rng(seed)
    way = np.clip(30 + np.cumsum(noise.normal(0, 0.4, 200)), 13, 48)
    force = table_force(built.table, way, 30.0)
    low, high = (built.table.force_N(way, b, np.full(way.shape, 9.0)) for b in (Branch.RELEASE, Branch.PULL))
    assert np.all(force[1:] >= low[1:] - built.bound_N)
    assert np.all(force[1:] <= high[1:] + built.bound_N)


def test_a_reference_outside_the_table_is_refused_by_value(built):
    with pytest.raises(ParameterError, match=r"must stay from .* got 99"):
        TableLookup(built.table, 30.0).step(99.0)


def test_doubtful_tables_are_refused():
    flat = BranchTable(share=np.array([0.0, 1.0]), force_N=np.zeros((2, 2)))
    with pytest.raises(ParameterError, match="equal steps"):
        three = BranchTable(share=np.array([0.0, 1.0]), force_N=np.zeros((3, 2)))
        LookupTable(reference_N=np.array([1.0, 2.0, 4.0]), adhesion_N=0, pull=three, release=three)
    with pytest.raises(ParameterError, match="one row per reference"):
        LookupTable(reference_N=np.array([1.0, 2.0, 3.0]), adhesion_N=0, pull=flat, release=flat)
    with pytest.raises(ParameterError, match="finite"):
        BranchTable(share=np.array([0.0, 1.0]), force_N=np.array([[0.0, np.nan]]))


@pytest.mark.compiler
def test_the_command_writes_table_data_header_and_figure(output, examples, tmp_path, record_property):
    out = output("table", "finger", "--level", "presliding").folder
    assert {p.name for p in out.iterdir()} >= {"table.csv", "table.json", "table.h", "table.svg"}
    said = json.loads((out / "table.json").read_text())
    assert {"formula", "model", "level", "parameters", "scenario_hash", "valid_reference_N", "tendonff"} <= said.keys()
    assert set(said["expected_error"]) == {level.value for level in Level}
    first = said["tables"][0]
    percent = said["expected_error"]["presliding"]["rmse_percent_of_range"]
    record_property(
        "figure", f"table of finger.toml: {first['nodes']} nodes, {percent:.2g} % of range as a compensator"
    )
    assert first["interpolation_error_N"] <= first["bound_N"]
    assert run(["table", str(examples / "finger.toml"), "--out", str(tmp_path / "u"), "--rates", "5,x"]) == 2
    assert run(["table", str(examples / "finger.toml"), "--out", str(tmp_path / "u"), "--rates", "-5"]) == 2
    assert run(["table", str(examples / "finger.toml"), "--out", str(tmp_path / "u"), "--rates", "1e300"]) == 2
    assert not (tmp_path / "u").exists()


@pytest.mark.compiler
def test_the_actuators_limits_apply_to_the_table_too(examples):
    slow = load_scenario(examples / "finger_fast.toml")
    force = CompensationTable().profile(Problem.of(slow)).force_N
    most = slow.transmission.actuator.force_rate_max_N_per_s * slow.run.step_s
    assert np.abs(np.diff(force)).max() <= most * (1 + 1e-9)
