"""Chains whose friction falls with the load: forward, inverse, moving path, and an independent plant."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Path
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tests.independent_plant import respond

STEP = 1e-3


def loaded(rig, n=0.25):
    return replace(rig, friction=replace(rig.friction, load_exponent=n, reference_tension_N=20.0))


def wanted(seconds=1.5):
    time = np.arange(0.0, seconds, STEP)
    return 30 + np.minimum(time / 0.2, 1) * (18 * np.sin(2 * np.pi * time) + 7 * np.sin(7 * np.pi * time))


@pytest.mark.parametrize("masses", [1, 6, 40])
def test_one_way_slip_ends_at_the_closed_form_for_any_number_of_masses(generic, masses):
    rig = loaded(generic)
    rig = replace(rig, friction=replace(rig.friction, viscous_N_s_per_m=0.0, mu_static=rig.friction.mu_dynamic))
    force = np.interp(np.arange(0, 12, 1e-2), [0, 10, 12], [15.0, 120.0, 120.0])
    run = simulate(Chain.of(rig, Level.ELASTIC, masses), force, 1e-2, initial_tension_N=15.0)
    mean_only = {1: 2e-2, 6: 2e-3, 40: 2e-3}[masses]  # an element knows the mean of its two tensions
    expected = CapstanLaw.of(rig).output_history_N(force)[-1]
    assert run.output_tension_N[-1] == pytest.approx(expected, rel=mean_only)


@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("engine", [pytest.param(Engine.COMPILED, marks=pytest.mark.compiler), Engine.CASADI])
def test_the_inverse_reproduces_its_reference_to_round_off(generic, level, engine):
    chain, reference = Chain.of(loaded(generic), level, 4), wanted(0.8)
    found = invert(chain, reference, STEP, engine=engine)
    run = simulate(chain, found.force_N, STEP, engine=engine)
    assert np.abs(run.output_tension_N - reference).max() < 1e-6


def test_sections_with_coefficients_of_their_own_and_a_pulley_are_inverted(generic):
    sections = (
        Section(name="a", angle_rad=1.0, mu_dynamic=0.3, mu_static=0.3),
        Section(name="b", angle_rad=0.8),
        Section(name="c", angle_rad=0.5),
    )
    rig = replace(loaded(generic), path=Path(total_angle_rad=2.3, segments=6, sections=sections))
    chain, reference = Chain.of(rig, Level.PRESLIDING), wanted(0.8)
    run = simulate(chain, invert(chain, reference, STEP).force_N, STEP)
    assert np.abs(run.output_tension_N - reference).max() < 1e-6


def test_the_inverse_delivers_its_reference_on_an_independent_plant(generic, record_property):
    """0.3 % of range; with the coefficient at the reference tension alone ten times as much."""
    rig = loaded(generic)
    rig = replace(rig, friction=replace(rig.friction, mu_static=rig.friction.mu_dynamic))
    reference, time = wanted(), np.arange(0.0, 1.5, STEP)

    def missed(design):
        force = invert(Chain.of(design, Level.PRESLIDING, 12), reference, STEP).force_N
        response = respond(rig, time, force, reference[0], masses=24)
        return 100 * float(np.sqrt(np.mean((response.output_N - reference) ** 2))) / np.ptp(reference)

    found = missed(rig)
    record_property("percent", float(found))
    assert found < 0.3
    blind = replace(rig, friction=replace(rig.friction, load_exponent=None, reference_tension_N=None))
    assert missed(blind) > 10 * found
