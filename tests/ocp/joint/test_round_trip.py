"""The inverse of a joint against the forward simulation of the same chains."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Arm, DriveKind, LengthTable, Mechanism
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.joint.invert import JointStatus, invert_joint, steady_joint_inverse
from tendonff.ocp.joint.simulate import JointOutcome, simulate_joint
from tendonff.ocp.joint.start import joint_problem, start_tensions
from tests.joint_rig import ANGLE, ARM, STEP, STIFFNESS, TIME, bent, heavier, mechanism, motion, problem

pytestmark = pytest.mark.compiler
LOOP, PAIR = DriveKind.LOOP, DriveKind.PAIR


def tables(rig: Mechanism) -> Mechanism:
    """Lengths that are no straight lines, and whose sum is not constant."""
    q = np.linspace(-1.0, 1.0, 9)
    lengths = (0.2 - 8e-3 * q - 1e-3 * q**2, 0.2 + 8e-3 * q - 0.4e-3 * q**2 + 0.3e-3 * q**3)
    arms = [Arm(joint="q", lengths=LengthTable(angle_rad=q, length_m=length)) for length in lengths]
    return replace(rig, tendons=tuple(replace(t, arms=(arm,)) for t, arm in zip(rig.tendons, arms, strict=True)))


def different(rig: Mechanism) -> Mechanism:
    """Tendons whose laws differ: Stribeck effect and direction in one, a second relaxation in the other."""
    first, second = rig.tendons
    rough = replace(first.friction, mu_static=0.22, mu_dynamic_release=0.15, adhesion_N=0.3)
    slow = replace(
        second.tendon,
        relaxing_stiffness_N_per_m=5e3,
        relaxation_time_s=0.3,
        second_relaxing_stiffness_N_per_m=2e3,
        second_relaxation_time_s=2.0,
    )
    return replace(rig, tendons=(replace(first, friction=rough), replace(second, tendon=slow)))


def rubbing(rig: Mechanism) -> Mechanism:
    """Dry friction and a spring at the joint itself."""
    return replace(rig, joints=(replace(rig.joint, coulomb_N_m=0.01, stiffness_N_m_per_rad=0.05, rest_rad=0.2),))


@pytest.mark.each_value
@pytest.mark.parametrize("change", [lambda rig: rig, bent, tables, different, rubbing])
@pytest.mark.parametrize("kind", [LOOP, PAIR])
@pytest.mark.parametrize("level", [Level.ELASTIC, Level.PRESLIDING])
def test_inverse_then_forward_gives_the_angle_back(change, kind: DriveKind, level: Level) -> None:
    given = problem(change(mechanism(kind)), level)
    found = invert_joint(given, ANGLE, STEP)
    run = simulate_joint(given, found.motor_rad, STEP).require()
    assert found.status is JointStatus.EXACT
    assert run.outcome is JointOutcome.DONE
    assert np.abs(run.angle_rad - ANGLE).max() < 1e-9
    assert np.abs(run.tension_N - found.tension_N).max() < 1e-6
    assert np.abs(found.motor_rad[:, 0] - ANGLE).max() > 0.01  # what friction and lengths ask for


def test_a_loop_costs_two_evaluations_a_step() -> None:
    found = invert_joint(problem(mechanism()), ANGLE, STEP)
    assert found.evaluations / len(ANGLE) < 2.5


def test_torque_on_what_the_joint_touches_is_carried_and_found_again_where_the_joint_is_led() -> None:
    contact = 0.05 * np.sin(2 * np.pi * 0.8 * TIME)
    given = problem(mechanism())
    found = invert_joint(given, ANGLE, STEP, contact_N_m=contact)
    free = simulate_joint(given, found.motor_rad, STEP, contact_N_m=contact).require()
    led = simulate_joint(given, found.motor_rad, STEP, led_rad=ANGLE).require()
    assert np.abs(free.angle_rad - ANGLE).max() < 1e-9
    assert np.abs(led.torque_N_m[1:] - free.torque_N_m[1:]).max() < 1e-7
    assert np.ptp(free.torque_N_m) > 0.05


@pytest.mark.parametrize("adhesion_N", [0.0, 1.5])
def test_a_loop_that_hangs_loose_comes_taut_again_where_the_reference_is(adhesion_N: float) -> None:
    given = problem(heavier(mechanism(tension_N=2.0, adhesion_N=adhesion_N), 0.15))
    found = invert_joint(given, ANGLE, STEP)
    run = simulate_joint(given, found.motor_rad, STEP).require()
    assert found.status is JointStatus.SLACK
    assert "more pretension_N" in found.message
    assert 0.05 < (found.slack_m > 0).mean() < 0.95
    assert np.rad2deg(np.abs(run.angle_rad - ANGLE).max()) < 0.01


def test_a_start_under_load_that_leaves_one_tendon_loose_is_no_jump() -> None:
    """At 0.1 rad, with gravity that one tendon alone carries."""
    rig = mechanism(tension_N=2.0)
    rig = replace(rig, joints=(replace(rig.joint, gravity_N_m=0.2, gravity_zero_rad=-1.0),))
    given = problem(rig)
    tensions, slack_rad = start_tensions(rig, given.start_rad)
    found = invert_joint(given, ANGLE, STEP)
    run = simulate_joint(given, found.motor_rad, STEP).require()
    assert tensions[1] == 0
    assert slack_rad == pytest.approx((tensions[0] - 4.0) / STIFFNESS / ARM)
    assert np.rad2deg(np.abs(run.angle_rad - ANGLE).max()) < 0.03


def test_a_pair_keeps_its_least_tension() -> None:
    found = invert_joint(problem(mechanism(PAIR, 3.0)), ANGLE, STEP)
    assert found.tension_N.min(axis=0) == pytest.approx([3.0, 3.0])
    assert np.ptp(found.tension_N, axis=0).min() > 1


def test_one_tendon_against_a_spring() -> None:
    rig = mechanism(PAIR, 1.0)
    spring = replace(rig.joint, stiffness_N_m_per_rad=0.2, rest_rad=-1.0)
    given = problem(replace(rig, joints=(spring,), tendons=rig.tendons[:1]))
    found = invert_joint(given, ANGLE, STEP)
    assert found.status is JointStatus.EXACT
    assert np.abs(simulate_joint(given, found.motor_rad, STEP).require().angle_rad - ANGLE).max() < 1e-9


def test_a_tendon_that_would_have_to_push_is_told() -> None:
    rig = mechanism(PAIR, 1.0)
    spring = replace(rig.joint, stiffness_N_m_per_rad=0.2, rest_rad=-0.1)
    found = invert_joint(problem(replace(rig, joints=(spring,), tendons=rig.tendons[:1])), ANGLE, STEP)
    assert found.status is JointStatus.WOULD_PUSH
    assert "would have to push" in found.message


def test_chunks_give_what_one_run_gives() -> None:
    given = problem(bent(mechanism()))
    whole = invert_joint(given, ANGLE, STEP)
    first = invert_joint(given, ANGLE[:900], STEP)
    second = invert_joint(given, ANGLE[899:], STEP, memory=first.final)
    assert np.abs(np.vstack([first.motor_rad, second.motor_rad[1:]]) - whole.motor_rad).max() < 1e-9


def test_a_cycle_repeats_in_its_steady_state() -> None:
    cycle = 0.4 * np.sin(2 * np.pi * np.linspace(0, 1, 1001))
    given = joint_problem(mechanism(), Level.PRESLIDING, motion(cycle, np.linspace(0, 1, 1001)))
    found, cycles, steady = steady_joint_inverse(given, cycle, STEP)
    again = invert_joint(given, cycle, STEP, memory=replace_time(found))
    assert steady
    assert cycles < 10
    assert np.abs(again.motor_rad[1:] - found.motor_rad[1:]).max() < 1e-6


def replace_time(found):
    memory = found.final.copy()
    memory.time_s = 0.0
    return memory


def test_the_scheme_is_of_second_order_where_nothing_turns_back() -> None:
    """Motor angle at 0.4 s of a smooth rise, over the step."""
    answers = []
    for step in (4e-3, 2e-3, 1e-3, 2.5e-4):
        time = np.arange(0, 0.4 + step / 2, step)
        rise = 0.5 * (time / 0.4) ** 3
        rig = joint_problem(mechanism(), Level.PRESLIDING, motion(rise, time))
        answers.append(float(invert_joint(rig, rise, step).motor_rad[-1, 0]))
    errors = np.abs(np.array(answers[:-1]) - answers[-1])
    assert errors[0] / errors[1] > 2.5
    assert errors[1] / errors[2] > 2.5


@pytest.mark.parametrize(
    ("arms", "message"),
    [((8e-3, 8e-3), "must pull opposite ways"), ((0.0, -8e-3), "no moment arm")],
)
def test_arms_that_cannot_hold_a_joint_are_refused(arms: tuple[float, float], message: str) -> None:
    rig = mechanism()
    tendons = tuple(replace(t, arms=(Arm(joint="q", moment_arm_m=a),)) for t, a in zip(rig.tendons, arms, strict=True))
    with pytest.raises(ParameterError, match=message):
        problem(replace(rig, tendons=tendons))


def test_bad_numbers_are_refused_by_place() -> None:
    given = problem(mechanism())
    broken = ANGLE.copy()
    broken[7] = math.nan
    with pytest.raises(ParameterError, match=r"angle_rad must be finite, got nan at t = 0.007 s"):
        invert_joint(given, broken, STEP)
    with pytest.raises(ParameterError, match="a run starts at rest there"):
        invert_joint(given, ANGLE + 0.1, STEP)
    with pytest.raises(ParameterError, match="a column for each of 1 motors"):
        simulate_joint(given, np.zeros((4, 2)), STEP)


@pytest.mark.parametrize(
    ("change", "kind", "level"),
    [
        (lambda rig: rig, LOOP, Level.PRESLIDING),
        (bent, LOOP, Level.ELASTIC),
        (tables, PAIR, Level.PRESLIDING),
        pytest.param(different, LOOP, Level.ELASTIC, marks=pytest.mark.nightly),
        pytest.param(rubbing, PAIR, Level.ELASTIC, marks=pytest.mark.nightly),
    ],
)
def test_without_a_compiler_inverse_and_simulation_give_the_same_numbers(change, kind, level: Level) -> None:
    given, rows = problem(change(mechanism(kind)), level), ANGLE[:600:4]
    by_c, by_casadi = (invert_joint(given, rows, STEP, engine=each) for each in (Engine.COMPILED, Engine.CASADI))
    assert by_casadi.status is by_c.status
    assert by_casadi.motor_rad == pytest.approx(by_c.motor_rad, abs=1e-6 * np.ptp(by_c.motor_rad))
    assert by_casadi.tension_N == pytest.approx(by_c.tension_N, abs=1e-5)
    assert by_casadi.final.x[0] == pytest.approx(by_c.final.x[0], abs=1e-5)
    runs = [simulate_joint(given, by_c.motor_rad, STEP, engine=each) for each in (Engine.COMPILED, Engine.CASADI)]
    assert runs[1].angle_rad == pytest.approx(runs[0].angle_rad, abs=2e-6 * np.ptp(rows))
    assert runs[1].final.x[0][1:] == pytest.approx(runs[0].final.x[0][1:], abs=1e-4)


@pytest.mark.parametrize("adhesion_N", [0.0, 1.5])
def test_without_a_compiler_a_tendon_hangs_loose_as_it_does_with_one(adhesion_N: float) -> None:
    given = problem(heavier(mechanism(tension_N=2.0, adhesion_N=adhesion_N), 0.15))
    by_c, by_casadi = (invert_joint(given, ANGLE[::8], STEP, engine=e) for e in (Engine.COMPILED, Engine.CASADI))
    assert by_casadi.status is by_c.status is JointStatus.SLACK
    assert by_casadi.motor_rad == pytest.approx(by_c.motor_rad, abs=1e-6 * np.ptp(by_c.motor_rad))
    assert by_casadi.slack_m == pytest.approx(by_c.slack_m, abs=1e-7)


def test_without_a_compiler_a_tendon_that_would_have_to_push_is_told_too() -> None:
    rig = mechanism(PAIR, 1.0)
    spring = replace(rig.joint, stiffness_N_m_per_rad=0.2, rest_rad=-0.1)
    given = problem(replace(rig, joints=(spring,), tendons=rig.tendons[:1]))
    by_c, by_casadi = (invert_joint(given, ANGLE[::8], STEP, engine=e) for e in (Engine.COMPILED, Engine.CASADI))
    assert by_casadi.status is by_c.status is JointStatus.WOULD_PUSH
    assert by_casadi.lowest_N == pytest.approx(by_c.lowest_N, abs=1e-5)


def test_without_a_compiler_a_run_goes_on_where_the_last_one_ended() -> None:
    given, rows = problem(mechanism()), ANGLE[:81]
    whole = invert_joint(given, rows, STEP, engine=Engine.CASADI)
    half = invert_joint(given, rows[:41], STEP, engine=Engine.CASADI)
    rest = invert_joint(given, rows[40:], STEP, engine=Engine.CASADI, memory=half.final)
    assert rest.motor_rad[-1] == pytest.approx(whole.motor_rad[-1], abs=1e-7)
