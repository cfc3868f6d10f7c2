"""python-control's view of the chain against the chain itself."""

import control
import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.mechanism.interop import as_iosystem, linear_system, output_names
from tendonff.models.mechanism.linearise import Lineariser
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate

START_N = 30.0


@pytest.fixture(scope="module")
def chain(generic):
    return Chain.of(generic, Level.PRESLIDING, 3)


def test_the_iosystem_answers_a_force_as_the_simulator_does(generic):
    """An independent implicit Runge-Kutta method on the continuous equations, through a reversal."""
    time = np.arange(0, 0.2, 5e-4)
    force = START_N + 20 * np.sin(2 * np.pi * 5 * time)
    chain = Chain.of(generic, Level.PRESLIDING, 2)
    response = control.input_output_response(
        as_iosystem(chain),
        time,
        force,
        chain.rest_state(START_N).vector(),
        solve_ivp_method="Radau",
        solve_ivp_kwargs={"rtol": 1e-5, "atol": 1e-8},
    )
    played = simulate(chain, force, 5e-4)
    assert response.output_labels == list(output_names(chain))
    outputs = np.asarray(response.outputs)
    error_N = np.abs(outputs[:3].T - played.tension_N).max()
    assert error_N < 0.02 * np.ptp(played.output_tension_N)
    assert np.abs(outputs[-1] - played.far_position_m).max() < 0.02 * np.ptp(played.far_position_m)


def test_both_ends_are_inputs_on_request(generic, chain):
    system = as_iosystem(chain, both_ends=True)
    assert system.input_labels == ["force_N", "actuator_rest_position_m", "load_force_N", "load_rest_position_m"]
    x = chain.rest_state(START_N).vector()
    at_rest = system.dynamics(0, x, [START_N, 0, 0, 0])
    assert at_rest == pytest.approx(np.zeros(len(x)), abs=1e-9)
    released = system.dynamics(0, x, [START_N, 0, 1.0, 0])  # f_c2 pulls the load away from the actuator
    assert released[chain.count + 1] == pytest.approx(-1 / generic.load.mass_kg)


@pytest.mark.parametrize("level", list(Level))
def test_the_linear_system_is_the_slope_of_the_nonlinear_one(generic, level):
    """Central differences at a sliding state, where the signs of the velocities count."""
    chain = Chain.of(generic, level, 3)
    force = START_N + 200 * np.arange(0, 0.1, 1e-3)
    state = simulate(chain, force, 1e-3).final
    linear, whole = linear_system(chain, state), as_iosystem(chain)
    x, names = state.vector(), chain.layout.names
    direction = np.zeros(len(x))
    direction[names.index("v_1")] = 1e-6 * abs(x[names.index("v_1")])
    slope = (whole.dynamics(0, x + direction, [0.0]) - whole.dynamics(0, x - direction, [0.0])) / 2
    kept = [names.index(name) for name in linear.state_labels]
    assert linear.A @ direction[kept] == pytest.approx(slope[kept], rel=1e-5, abs=1e-9 * np.abs(slope).max())


def test_a_sticking_tendon_is_a_row_of_springs(generic, chain):
    """Gain at rest, frequency zero: springs k1 N, 2 k1 N at the ends, between bristles sigma0/N, against the load's."""
    elements = chain.elements
    sigma, n = elements.friction.bristle_stiffness_N_per_m, chain.count
    k = elements.link.stiffness_N_per_m * np.array([2 * n, *[n] * (n - 1), 2 * n])
    between = np.concatenate([k, [generic.load.stiffness_N_per_m]]) + np.concatenate([[0.0], k])
    stiffness = np.diag(between + np.array([0, *[sigma] * n, 0])) - np.diag(k, 1) - np.diag(k, -1)
    positions = np.linalg.solve(stiffness, np.eye(n + 2)[0])  # one newton at the actuator
    gain = control.dcgain(linear_system(chain, chain.rest_state(START_N))).ravel()
    assert gain[:-2] == pytest.approx(k * -np.diff(positions), rel=1e-9)
    assert gain[-2:] == pytest.approx(positions[[0, -1]], rel=1e-9)


def test_the_linear_system_is_stable_and_small_steps_agree_with_the_simulator(chain):
    linear = linear_system(chain, chain.rest_state(START_N))
    assert linear.nstates == 3 * chain.count + 5
    assert np.all(linear.poles().real < 0)
    time = np.arange(0, 0.1, 1e-4)
    small = 1e-4 * np.sin(2 * np.pi * 20 * time)
    played = simulate(chain, START_N + small, 1e-4).output_tension_N - START_N
    expected = np.asarray(control.forced_response(linear, time, small).outputs[chain.count])
    assert played == pytest.approx(expected, abs=0.01 * np.abs(expected).max())


def test_the_response_over_frequency_is_that_of_the_linear_system(generic: Transmission) -> None:
    """Against python-control's own evaluation, tension and positions of all outputs."""
    chain = Chain.of(generic, Level.PRESLIDING)
    state = chain.rest_state(30.0)
    s = 2j * np.pi * np.geomspace(0.1, 1000, 30)
    expected = np.stack([np.asarray(linear_system(chain, state)(each)).ravel() for each in s])
    found = Lineariser(chain).at(state).response(s)
    assert found.shape == (30, chain.count + 3)
    assert np.abs(found / expected - 1).max() < 1e-6
