"""Scenarios as `casadi.Opti`: the exact inverse where nothing binds, limits, and what users add."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.optimal import posed, solve
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.integrate.integrate import integrate
from tendonff.ocp.opti.collocation import History, collocate
from tendonff.ocp.opti.tendon import ipopt_options
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.options import Solver, TrackOptions

NOMINAL = TrackOptions(stiffer_weight=0.0)


def finger(examples, name="finger_fast", duration_s=0.3, masses=2):
    scenario = tf.load_scenario(examples / f"{name}.toml")
    path = replace(scenario.transmission.path, segments=masses)
    return replace(
        scenario,
        transmission=replace(scenario.transmission, path=path),
        reference=replace(scenario.reference, duration_s=duration_s, fade_in_s=0.05, frequencies_Hz=(3.0, 5.0)),
        run=replace(scenario.run, step_s=0.005),
        optimal=NOMINAL,
    )


@pytest.fixture(scope="module")
def limited(examples):
    """A reference whose rate limit binds, and its solution."""
    scenario = finger(examples)
    problem = tf.opti(scenario)
    return scenario, problem, problem.solve()


def test_where_no_limit_binds_the_force_is_the_exact_inverse(examples):
    scenario = finger(examples, "finger", duration_s=0.1)
    options = replace(NOMINAL, travel_weight=0.0)
    problem = tf.opti(replace(scenario, optimal=options), smoothing=1e-5)
    answer = problem.solve()
    wanted = np.interp(problem.time_s, *_reference(scenario))
    assert np.abs(answer.value(problem.output_N) - wanted).max() < 1e-3


def test_limits_of_the_actuator_hold_and_bind(limited):
    scenario, problem, answer = limited
    rate = np.abs(np.diff(answer.value(problem.force_N))) / np.diff(problem.time_s)
    most = scenario.transmission.actuator.force_rate_max_N_per_s
    assert most * (1 - 1e-4) < rate.max() <= most * (1 + 1e-6)


def apart(scenario, problem, answer):
    """Cost of an answer over that of the default search, both simulated by the design model."""
    posing = Problem.of(scenario, options=scenario.optimal)
    tracking = posed(posing)
    force = np.interp(posing.reference.time_s, problem.time_s, answer.value(problem.force_N))
    return evaluate(tracking, tracking.clipped(force)).merit / evaluate(tracking, solve(posing).force_N).merit


def test_ipopt_and_sqp_come_to_the_same_cost_where_a_limit_binds(limited):
    assert 0.95 < apart(*limited) < 1.05


def test_ipopt_and_sqp_come_to_the_same_cost_of_a_tendon_without_friction(examples):
    """With effort, so that the best force is not the inverse."""
    scenario = finger(examples, "finger", duration_s=0.2)
    friction = replace(scenario.transmission.friction, mu_dynamic=0.0, mu_static=0.0)
    smooth = replace(
        scenario,
        transmission=replace(scenario.transmission, friction=friction),
        optimal=replace(NOMINAL, effort_weight=1e-2),
    )
    problem = tf.opti(smooth)
    assert 0.95 < apart(smooth, problem, problem.solve()) < 1.05


def test_with_friction_and_no_limit_the_cost_is_that_of_the_exact_inverse(examples):
    """Each by its own discretisation; by that of the other the error of implicit Euler at 5 ms is all there is."""
    scenario = finger(examples, "finger", duration_s=0.2)
    problem = tf.opti(scenario)
    posing = Problem.of(scenario, options=scenario.optimal)
    exact = evaluate(posed(posing), solve(posing).force_N).merit
    assert 0.95 < float(problem.solve().value(problem.cost)[0]) / exact < 1.05


@pytest.mark.nightly
@pytest.mark.parametrize(("effort", "step_s"), [(0.0, 0.002), (1e-2, 0.001)])
def test_ipopt_and_sqp_come_to_the_same_cost_with_friction_and_no_limit(examples, effort, step_s):
    """Simulated, at intervals of one step by polynomials of degree 3; with effort the inverse is not the best force."""
    scenario = finger(examples, "finger", duration_s=0.2)
    optimal = replace(NOMINAL, effort_weight=effort)
    scenario = replace(scenario, optimal=optimal, run=replace(scenario.run, step_s=step_s))
    problem = tf.opti(scenario, interval_s=step_s, degree=3)
    assert 0.95 < apart(scenario, problem, problem.solve()) < 1.05


def test_the_scenario_chooses_the_solver(examples):
    scenario = finger(examples, duration_s=0.2)
    by_sqp = solve(Problem.of(scenario, options=NOMINAL))
    found = solve(Problem.of(scenario, options=replace(NOMINAL, solver=Solver.IPOPT)))
    assert found.status.value == "optimal"
    assert found.rms_error_N < 1.1 * by_sqp.rms_error_N


def test_a_constraint_of_the_user_holds(limited, examples):
    _, free, before = limited
    most = 0.95 * float(before.value(free.tension_N)[:, 1].max())
    problem = tf.opti(finger(examples))
    problem.opti.subject_to(problem.tension_N[1, 1:] <= most)
    middle = problem.solve().value(problem.tension_N)[1:, 1]
    assert most * (1 - 1e-3) < middle.max() <= most * (1 + 1e-6)


def test_a_cost_of_the_user_is_what_is_minimised(limited, examples):
    _, free, before = limited
    problem = tf.opti(finger(examples))
    problem.opti.subject_to(problem.cost <= 2 * before.value(free.cost))
    problem.opti.minimize(ca.sumsqr(problem.force_N) / 1e5)
    force = problem.solve().value(problem.force_N)
    assert np.sum(force**2) < np.sum(before.value(free.force_N) ** 2)


def test_a_problem_without_solution_says_what_the_solver_says(examples):
    problem = tf.opti(finger(examples, duration_s=0.1))
    problem.opti.solver("ipopt", *ipopt_options(iterations=30))
    problem.opti.subject_to(problem.tension_N[1, -1] <= 1.0)
    with pytest.raises(tf.SolveError, match=r"not solved: \w+ after \d+ iterations"):
        problem.solve()


@pytest.mark.parametrize(("degree", "order"), [(1, 1.0), (2, 2.0)])
def test_collocation_converges_and_with_a_higher_degree_faster(examples, degree, order):
    """Without friction's kinks; the second degree's order of 3 ends at the solver's tolerance."""
    transmission = finger(examples).transmission
    smooth = replace(transmission, friction=replace(transmission.friction, mu_dynamic=0.0, mu_static=0.0))
    chain = Chain.of(smooth, tf.Level.PRESLIDING)
    page, start = chain_equations(chain), chain.rest_state(30.0).vector()
    duration = 0.2

    def ends(intervals):
        step = duration / intervals
        force = 30.0 + 5.0 * np.sin(np.pi / 2 / duration * np.arange(intervals + 1.0) * step) ** 2
        inputs = np.column_stack([force, np.zeros((intervals + 1, 3))])
        places = chain.path_at(np.zeros(intervals + 1)).table()
        opti = ca.Opti()
        history = History(inputs=ca.MX(ca.DM(inputs.T)), places=ca.DM(places.T))
        found = collocate(opti, page, step, start, history, (inputs, places), degree=degree, smoothing=1e-9)
        opti.minimize(0)
        opti.solver("ipopt", *ipopt_options())
        exact = integrate(page, start, inputs, step, places=places, rtol=1e-10, atol=1e-13).states[-1]
        # elongations alone: speeds at the corners of the force ring
        rows = chain.layout.part("e")
        return np.abs(np.asarray(opti.solve().value(found.states))[rows, -1] - exact[rows]).max()

    coarse, fine = ends(20), ends(40)
    assert np.log2(coarse / fine) > order - 0.5


def joint(examples, duration_s=0.15):
    scenario = tf.load_scenario(examples / "instrument_pair.toml")
    tendons = tuple(replace(t, path=replace(t.path, segments=2)) for t in scenario.mechanism.tendons)
    return replace(
        scenario,
        mechanism=replace(scenario.mechanism, tendons=tendons),
        reference=replace(scenario.reference, duration_s=duration_s),
    )


def test_a_joint_follows_its_reference_by_its_motors(examples):
    scenario = joint(examples)
    problem = tf.opti(scenario)
    answer = problem.solve()
    task = JointTask.of(scenario)
    motor = answer.value(problem.motor_rad)
    rows = task.time_s
    run = tf.simulate(
        task.problem, np.column_stack([np.interp(rows, problem.time_s, c) for c in motor.T]), scenario.run.step_s
    )
    assert np.abs(run.angle_rad - task.wanted).max() < 0.01 * np.ptp(task.wanted)


def test_the_torque_limit_holds_with_what_a_gear_loses(examples):
    """Of the torque of a gear that passes on half, half of what the tendon takes goes to the gear."""
    scenario, most = joint(examples, duration_s=0.1), 0.028
    drive = replace(scenario.mechanism.drive, gear_efficiency=0.5, torque_max_N_m=most)
    problem = tf.opti(replace(scenario, mechanism=replace(scenario.mechanism, drive=drive)))
    answer = problem.solve()
    held = drive.drum_radius_m[0] * answer.value(problem.tension_N)[1:-1, [0, 3]]
    moving = drive.inertia_kg_m2 * np.diff(answer.value(problem.motor_rad), 2, axis=0) / problem.time_s[1] ** 2
    torque = np.abs(held + moving) + 0.5 * np.abs(held)
    assert most * (1 - 1e-3) < torque.max() <= most * (1 + 1e-5)


def test_a_payload_of_the_user_loads_the_joint(examples):
    """A mass on a spring at the joint; its equations are the user's."""
    problem = tf.opti(joint(examples), payload=True)
    n, h = len(problem.time_s), problem.time_s[1]
    place, speed = problem.opti.variable(n), problem.opti.variable(n)
    torque, inertia = 0.05 * (problem.angle_rad - place), 1e-6
    problem.opti.subject_to(problem.contact_N_m[1:] == torque[1:])
    problem.opti.subject_to(ca.diff(place) == h * speed[1:])
    problem.opti.subject_to(inertia * ca.diff(speed) == h * torque[1:])
    problem.opti.subject_to(place[0] == problem.angle_rad[0])
    problem.opti.subject_to(speed[0] == 0)
    answer = problem.solve()
    carried, moved = answer.value(problem.contact_N_m), answer.value(speed)
    assert np.abs(carried).max() > 0
    assert carried.sum() * h == pytest.approx(inertia * moved[-1], rel=1e-6)  # its momentum


def test_a_payload_of_the_user_loads_the_end_of_a_tendon(examples):
    """A spring like the load's own beside it: the same tension moves the load half as far, but for damping."""
    free, loaded = (tf.opti(finger(examples, "finger", duration_s=0.1), payload=each) for each in (False, True))
    own = tf.load_scenario(examples / "finger.toml").transmission.load.stiffness_N_per_m
    start = float(loaded.opti.value(loaded.load_m[0], loaded.opti.initial()))
    loaded.opti.subject_to(loaded.contact_N[1:] == own * (loaded.load_m[1:] - start))
    moved = [each.solve().value(each.load_m) - start for each in (free, loaded)]
    assert moved[1][-1] == pytest.approx(moved[0][-1] / 2, rel=0.05)


def several(examples):
    scenario = tf.load_scenario(examples / "three_joint_finger.toml")
    tendons = tuple(replace(t, path=replace(t.path, segments=len(t.path.sections))) for t in scenario.mechanism.tendons)
    references = {name: replace(each, duration_s=0.1, fade_in_s=0.05) for name, each in scenario.references.items()}
    return replace(scenario, mechanism=replace(scenario.mechanism, tendons=tendons), references=references)


@pytest.mark.compiler
def test_several_joints_follow_their_references_under_a_bound_of_the_user(examples):
    """The answer is simulated by the compiled step: within 2 % of range after intervals of 10 ms."""
    scenario = several(examples)
    problem = tf.opti(scenario, interval_s=0.01, level=tf.Level.ELASTIC)
    problem.opti.subject_to(ca.vec(problem.tension_N[:, 3:]) >= 4.0)
    answer = problem.solve()
    task = FingerTask.of(scenario, tf.Level.ELASTIC)
    rows, motor = task.sampled.time_s, answer.value(problem.motor_rad)
    run = task.respond(task.finger, np.column_stack([np.interp(rows, problem.time_s, each) for each in motor.T]))
    off = run.position_rad[:, :3] - task.wanted_rad
    assert np.sqrt(np.mean(off**2)) < 0.02 * np.ptp(task.wanted_rad, axis=0).max()
    assert answer.value(problem.tension_N)[3:].min() >= 4.0 - 1e-6


def test_what_it_cannot_pose_is_refused_with_the_way_out(examples):
    with pytest.raises(tf.InputError, match="leave out periodic"):
        tf.opti(tf.load_scenario(examples / "exosuit.toml"))
    with pytest.raises(tf.ParameterError, match="degree must be a whole number"):
        tf.opti(tf.load_scenario(examples / "finger.toml"), degree=0)


def _reference(scenario):
    sampled = tf.sample_reference(scenario)
    return sampled.time_s, sampled.tension_N
