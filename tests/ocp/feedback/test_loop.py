"""The linearised loop, its margins and its simulation, on the joint of the tests."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.mechanism.equations import mechanism_equations
from tendonff.models.mechanism.linearise import MechanismLineariser
from tendonff.ocp.feedback.closed_loop import Course, simulate_feedback
from tendonff.ocp.feedback.design import Sensor, design_loops
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw
from tendonff.ocp.feedback.linear import Branch, branches
from tendonff.ocp.feedback.requirement import Requirement
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity, motors_per_joint, state_of
from tendonff.ocp.feedback.tune import Sampled, as_high_as_allowed, excess, margins_of
from tendonff.ocp.joint.invert import invert_joint
from tendonff.ocp.joint.start import start_tensions
from tendonff.ocp.mechanism.response import simulate_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem
from tests.joint_plant import Plant
from tests.joint_rig import ANGLE, STEP, mechanism, motion, problem, scaled

pytestmark = pytest.mark.compiler
SERVO_S, SAMPLE_S, DELAY_S = 0.02, 0.005, 0.01


def damped(rig):
    """The rig with 10 % of critical damping, as the example of a hand's joint has it."""
    return replace(rig, joints=(replace(rig.joint, damping_N_m_s_per_rad=2e-3),))


RIG = damped(mechanism())
MOTOR = invert_joint(problem(RIG), ANGLE, STEP).motor_rad
COURSE = Course(
    step_s=STEP,
    reference=ANGLE[:, None],
    command=MOTOR,  # the lag of the servo is taken back
    known=np.zeros((len(ANGLE), 1)),
    effort=np.zeros((len(ANGLE), 1)),
)


def system(rig=RIG, masses=None, lag_s=SERVO_S):
    told = mechanism_problem(
        describe(rig, motion()), Level.PRESLIDING, {"q": 0.0}, pretension_N={"motor": 15.0}, segments=masses
    )
    return FeedbackSystem(
        problem=told,
        quantity=Quantity.POSITION,
        goals=(0,),
        direction=motors_per_joint(told, (0,)),
        lag_s=lag_s,
    )


@functools.cache
def designed():
    rigs = [RIG, scaled(RIG, mu=0.8)]
    sensor = Sensor(sample_s=SAMPLE_S, delay_s=DELAY_S)
    return design_loops([system(rig) for rig in rigs], COURSE, sensor, Requirement())


@pytest.mark.parametrize("lag_s", [0.0, SERVO_S])
def test_the_plant_between_two_samples_is_the_matrix_exponential_of_its_linearisation(lag_s):
    told, delay_s = system(lag_s=lag_s), 0.012
    memory = simulate_mechanism(told.problem, MOTOR[:601], STEP).final
    (branch,) = branches(told, [memory], ["sliding"], sticking=[False])
    line = MechanismLineariser(mechanism_equations(told.problem.mechanism, Level.PRESLIDING))
    linear = line.at(state_of(told.problem, memory))
    a, b = linear.a, linear.b[:, [line.signals.inputs.index("motor_rad_per_s")]]
    c = linear.c[[line.signals.outputs.index("q_rad")]]
    if lag_s:
        a = np.block([[a, -b / lag_s], [np.zeros((1, len(a))), -np.eye(1) / lag_s]])
        b, c = np.vstack([b, [[1.0]]]) / lag_s, np.hstack([c, [[0.0]]])
    n = len(a)

    def held(time_s):
        whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, n + 1))]]) * time_s)
        return whole[:n, :n], whole[:n, [n]]

    (step, grown), (part, begun) = held(SAMPLE_S), held(3 * SAMPLE_S - delay_s)
    for w in (3.0, 60.0, 250.0, 500.0):
        z = np.exp(1j * w * SAMPLE_S)
        inside = np.linalg.inv(z * np.eye(n) - step)
        exact = c @ (part @ inside @ grown + begun) if lag_s else c @ part @ inside @ b * (z - 1)
        assert branch.response(np.array([w]), SAMPLE_S, delay_s)[0] == pytest.approx(exact * z**-3, abs=1e-8)


def test_sliding_follows_the_motor_and_sticking_a_fifth_of_it():
    told = system()
    memory = simulate_mechanism(told.problem, MOTOR[:301], STEP).final
    sliding, sticking = (
        abs(b.response(np.array([1.0]), SAMPLE_S, 0.0)[0, 0, 0])
        for b in branches(told, [memory, memory], ["", ""], sticking=[False, True])
    )
    assert sliding == pytest.approx(1.0, abs=0.03)
    assert sticking == pytest.approx(0.21, abs=0.02)


def lag(time_s):
    """A first-order lag as a branch."""
    one = np.ones((1, 1), dtype=np.complex128)
    return Branch(name="lag", poles=np.array([-1 / time_s + 0j]), inputs=one / time_s, outputs=one, jumps=False)


def test_margins_are_those_of_a_closed_form():
    """A held gain K on a lag, a sample late: z (z - e) + K (1 - e) = 0 has |z| = 1 at K = 1/(1 - e)."""
    plant = Sampled.of(lag(0.02), SAMPLE_S, SAMPLE_S)
    law = FeedbackLaw(sample_s=SAMPLE_S, delay_s=SAMPLE_S, proportional=1.0, integral_per_s=0.0)
    found = margins_of(plant.rad_per_s, plant.opened([law], 0))
    assert found.gain == pytest.approx(1 / (1 - math.exp(-SAMPLE_S / 0.02)), rel=1e-3)


def test_gains_are_as_high_as_the_margins_allow():
    plant = Sampled.of(lag(0.02), SAMPLE_S, DELAY_S)
    law = FeedbackLaw(sample_s=SAMPLE_S, delay_s=DELAY_S, proportional=1.0, integral_per_s=20.0)
    (found,) = as_high_as_allowed([plant], [law], Requirement(gain_margin=2.0, phase_margin_deg=45.0))
    margins = margins_of(plant.rad_per_s, plant.opened([found], 0))
    assert excess(plant.opened([found], 0), Requirement()) == pytest.approx(1.0)
    assert margins.gain > 1.99
    assert margins.phase_deg > 44.5
    assert min(margins.gain / 2, margins.phase_deg / 45) < 1.02


def test_a_little_damped_mode_is_given_the_damping_of_friction():
    poles = np.array([-1 + 250j, -1 - 250j, -40 + 0j])
    one = np.ones((3, 1), dtype=np.complex128)
    damped_more = Branch(name="", poles=poles, inputs=one, outputs=one.T, jumps=False).damped(0.1).poles
    assert np.abs(damped_more) == pytest.approx(np.abs(poles))
    assert -damped_more.real / np.abs(damped_more) == pytest.approx([0.1, 0.1, 1.0])


def on_the_plant(rig, law, *, delay_s=DELAY_S, gain=1.0):
    """Error on the independent plant behind a servo, shape (rows,) [deg], and the age that was learned."""
    tensions, _ = start_tensions(rig, 0.0)
    plant = Plant(rig, STEP, 0.0, tensions_N=tensions)
    loop = None if law is None else FeedbackController(law.scaled(gain), 0.0)
    every, follow = round(SAMPLE_S / STEP), 1 - math.exp(-STEP / SERVO_S)
    time, angle, corrected = np.arange(len(ANGLE)) * STEP, [0.0], 0.0
    last = MOTOR[0, 0]
    for row in range(0, len(ANGLE) - every, every):
        seen = np.interp(time[row] - delay_s, time[: row + 1], angle)
        wanted = 0.0 if loop is None else loop.step(float(ANGLE[row]), float(seen))
        chunk = [last]
        for ahead in MOTOR[row + 1 : row + every + 1, 0]:
            corrected += follow * (wanted - corrected)
            chunk.append(ahead + corrected)
        last = chunk[-1]
        angle += plant.turn(np.array(chunk))[:, 0].tolist()
    return np.degrees(np.array(angle) - ANGLE[: len(angle)]), None if loop is None else loop.age_s


def rms(error):
    return float(np.sqrt(np.mean(error**2)))


def test_the_simulated_joint_with_friction_20_percent_low_keeps_within_a_tenth_of_a_degree(record_property):
    """Loop, servo 20 ms, encoder 10 ms old, samples of 5 ms; the feedforward alone 0.27 deg."""
    (law,) = designed().laws
    rig = scaled(RIG, mu=0.8)
    alone, both = on_the_plant(rig, None)[0], on_the_plant(rig, law)[0]
    record_property("figure", f"feedforward {rms(alone):.3f} deg, with feedback {rms(both):.3f}")
    assert rms(alone) > 0.25
    assert rms(both) < 0.09
    assert np.abs(both).max() < 1.1 * np.abs(alone).max()


def test_errors_of_numbers_whose_doubt_is_not_stated_are_learned():
    """Designed for friction; stiffness and pre-tension are off too, which together leave four times the error."""
    (law,) = designed().laws
    rig = scaled(RIG, mu=1.2, stiffness=0.8)
    rig = replace(rig, drive=replace(rig.drive, pretension_N=1.2 * rig.drive.pretension_N))
    alone, both = on_the_plant(rig, None)[0], on_the_plant(rig, law)[0]
    assert rms(alone) > 1.0
    assert rms(both) < 0.2 * rms(alone)
    assert np.abs(both).max() < 1.1 * np.abs(alone).max()


@pytest.mark.parametrize("share", [pytest.param(0.5, marks=pytest.mark.nightly), 1.5])
def test_a_delay_that_is_wrong_by_half_is_learned(share):
    error, age_s = on_the_plant(scaled(RIG, mu=0.8), designed().laws[0], delay_s=share * DELAY_S)
    assert rms(error) < 0.2
    assert age_s == pytest.approx(share * DELAY_S, abs=0.002)


def test_the_simulated_loop_is_that_on_the_independent_plant():
    rig = scaled(RIG, mu=0.8)
    (law,) = designed().laws
    found = simulate_feedback(system(rig, masses=40), [law], COURSE)
    own = np.degrees(found.output[:, 0] - ANGLE)
    assert rms(own) == pytest.approx(rms(on_the_plant(rig, law)[0]), rel=0.05)


def test_all_linearisations_have_the_margins_asked_for():
    found = designed()
    assert found.least_damping == 0.0
    assert found.margins[0].gain > 1.98
    assert found.margins[0].phase_deg > 44.5
