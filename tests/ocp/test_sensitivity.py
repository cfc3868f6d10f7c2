from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import whole_of
from tendonff.ocp.codegen.compiler import find_compiler
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.sensitivity import Parameter, force_sensitivity, parameter_sensitivity
from tendonff.ocp.tendon.simulate import simulate

Array = NDArray[np.float64]
STEP = 1e-3
ROWS = 600


def force() -> Array:
    time = np.arange(ROWS) * STEP
    return 30 + 15 * np.sin(2 * np.pi * 2.3 * time) * np.minimum(time / 0.1, 1)


def knots() -> NDArray[np.int_]:
    return np.array([0, 40, 90, 200, 350, 351, 480, ROWS - 1])


@pytest.mark.parametrize("level", [Level.VISCOELASTIC, Level.PRESLIDING])
def test_force_sensitivity_is_the_slope_of_central_differences(generic: Transmission, level: Level) -> None:
    chain = Chain.of(generic, level, 3)
    start = chain.rest_state(30.0)
    found = force_sensitivity(chain, force(), STEP, knots(), state=start, all_links=True)
    plain = simulate(chain, force(), STEP, state=start).require()
    assert np.array_equal(found.tension_N, plain.tension_N)
    assert found.tension_slopes.shape == (ROWS, 4, len(knots()))
    delta = 1e-5
    for k in range(len(knots())):
        unit = np.zeros(len(knots()))
        unit[k] = delta
        change = np.interp(np.arange(ROWS), knots(), unit)
        up, down = (simulate(chain, force() + sign * change, STEP, state=start).require().tension_N for sign in (1, -1))
        slope = (up - down)[1:] / (2 * delta)
        assert np.abs(slope).max() > 1e-3
        # A difference across a reversal mixes two branches, so a few rows differ.
        error = np.abs(found.tension_slopes[1:, :, k] - slope) / np.abs(slope).max()
        assert np.quantile(error, 0.98) < 1e-4
        assert error.max() < 0.05
    output = force_sensitivity(chain, force(), STEP, knots(), state=start)
    assert np.array_equal(output.tension_slopes[:, 0, :], found.tension_slopes[:, -1, :])


def test_knots_are_forgotten_from_their_rows_on_and_nothing_else_is(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING, 3)
    start, rows = chain.rest_state(30.0), np.arange(0, ROWS + 1, 24)
    rows[-1] = ROWS - 1
    whole = force_sensitivity(chain, force(), STEP, rows, state=start).tension_slopes[:, 0, :]
    wiped = rows + 24 * np.where(rows < 100, 3, 6)
    short = force_sensitivity(chain, force(), STEP, rows, state=start, wiped_rows=wiped).tension_slopes[:, 0, :]
    kept = np.arange(ROWS)[:, None] < wiped
    assert short[kept] == pytest.approx(whole[kept], rel=1e-9, abs=1e-12)
    assert np.all(short[~kept] == 0)
    assert np.abs(whole[~kept]).max() > 1e-6


@pytest.mark.parametrize("parameter", Parameter)
def test_parameter_sensitivity_is_the_slope_of_central_differences(generic: Transmission, parameter: Parameter) -> None:
    generic = polymer(generic) if parameter is Parameter.LOAD_EXPONENT else generic
    whole = whole_of(generic, Level.PRESLIDING)
    chain = Chain.of(generic, Level.PRESLIDING, 3)
    found = parameter_sensitivity(
        whole, chain, force(), STEP, [{parameter: 1.0}], initial_tension_N=30.0, all_links=True
    )
    assert found.ends_slopes is not None
    value = whole.value(parameter.value)
    delta = 1e-6 * value
    runs = []
    for sign in (1, -1):
        moved = whole.changed({parameter.value: value + sign * delta}).divided(3)
        runs.append(simulate(replace(chain, elements=moved), force(), STEP, initial_tension_N=30.0).require())
    slope = (runs[0].tension_N - runs[1].tension_N) / (2 * delta)
    error = np.abs(found.tension_slopes[..., 0] - slope) / np.abs(slope).max()
    # A difference that straddles a reversal mixes two branches, so a few rows differ.
    assert np.quantile(error, 0.98) < 1e-4
    assert error.max() < 0.02
    near = (runs[0].near_position_m - runs[1].near_position_m) / (2 * delta)
    assert np.quantile(np.abs(found.ends_slopes[:, 0, 0] - near) / np.abs(near).max(), 0.98) < 1e-4


def test_without_a_stribeck_effect_slopes_along_both_coefficients_are_the_sum_of_those_along_each(
    generic: Transmission,
) -> None:
    mu = generic.friction.mu_dynamic
    generic = replace(generic, friction=replace(generic.friction, mu_static=mu, mu_static_release=None))
    chain, whole = Chain.of(generic, Level.PRESLIDING, 3), whole_of(generic, Level.PRESLIDING)
    assert chain.friction.aliases()
    moving, sticking = {Parameter.MU_DYNAMIC_PULL: 1.0}, {Parameter.MU_STATIC_PULL: 1.0}
    along = [
        parameter_sensitivity(whole, chain, force(), STEP, over, initial_tension_N=30.0).tension_slopes[:, 0]
        for over in ([moving | sticking], [moving, sticking])
    ]
    share = np.abs(along[1]).max(axis=0)
    assert (share > 0.01 * share.sum()).all()
    assert along[0][:, 0] == pytest.approx(along[1].sum(axis=1), abs=1e-9 * share.sum())


def test_knots_that_do_not_span_the_force_are_refused(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING, 3)
    for rows in ([0, 100], [5, ROWS - 1], [0, 50, 50, ROWS - 1]):
        with pytest.raises(ParameterError, match=f"knot_rows must rise strictly from 0 to {ROWS - 1}"):
            force_sensitivity(chain, force(), STEP, np.array(rows), state=chain.rest_state(30.0))


def test_a_run_that_fails_says_when(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING, 3)
    broken = force()
    broken[50] = 1e200
    with pytest.raises(SolveError, match=r"simulation stopped at t = 0\.05 s"):
        force_sensitivity(chain, broken, STEP, knots(), state=chain.rest_state(30.0))


@pytest.mark.each_value
@pytest.mark.parametrize("level", list(Level))
@pytest.mark.parametrize("kept_rows", [None, 40])
def test_without_a_compiler_the_slopes_over_forces_are_the_same(
    generic: Transmission, level: Level, kept_rows: int | None
) -> None:
    chain = Chain.of(generic, level, 3)
    start, wiped = chain.rest_state(30.0), None if kept_rows is None else knots() + kept_rows
    ours, theirs = (
        force_sensitivity(chain, force(), STEP, knots(), state=start, all_links=True, wiped_rows=wiped, engine=engine)
        for engine in compiled_and_casadi()
    )
    assert theirs.tension_slopes == pytest.approx(ours.tension_slopes, abs=1e-9)
    assert theirs.tension_N == pytest.approx(ours.tension_N, abs=1e-9)


def test_without_a_compiler_the_slopes_over_parameters_are_the_same(generic: Transmission) -> None:
    generic = polymer(generic)
    chain, whole = Chain.of(generic, Level.PRESLIDING, 3), whole_of(generic, Level.PRESLIDING)
    ours, theirs = (
        parameter_sensitivity(
            whole,
            chain,
            force(),
            STEP,
            [{name: 1.0} for name in Parameter],
            initial_tension_N=30.0,
            all_links=True,
            engine=engine,
        )
        for engine in compiled_and_casadi()
    )
    scale = np.abs(ours.tension_slopes).max(axis=(0, 1))
    assert (scale > 0).all()
    assert theirs.tension_slopes / scale == pytest.approx(ours.tension_slopes / scale, abs=1e-9)
    assert theirs.ends_slopes == pytest.approx(ours.ends_slopes, abs=1e-9 * np.abs(ours.ends_slopes).max())


def polymer(transmission: Transmission) -> Transmission:
    """The same with friction that falls with the load."""
    return replace(transmission, friction=replace(transmission.friction, load_exponent=0.15, reference_tension_N=30.0))


def compiled_and_casadi() -> tuple[Engine, Engine]:
    if find_compiler() is None:
        pytest.skip("no C compiler to compare with")
    return Engine.COMPILED, Engine.CASADI
