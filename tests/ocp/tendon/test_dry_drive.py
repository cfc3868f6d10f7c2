"""Dry friction of the drive: an element without wrap; constant, or growing with the load behind a gear."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.mechanism.linearise import Lineariser
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import whole_of
from tendonff.models.tendon.friction import RubbingEnd
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.sensitivity import Parameter, force_sensitivity, parameter_sensitivity
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tests.independent_plant import respond

COULOMB, SIGMA, H = 4.0, 1e4, 1e-3
END = RubbingEnd(
    mass_kg=0.1, damping_N_s_per_m=2.0, stiffness_N_per_m=0.0, coulomb_N=COULOMB, bristle_stiffness_N_per_m=SIGMA
)
TIME = np.arange(900) * H
REFERENCE_N = 30 + 12 * np.sin(2 * np.pi * 2.5 * TIME) * np.minimum(TIME / 0.1, 1)


EFFICIENCY = 0.8
TIME_SLOW = np.arange(2200) * H


@pytest.fixture(scope="module")
def dry(generic: Transmission) -> Transmission:
    return replace(generic, actuator=replace(generic.actuator, coulomb_N=COULOMB))


@pytest.fixture(scope="module")
def geared(generic: Transmission) -> Transmission:
    return replace(generic, actuator=replace(generic.actuator, gear_efficiency=EFFICIENCY))


def dahl(travel: np.ndarray, coulomb: float, sigma: float) -> np.ndarray:
    """f = s F - (s F - f0) exp(-sigma abs(q - q0)/F) between turns, row by row; s is the direction."""
    force = [0.0]
    for move in np.diff(travel):
        end = np.sign(move) * coulomb
        force.append(end - (end - force[-1]) * np.exp(-sigma * abs(move) / coulomb))
    return np.array(force)


def test_the_implicit_bristle_approaches_dahls_law_over_the_travel() -> None:
    travel = 1e-3 * np.sin(np.linspace(0, 7, 20_001)) ** 3
    v, base = ca.SX.sym("v"), ca.SX.sym("base")
    step = ca.Function("step", [base, v], [END.implicit(v, (base,), 1.0, 0.0)[0]])
    force = np.append(0.0, np.asarray(step.mapaccum(len(travel) - 1)(0.0, np.diff(travel))).ravel())
    assert force == pytest.approx(dahl(travel, COULOMB, SIGMA), abs=2e-3)
    assert np.ptp(force) > 1.9 * COULOMB


@pytest.mark.parametrize("kind", ["dry", "geared"])
@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("engine", [Engine.COMPILED, Engine.CASADI])
@pytest.mark.compiler
def test_inverse_then_chain_gives_the_reference_back(kind: str, level: Level, engine: Engine, request) -> None:
    dry: Transmission = request.getfixturevalue(kind)
    chain = Chain.of(replace(dry, friction=replace(dry.friction, mu_static=dry.friction.mu_dynamic)), level)
    found = invert(chain, REFERENCE_N, H, engine=engine, record=True)
    run = simulate(chain, found.force_N, H, engine=engine, record=True)
    assert run.output_tension_N == pytest.approx(REFERENCE_N, abs=1e-6)
    assert run.states == pytest.approx(found.states, abs=1e-6)
    other = Engine.CASADI if engine is Engine.COMPILED else Engine.COMPILED
    assert found.force_N == pytest.approx(invert(chain, REFERENCE_N, H, engine=other).force_N, abs=1e-9)


def test_the_drive_adds_dahls_friction_of_its_own_travel_to_the_inverse(
    dry: Transmission, generic: Transmission
) -> None:
    """The actuator's motion follows from the reference alone, so forces differ by f_d(q_a)."""
    plain, rubbing = (Chain.of(rig, Level.PRESLIDING) for rig in (generic, dry))
    fine = np.interp(np.arange(4 * len(REFERENCE_N) - 3) / 4, np.arange(len(REFERENCE_N)), REFERENCE_N)
    bare, found = (invert(chain, fine, H / 4, record=True) for chain in (plain, rubbing))
    assert found.states[:, -2] == pytest.approx(bare.states[:, -2], abs=1e-12)
    sigma = dry.friction.soft_bristle_stiffness_N_per_m
    expected = dahl(found.states[:, -2], COULOMB, sigma)
    assert found.force_N - bare.force_N == pytest.approx(expected, abs=0.02 * COULOMB)
    assert np.ptp(expected) > 1.9 * COULOMB


@pytest.mark.parametrize("kind", ["dry", "geared"])
def test_the_continuous_chain_rubs_alike(kind: str, request) -> None:
    dry: Transmission = request.getfixturevalue(kind)
    smooth = replace(dry, friction=replace(dry.friction, mu_static=dry.friction.mu_dynamic))
    chain = Chain.of(smooth, Level.PRESLIDING, 2)
    step = H / 4
    force = 30 + 20 * np.sin(2 * np.pi * 2 * step * np.arange(1200))
    adaptive = simulate(chain, force, step, method=Method.CVODES).require().output_tension_N
    own = simulate(chain, force, step, initial_tension_N=30.0).output_tension_N
    assert own == pytest.approx(adaptive, abs=0.02)
    free = replace(smooth, actuator=replace(smooth.actuator, coulomb_N=None, gear_efficiency=None))
    without = simulate(Chain.of(free, Level.PRESLIDING, 2), force, step)
    assert np.abs(own - without.output_tension_N).max() > 0.9


def test_a_drive_that_sticks_is_a_spring_to_the_ground(dry: Transmission, generic: Transmission) -> None:
    """Linearised at rest the bristle repeats q_a: no state more, and the static gain of a spring sigma0."""
    gains = []
    for rig in (generic, dry):
        linear = Lineariser(Chain.of(rig, Level.PRESLIDING)).at(Chain.of(rig, Level.PRESLIDING).rest_state(30.0))
        static = linear.d - linear.c @ np.linalg.solve(linear.a, linear.b)
        gains.append((len(linear.states), static[-2].item()))
    (few, free), (same, held) = gains
    assert few == same
    assert 1 / held == pytest.approx(1 / free + dry.friction.soft_bristle_stiffness_N_per_m, rel=1e-9)


@pytest.mark.parametrize("kind", ["dry", "geared"])
@pytest.mark.parametrize("engine", [Engine.COMPILED, Engine.CASADI])
@pytest.mark.compiler
def test_sensitivities_are_those_of_finite_differences(kind: str, engine: Engine, request) -> None:
    dry: Transmission = request.getfixturevalue(kind)
    force = 30 + 15 * np.sin(2 * np.pi * 2 * TIME[:300])

    def respond(rig: Transmission, drive: np.ndarray = force) -> np.ndarray:
        run = simulate(Chain.of(rig, Level.PRESLIDING, 3), drive, H, initial_tension_N=30.0)
        return np.column_stack([run.output_tension_N, 1e4 * run.near_position_m])

    def central(change, size: float) -> np.ndarray:
        return (change(size) - change(-size)) / (2 * size)

    def heavier(by: float) -> np.ndarray:
        return respond(replace(dry, tendon=replace(dry.tendon, mass_kg=dry.tendon.mass_kg + by)))

    chain, whole = Chain.of(dry, Level.PRESLIDING, 3), whole_of(dry, Level.PRESLIDING)
    found = parameter_sensitivity(
        whole, chain, force, H, [{Parameter.MASS: 1.0}], initial_tension_N=30.0, engine=engine
    )
    slopes = np.column_stack([found.tension_slopes[:, 0, 0], 1e4 * found.ends_slopes[:, 0, 0]])
    expected = central(heavier, 1e-6)
    assert slopes == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    knots = np.array([0, 80, 160, 299])
    by_knot = force_sensitivity(chain, force, H, knots, state=chain.rest_state(30.0), engine=engine)
    hat = np.interp(np.arange(300), knots, np.eye(4)[1])
    expected = central(lambda by: respond(dry, force + by * hat)[:, 0], 1e-4)
    assert by_knot.tension_slopes[:, 0, 1] == pytest.approx(expected, abs=1e-6)


@pytest.mark.compiler
def test_a_gear_takes_its_share_of_the_tension_whichever_side_drives(geared: Transmission) -> None:
    """In slow slip F = T (2 - efficiency) pulling and T efficiency where the tendon drives the gear back."""
    smooth = replace(geared, friction=replace(geared.friction, mu_static=geared.friction.mu_dynamic))
    chain = Chain.of(smooth, Level.ELASTIC, 3)
    found = invert(chain, 40 + 20 * np.sin(np.pi * TIME_SLOW), H, record=True)
    run = simulate(chain, found.force_N, H)
    damping = geared.actuator.damping_N_s_per_m * found.states[:, 0]
    share, way = (found.force_N - damping) / run.tension_N[:, 0], np.cos(np.pi * TIME_SLOW)
    assert np.median(share[(way > 0.4) & (TIME_SLOW > 0.1)]) == pytest.approx(2 - EFFICIENCY, abs=5e-3)
    assert np.median(share[way < -0.9]) == pytest.approx(EFFICIENCY, abs=0.01)


@pytest.mark.compiler
def test_a_gear_that_loses_nothing_is_none(generic: Transmission, geared: Transmission) -> None:
    ideal = replace(generic, actuator=replace(generic.actuator, gear_efficiency=1.0))
    assert Chain.of(ideal, Level.ELASTIC).near == Chain.of(generic, Level.ELASTIC).near
    assert Chain.of(geared, Level.ELASTIC).near != Chain.of(generic, Level.ELASTIC).near


def test_an_independent_plant_gives_the_reference_that_the_inverse_was_asked_for(geared: Transmission) -> None:
    smooth = replace(geared, friction=replace(geared.friction, mu_static=geared.friction.mu_dynamic))
    chain = Chain.of(smooth, Level.PRESLIDING, 24)
    force = invert(chain, REFERENCE_N[:500], H).force_N
    seen = respond(smooth, TIME[:500], force, float(REFERENCE_N[0]), masses=24)
    error = np.sqrt(np.mean((seen.output_N - REFERENCE_N[:500]) ** 2)) / np.ptp(REFERENCE_N)
    assert error < 0.002  # 0.0010; 0.16 where the gear is left out
