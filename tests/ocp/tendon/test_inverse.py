import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.tendon.inverse import InverseStatus, invert
from tendonff.ocp.tendon.simulate import at_rest, simulate

Array = NDArray[np.float64]
STEP = 1e-3


def reference(seconds: float = 2.0) -> Array:
    time = np.arange(0.0, seconds, STEP)
    return 30 + np.minimum(time / 0.5, 1) * (12 * np.sin(np.pi * time) + 5 * np.sin(2.6 * np.pi * time))


def smooth(generic: Transmission) -> Transmission:
    """Without the Stribeck effect."""
    return replace(generic, friction=replace(generic.friction, mu_static=0.2, mu_static_release=0.15))


@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("n", [1, 6, 40])
def test_the_force_gives_the_reference_back(generic: Transmission, level: Level, n: int) -> None:
    """To 1e-6 N through the same scheme, the Stribeck effect included where the bristle is soft."""
    rig = generic if level is Level.PRESLIDING else smooth(generic)
    chain = Chain.of(rig, level, n)
    inversion = invert(chain, reference(), STEP, record=True)
    assert inversion.status is InverseStatus.EXACT
    run = simulate(chain, inversion.force_N, STEP, initial_tension_N=30.0, record=True).require()
    assert np.abs(run.output_tension_N - reference()).max() < 1e-6
    assert inversion.least_tension_N == pytest.approx(run.tension_N.min(axis=1), abs=1e-5)
    assert inversion.states is not None
    assert run.states is not None
    assert np.abs(inversion.states[:, -2:] - run.states[:, -2:]).max() < 1e-9


@pytest.mark.parametrize("level", Level)
def test_the_force_of_a_few_masses_serves_many(generic: Transmission, level: Level) -> None:
    """Designed on N = 6 at 1 ms, played on N = 40 at 0.1 ms without Stribeck effect: 0.3 % of range rms."""
    rig = smooth(generic)
    wanted = reference()
    force = invert(Chain.of(rig, level, 6), wanted, STEP).force_N
    time = np.arange(len(wanted)) * STEP
    fine_time = np.arange((len(wanted) - 1) * 10 + 1) * STEP / 10
    plant = Chain.of(rig, level, 40)
    out = simulate(plant, np.interp(fine_time, time, force), STEP / 10, initial_tension_N=30.0).require()
    error = out.output_tension_N[::10] - wanted
    assert 100 * math.sqrt(np.mean(error**2)) / np.ptp(wanted) < 0.3
    # Uncompensated, with the reference itself as the force, it is far off.
    plain = simulate(plant, wanted, STEP).require().output_tension_N - wanted
    assert 100 * math.sqrt(np.mean(plain**2)) / np.ptp(wanted) > 15


def test_the_inverse_starts_at_rest_with_another_tension(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    wanted = np.concatenate([[25.0], np.linspace(25.0, 40.0, 400)])
    inversion = invert(chain, wanted, STEP, state=chain.rest_state(25.0))
    run = simulate(chain, inversion.force_N, STEP, state=chain.rest_state(25.0)).require()
    assert np.abs(run.output_tension_N[1:] - wanted[1:]).max() < 1e-6


@pytest.mark.parametrize("row", [400, 900])
def test_a_resumed_inverse_begins_with_the_force_of_its_state(generic: Transmission, row: int) -> None:
    """The tension at the actuator and what its viscous bearing takes: all of the force but that of its inertia."""
    chain = Chain.of(generic, Level.PRESLIDING)
    wanted = reference()
    whole = invert(chain, wanted, STEP, record=True)
    assert whole.states is not None
    state = ChainState.from_vector(whole.states[row], chain.layout, row * STEP)
    resumed = invert(chain, wanted[row:], STEP, state=state)
    velocity = whole.states[row - 2 : row + 1, 0]
    acceleration = (1.5 * velocity[2] - 2 * velocity[1] + 0.5 * velocity[0]) / STEP
    inertia = chain.near.mass_kg * acceleration
    assert abs(inertia) > 1e-4
    assert resumed.force_N[0] == pytest.approx(whole.force_N[row] - inertia, abs=1e-9)
    run = simulate(chain, resumed.force_N, STEP, state=state).require()
    assert np.abs(run.output_tension_N[1:] - wanted[row + 1 :]).max() < 1e-6


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_a_start_that_no_tendon_can_have_is_refused(generic: Transmission, bad: float) -> None:
    with pytest.raises(ParameterError, match=rf"initial_tension_N must be a finite number >= 0, got {bad}"):
        invert(Chain.of(generic, Level.ELASTIC), np.full(5, 30.0), STEP, initial_tension_N=bad)


def test_half_a_newton_is_a_tension(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.ELASTIC)
    inversion = invert(chain, np.full(20, 0.5), STEP, initial_tension_N=0.5)
    assert inversion.status is InverseStatus.EXACT
    assert inversion.force_N == pytest.approx(np.full(20, 0.5))


@pytest.mark.parametrize("shape", [(0,), (3, 2)])
def test_a_reference_that_is_no_vector_is_refused(generic: Transmission, shape: tuple[int, ...]) -> None:
    with pytest.raises(ParameterError, match="reference_N must be a vector with at least one row"):
        invert(Chain.of(generic, Level.ELASTIC), np.full(shape, 30.0), STEP)


def test_a_reference_that_falls_too_fast_is_said_to_push(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.VISCOELASTIC)
    wanted = np.where(np.arange(300) < 100, 30.0, np.maximum(30.0 - 12.0 * (np.arange(300) - 100), 1.0))
    inversion = invert(chain, wanted, STEP)
    assert inversion.status is InverseStatus.WOULD_PUSH
    first = int(np.argmax(inversion.least_tension_N <= 0))
    assert f"asks the tendon to push at t = {first * STEP:.6g} s" in inversion.message
    assert 0.1 <= first * STEP < 0.11
    assert np.isfinite(inversion.force_N).all()


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("engine", [Engine.COMPILED, Engine.CASADI])
def test_a_reference_that_is_not_a_tension_is_refused(generic: Transmission, bad: float, engine: Engine) -> None:
    wanted = np.full(5, 30.0)
    wanted[3] = bad
    with pytest.raises(ParameterError, match=rf"reference_N must be finite and > 0, got {bad} at t = 0\.003 s"):
        invert(Chain.of(generic, Level.ELASTIC), wanted, STEP, engine=engine)


def test_a_step_that_is_not_positive_is_refused(generic: Transmission) -> None:
    with pytest.raises(ParameterError, match="step_s must be a finite number > 0, got -1"):
        invert(Chain.of(generic, Level.ELASTIC), np.full(5, 30.0), -1.0)


@pytest.mark.parametrize("engine", [pytest.param(Engine.COMPILED, marks=pytest.mark.compiler), Engine.CASADI])
def test_of_one_row_the_states_are_those_of_rest(generic: Transmission, engine: Engine) -> None:
    chain = Chain.of(generic, Level.ELASTIC)
    found = invert(chain, np.array([30.0]), STEP, engine=engine, record=True)
    assert found.recorded == pytest.approx(at_rest(chain, 30.0).vector()[None])


def test_states_that_nobody_asked_to_keep_are_refused_by_name(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    kept, lost = (invert(chain, np.full(3, 30.0), 1e-3, record=record) for record in (True, False))
    assert kept.recorded.shape == (3, chain.layout.size)
    with pytest.raises(ParameterError, match="record=True"):
        _ = lost.recorded
