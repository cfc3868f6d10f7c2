"""Feedback of one tendon's tension: its loop is the chain, and it lessens what a wrong friction costs."""

from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from benchmarks.feedback_tension import DELAY_S, EXAMPLES, Bench, rms
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.feedback.tension import TensionFeedbackTask
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.settings import Feedback
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.feedback.closed_loop import Course, simulate_feedback
from tendonff.ocp.feedback.linear import branches

pytestmark = pytest.mark.compiler
SENSOR = Feedback(sensor="output_tension", delay_s=0.004, sample_s=0.004)


def posed(name):
    scenario = replace(tf.load_scenario(f"examples/{name}.toml"), robust=Uncertainty(mu=0.2, samples=3))
    problem = Problem.of(scenario)
    profiles = {c.name: c.profile(problem) for c in tf.COMPENSATORS if c.name in ("none", "inverse")}
    return problem, profiles, TensionFeedbackTask.of(problem, SENSOR, profiles, f"{name}.toml")


@pytest.mark.parametrize("name", ["finger", "bowden", "surgical"])
def test_without_a_law_the_loop_is_the_plant_of_a_design(name):
    problem, profiles, task = posed(name)
    alone = simulate_feedback(task.system(problem.transmission), (), task.feedforward).output[:, 0]
    known = Plant(problem.transmission, problem.level).respond(profiles["inverse"], problem.reference).output_N
    assert np.abs(alone - known).max() < 1e-8


def test_logarithms_of_force_and_tension_move_alike_whichever_way_the_tendon_slides():
    """In newtons the gain is that of the wrap, e^(-mu theta) = 0.53 when pulled and 1.87 when released."""
    _, _, task = posed("finger")
    system, course, gains = task.system(task.problem.transmission), task.feedforward, []
    for row in (1750, 1250):
        cut = {name: getattr(course, name)[: row + 1] for name in ("reference", "command", "known", "effort")}
        run = simulate_feedback(system, (), Course(step_s=course.step_s, **cut))
        (branch,) = branches(system, [run.final], [""], sticking=[False])
        scaled = branch.scaled(system.moved_per_unit(course.forces_N[row]), system.seen_per_unit(run.output[-1]))
        gains.append([abs(each.response(np.array([1.0]), 0.004, 0.0)[0, 0, 0]) for each in (branch, scaled)])
    assert np.array(gains) == pytest.approx(
        np.array([[np.exp(-0.2 * np.pi), 1.0], [np.exp(0.2 * np.pi), 1.0]]), rel=0.06
    )


@pytest.mark.nightly
@pytest.mark.parametrize("name", EXAMPLES)
def test_both_leave_less_than_two_fifths_of_the_feedforward_s_error(name, record_property):
    """On the independent rig, friction 20 % off either way, the true age half to 1.5 times the stated one."""
    bench = Bench.of(name)
    law = bench.law()
    for factor in (0.8, 1.2):
        alone = bench.error_N({"mu": factor}, None)
        for share in (0.5, 1.0, 1.5):
            both = bench.error_N({"mu": factor}, law, delay_s=share * DELAY_S)
            ratio = rms(both) / rms(alone)
            record_property("figure", f"{name}, mu times {factor}, age times {share}: {ratio:.3f} of the feedforward's")
            assert ratio < 0.4
            assert np.abs(both).max() < 1.1 * np.abs(alone).max()


def test_another_sensor_is_refused():
    problem, profiles, _ = posed("finger")
    with pytest.raises(InputError, match='needs sensor = "output_tension", got "joint_angle"'):
        TensionFeedbackTask.of(problem, replace(SENSOR, sensor="joint_angle"), profiles, "finger.toml")
