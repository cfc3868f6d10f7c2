import ctypes
import gc
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.step import c_engine
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Outcome, Simulator, simulate

Array = NDArray[np.float64]
STEP = 1e-3


def with_friction(transmission: Transmission, **values: Any) -> Transmission:
    return replace(transmission, friction=replace(transmission.friction, **values))


def without_stribeck(transmission: Transmission, **values: Any) -> Transmission:
    return with_friction(transmission, mu_static=0.2, mu_static_release=0.15, **values)


def rms(x: Array) -> float:
    return math.sqrt(float(np.mean(np.square(x))))


def percent(error: Array, of: Array) -> float:
    return 100 * rms(error) / float(np.ptp(of))


def wave(time_s: Array) -> Array:
    return 30 + 12 * np.sin(np.pi * time_s) + 5 * np.sin(2.6 * np.pi * time_s)


@pytest.mark.parametrize("n", [1, 6, 40])
@pytest.mark.parametrize("direction", [1, -1])
def test_one_way_slip_has_the_capstan_ratio_for_any_number_of_masses(
    generic: Transmission, n: int, direction: int
) -> None:
    """(T_in + p)/(T_out + p) = e^{+-mu theta} with the coefficient of the direction; b = 0, speed far above omega."""
    rig = with_friction(generic, viscous_N_s_per_m=0.0)
    chain = Chain.of(rig, Level.VISCOELASTIC, n).with_end_stiffness(1e4, 0.0)
    start = chain.rest_state(40.0)
    anchor = start.near_position_m + 40.0 / 1e4  # the near end hangs on a spring whose far side moves steadily
    moving = anchor + direction * 0.5 * STEP * np.arange(4001)
    inputs = ChainInputs.of(4001, near_rest_m=moving, far_force_N=40.0)
    rows = Simulator(chain, STEP, start, inputs[:1]).advance(inputs[1:])
    tension = rows.tension_N[-1] + 0.5
    exponent = 3.1 * (0.2 if direction > 0 else -0.15)
    assert tension[0] / tension[-1] == pytest.approx(math.exp(exponent), rel=1e-9)


@pytest.mark.parametrize("n", [1, 6, 40])
def test_a_stiff_bristle_follows_the_play_law_through_random_reversals(generic: Transmission, n: int) -> None:
    """Slow input, no Stribeck effect: at most 0.2 % of range rms from the exact law of any history."""
    rig = without_stribeck(generic, bristle_stiffness_N_per_m=1e8)
    seconds = 8.0
    time = np.arange(0.0, 8 * seconds, STEP)
    turning = np.concatenate([[30.0], np.random.default_rng(1).uniform(10.0, 120.0, 8)])
    force = np.interp(time, np.arange(9) * seconds, turning)
    expected = CapstanLaw.of(rig).output_history_N(force)
    found = simulate(Chain.of(rig, Level.ELASTIC, n), force, STEP).require().output_tension_N
    assert np.ptp(expected) > 25.0
    assert percent(found - expected, expected) < 0.2


@pytest.mark.parametrize("level", Level)
def test_friction_takes_energy_in_random_motions(generic: Transmission, level: Level) -> None:
    """Work done on every bristle so far is at least what it stores, at every instant."""
    rng = np.random.default_rng(7)
    time = np.arange(0.0, 4.0, 2e-4)
    force = np.interp(time, np.arange(0.0, 4.5, 0.25), np.concatenate([[30.0], rng.uniform(5.0, 90.0, 17)]))
    chain = Chain.of(generic, level, 4)
    states = simulate(chain, force, 2e-4, record=True).require().states
    assert states is not None
    velocity, bristle = states[:, 1:5], states[:, 18:22]
    # Of each step the end counts, as in implicit Euler, for which the bound is exact.
    work = np.cumsum(bristle[1:] * velocity[1:] * 2e-4, axis=0)
    stored = bristle[1:] ** 2 / (2 * chain.friction.bristle_stiffness_N_per_m)
    assert (work - stored).min() > -1e-3 * work[-1].max()
    assert work[-1].max() > 10 * stored.max()


@pytest.mark.parametrize(
    ("level", "reversing", "least_order", "most_percent"),
    [(Level.ELASTIC, False, 1.8, 3e-3), (Level.PRESLIDING, False, 1.7, 1e-3), (Level.ELASTIC, True, 1.6, 0.5)],
)
def test_the_scheme_converges_to_cvodes_with_second_order(
    generic: Transmission, level: Level, reversing: bool, least_order: float, most_percent: float
) -> None:
    """Slope of the rms error over the step; reversals cost some of the order. `most_percent`: of range, at 2 ms."""
    chain = Chain.of(without_stribeck(generic), level)
    fine = 5e-4
    time = np.arange(0.0, 0.8 + fine / 2, fine)
    rise = 10 * (1 - np.cos(np.pi * time / 0.8))
    swing = 15 * np.sin(3 * np.pi * time) * np.sin(np.pi * np.minimum(time / 0.4, 1) / 2) ** 2
    force = 30 + (swing if reversing else rise)
    reference = simulate(chain, force, fine, method=Method.CVODES, rtol=1e-10, atol=1e-12).require().output_tension_N
    every = np.array([16, 8, 4, 2])
    errors = [
        percent(simulate(chain, force[::k], k * fine).require().output_tension_N - reference[::k], reference)
        for k in every
    ]
    order = np.polyfit(np.log(every), np.log(errors), 1)[0]
    assert order > least_order
    assert errors[2] < most_percent


def test_only_the_viscoelastic_link_relaxes_in_a_hold(generic: Transmission) -> None:
    """Both ends pulled apart and held: the tension decays with tau where k2 acts, and stays where it does not."""
    final = {}
    for level in (Level.ELASTIC, Level.VISCOELASTIC):
        chain = Chain.of(without_stribeck(generic), level).with_end_stiffness(1e7, 1e7)
        start = chain.rest_state(30.0)
        anchor = start.near_position_m + 30.0 / 1e7
        inputs = ChainInputs.of(6001, near_rest_m=anchor + np.minimum(np.arange(6001) / 100, 1.0) * 2e-3)
        rows = Simulator(chain, STEP, start, inputs[:1]).advance(inputs[1:])
        held = rows.tension_N[119:, 0]
        final[level] = held[-1]
        if level is Level.ELASTIC:
            assert held == pytest.approx(held[0], rel=1e-3)
        else:
            assert held[-1] < 0.9 * held[0]
            assert (held[400] - held[-1]) / (held[0] - held[-1]) == pytest.approx(math.exp(-1), rel=0.05)
    # What remains is carried by k1 alone in both.
    assert final[Level.VISCOELASTIC] == pytest.approx(final[Level.ELASTIC], rel=0.05)


def test_presliding_smooths_the_reversal(generic: Transmission) -> None:
    """After the force turns, a stiff bristle holds the output and lets it go at a corner; a soft one yields at once."""
    time = np.arange(0.0, 20.0, STEP)
    force = 10 + 80 * np.minimum(time / 10, 2 - time / 10)
    moved = {}
    for level in Level:
        out = simulate(Chain.of(without_stribeck(generic), level), force, STEP).require().output_tension_N
        fall = out[10_000] - out[10_000:]
        # Share of the output's fall that is done after 6 s, four fifths of the force's deadband.
        moved[level] = fall[6_000] / fall[-1]
    assert abs(moved[Level.ELASTIC]) < 1e-3
    assert abs(moved[Level.VISCOELASTIC]) < 1e-3
    assert moved[Level.PRESLIDING] > 0.08


@pytest.mark.parametrize("level", Level)
def test_the_number_of_masses_matters_little(generic: Transmission, level: Level) -> None:
    """Against N = 200, without Stribeck effect: 0.3 % of range rms at N = 6, 0.04 % at N = 40, falling like 1/N."""
    rig = without_stribeck(generic)
    force = wave(np.arange(0.0, 3.0, STEP))
    outputs = {n: simulate(Chain.of(rig, level, n), force, STEP).require().output_tension_N for n in (1, 6, 40, 200)}
    errors = {n: percent(outputs[n] - outputs[200], outputs[200]) for n in (1, 6, 40)}
    assert errors[1] < 2.5
    assert errors[6] < min(0.3, errors[1] / 3)
    assert errors[40] < min(0.04, errors[6] / 4)


def test_elongation_stiffness_and_deadband_are_those_of_the_closed_forms(generic: Transmission) -> None:
    """Slow pull to 90 N and release on N = 100: within 0.2 %, the deadband within 0.7 % (its end is a threshold)."""
    rig = without_stribeck(generic, bristle_stiffness_N_per_m=1e8)
    law, k = CapstanLaw.of(rig), 2e4
    force = np.concatenate([np.linspace(30, 90, 10_000), np.linspace(90, 20, 10_000)])
    run = simulate(Chain.of(rig, Level.ELASTIC, 100), force, STEP).require()
    elongation = run.near_position_m - run.far_position_m
    for row, branch in ((9_990, Branch.PULL), (19_990, Branch.RELEASE)):
        assert elongation[row] == pytest.approx(law.elongation_m(force[row], k, branch), rel=2e-3)
        slope = (force[row] - force[row - 500]) / (elongation[row] - elongation[row - 500])
        assert slope == pytest.approx(law.stiffness_N_per_m(k, branch), rel=2e-3)
    turn = 10_000
    moves = turn + int(np.argmax(run.output_tension_N[turn:] < run.output_tension_N[turn] - 0.02))
    travel = elongation[turn] - elongation[moves]
    assert travel == pytest.approx(law.deadband_m(90.0, k, Branch.PULL), rel=7e-3)


def test_a_slack_tendon_is_reported_and_takes_up_again(generic: Transmission) -> None:
    """The force pushes for half a second: tensions stop at zero, the run says where and when, then follows the law."""
    rig = without_stribeck(generic)
    chain = Chain.of(rig, Level.VISCOELASTIC)
    time = np.arange(0.0, 6.0, STEP)
    force = np.interp(time, [0.0, 0.5, 0.52, 1.0, 1.5, 6.0], [30.0, 30.0, -20.0, -20.0, 60.0, 140.0])
    run = simulate(chain, force, STEP)
    assert run.outcome is Outcome.SLACK
    assert run.message.startswith("link 1 went slack at t = 0.5")
    slack = run.tension_N <= 0
    assert slack[600:900, 0].all()
    assert run.tension_N.min() == 0.0
    assert not slack[2000:].any()
    # Pulled beyond what the impact left in the tendon, it slips as a whole and forgets.
    expected = CapstanLaw.of(rig).largest_output_N(140.0)
    assert run.output_tension_N[-1] == pytest.approx(expected, rel=2e-3)
    assert simulate(chain, force[:500], STEP).outcome is Outcome.DONE


def test_a_very_large_wrap_keeps_the_far_end_still(generic: Transmission) -> None:
    """theta = 20 pi, mu = 0.6, e^37: the force reaches a few elements; the output moves by millinewtons."""
    rig = replace(
        with_friction(
            generic,
            mu_dynamic=0.6,
            mu_static=0.6,
            mu_dynamic_release=0.6,
            mu_static_release=0.6,
            bristle_stiffness_N_per_m=1e9,
        ),
        path=replace(generic.path, total_angle_rad=20 * math.pi),
    )
    n = 100
    force = np.interp(np.arange(0.0, 12.0, STEP), [0.0, 4.0, 8.0, 12.0], [30.0, 150.0, 10.0, 60.0])
    run = simulate(Chain.of(rig, Level.VISCOELASTIC, n), force, STEP).require()
    assert run.outcome is Outcome.DONE
    assert run.output_tension_N == pytest.approx(30.0, abs=0.01)
    profile = CapstanLaw.of(rig).profile_history_N(force, np.arange(n + 1) / n)
    assert percent(run.tension_N - profile, profile) < 1.0
    # Driven slack from a taut start, the tension sinks to e^-37 of it at most near the force; no under- or overflow.
    loose = simulate(Chain.of(rig, Level.VISCOELASTIC, n), np.linspace(30.0, 0.0, 4000), STEP)
    assert np.isfinite(loose.tension_N).all()
    assert loose.tension_N[-1, 0] < 0.1
    assert loose.tension_N[-1, -1] == pytest.approx(30.0, abs=0.01)


@pytest.mark.parametrize(("step", "least_splits", "most_percent"), [(0.01, 2, 0.6), (0.005, 1, 0.25), (0.002, 1, 0.06)])
def test_a_step_that_does_not_converge_is_split_and_comes_out_right(
    generic: Transmission, step: float, least_splits: int, most_percent: float
) -> None:
    """A bristle of 1e9 N/m at steps of milliseconds, nearly slack: splits happen, and the error still falls."""
    rig = without_stribeck(generic, bristle_stiffness_N_per_m=1e9)
    chain = Chain.of(rig, Level.VISCOELASTIC, 4)
    time = np.arange(0.0, 1.5, step)
    force = 30 + 29.9 * np.sin(2 * np.pi * time) * np.minimum(time / 0.2, 1)
    run = simulate(chain, force, step).require()
    assert run.splits >= least_splits
    parts = round(step / 2.5e-5)
    fine_time = np.arange((len(time) - 1) * parts + 1) * (step / parts)
    fine = simulate(chain, np.interp(fine_time, time, force), step / parts).require().output_tension_N[::parts]
    assert percent(run.output_tension_N - fine, fine) < most_percent


def test_a_failed_step_is_reported_with_time_mass_and_balance(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    force = np.full(10, 30.0)
    force[4] = 1e200
    run = simulate(chain, force, STEP)
    assert run.outcome is Outcome.FAILED
    assert len(run.time_s) == len(run.tension_N) == len(run.force_N) == 4
    assert run.tension_N == pytest.approx(np.full((4, 7), 30.0))
    assert "simulation stopped at t = 0.004 s" in run.message
    assert "worst balance" in run.message
    assert " N at the actuator" in run.message
    with pytest.raises(SolveError, match=r"simulation stopped at t = 0\.004 s"):
        run.require()


def test_a_number_that_is_not_finite_stops_the_run_at_its_end_mass(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    inputs = ChainInputs.of(10, near_force_N=30.0, far_force_N=np.where(np.arange(10) == 4, math.nan, 0.0))
    simulator = Simulator(chain, STEP, chain.rest_state(30.0), inputs[:1])
    rows = simulator.advance(inputs)
    assert len(rows.tension_N) == 4
    assert rows.worst_mass == 7
    assert math.isnan(rows.residual_N)
    assert simulator.state.vector() == pytest.approx(chain.rest_state(30.0).vector(), abs=1e-12)


@pytest.mark.parametrize(
    ("force", "step", "message"),
    [
        (np.array([30.0, math.nan]), STEP, r"force_N must be finite, got nan at t = 0\.001 s"),
        (np.zeros((2, 2)), STEP, r"force_N must be a vector with at least one row, got shape \(2, 2\)"),
        (np.array([-1.0, 2.0]), STEP, r"initial_tension_N must be a finite number >= 0, got -1"),
        (np.array([30.0]), 0.0, r"step_s must be a finite number > 0, got 0"),
        (np.array([30.0]), math.nan, r"step_s must be a finite number > 0, got nan"),
    ],
)
def test_unusable_input_is_refused_by_name_and_value(
    generic: Transmission, force: Array, step: float, message: str
) -> None:
    with pytest.raises(ParameterError, match=message):
        simulate(Chain.of(generic, Level.ELASTIC), force, step)


@pytest.mark.parametrize(
    ("engine", "apart_N"),
    [(Engine.CASADI, 1e-9), pytest.param(Engine.COMPILED, 0.0, marks=pytest.mark.compiler)],
)
def test_chunks_join_without_a_seam_and_a_run_can_be_taken_up(
    generic: Transmission, engine: Engine, apart_N: float
) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    force = wave(np.arange(0.0, 1.0, STEP))
    whole = simulate(chain, force, STEP, record=True, engine=engine)
    inputs = ChainInputs.of_force(force)
    simulator = Simulator(chain, STEP, chain.rest_state(30.0), inputs[:1], engine)
    parts = [simulator.advance(inputs[first : first + 137]).tension_N for first in range(1, len(force), 137)]
    assert np.abs(np.vstack(parts) - whole.tension_N[1:]).max() <= apart_N
    # From a state alone the earlier state is gone, so the first step is of first order.
    again = simulate(chain, force[500:], STEP, state=ChainState.from_vector(whole.states[500], chain.layout))
    assert again.output_tension_N == pytest.approx(whole.output_tension_N[500:], abs=5e-3)


@pytest.mark.parametrize("level", Level)
def test_an_ordinary_run_costs_little_more_than_two_back_substitutions_a_step(
    generic: Transmission, level: Level
) -> None:
    run = simulate(Chain.of(generic, level, 40), wave(np.arange(0.0, 2.0, STEP)), STEP).require()
    assert run.iterations < 2.3 * len(run.time_s)
    assert run.splits == 0


@pytest.mark.compiler
def test_an_ordinary_run_makes_one_matrix_a_step(generic: Transmission, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted where the generated code factorises: what makes a step cheap is that only a hard one needs more."""
    head = "static void tff_factorise(int rows, double *lower, double *diag, double *upper, double *middle)\n{"
    source = c_engine._step_source(Chain.of(generic, Level.PRESLIDING, 6))
    assert source.count(head) == 1
    counted = source.replace(head, f"static long made;\nlong tff_made(void) {{ return made; }}\n{head}\n    made++;")
    library = load_library(counted)
    library.tff_run.restype = library.tff_made.restype = ctypes.c_long
    monkeypatch.setattr(c_engine, "_library_of", lambda _chain: library)
    chain = Chain.of(generic, Level.PRESLIDING, 40)
    run = simulate(chain, wave(np.arange(0.0, 2.0, STEP)), STEP, engine=Engine.COMPILED).require()
    assert 0.9 * len(run.time_s) < library.tff_made() < 1.1 * len(run.time_s)
    assert run.iterations > 1.5 * len(run.time_s)


def test_a_thousand_masses_are_as_good_as_two_hundred(generic: Transmission) -> None:
    rig = without_stribeck(generic)
    force = wave(np.arange(0.0, 0.5, STEP))
    many, few = (simulate(Chain.of(rig, Level.PRESLIDING, n), force, STEP).require() for n in (1000, 200))
    assert percent(many.output_tension_N - few.output_tension_N, few.output_tension_N) < 0.03


def test_a_chain_that_no_piece_of_a_step_can_solve_ends_with_a_diagnosis_instead_of_running_on(
    generic: Transmission,
) -> None:
    """Damping of 1e9 N s/m leaves nothing but rounding of the balance: a million pieces would not help."""
    stuck = replace(generic, tendon=replace(generic.tendon, damping_N_s_per_m=1e9))
    time = np.arange(2000) * 1e-3
    run = simulate(Chain.of(stuck, Level.PRESLIDING), 30 + 20 * np.sin(2 * np.pi * time), 1e-3)
    assert run.outcome is Outcome.FAILED
    assert "did not converge although it was split" in run.message


def test_chains_are_not_kept_alive(generic: Transmission) -> None:
    """A batch makes thousands of them."""

    def alive() -> int:
        gc.collect()
        return sum(isinstance(thing, Chain) for thing in gc.get_objects())

    before = alive()
    for k in range(5):
        chain = Chain.of(with_friction(generic, mu_dynamic=0.15 + 0.001 * k), Level.PRESLIDING, 3)
        simulate(chain, np.full(20, 30.0), STEP).require()
        invert(chain, np.full(20, 30.0), STEP)
    del chain
    assert alive() == before
