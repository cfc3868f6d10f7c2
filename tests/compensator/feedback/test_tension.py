"""Feedback of one tendon's tension: its loop is the chain, and it lessens what a wrong friction costs."""

from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.feedback.run import design_feedback
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.settings import Feedback
from tendonff.compensator.studies.design.feedback import TensionFeedbackTask
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.feedback.closed_loop import simulate_feedback

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


@pytest.mark.nightly
def test_the_finger_loses_half_of_what_a_wrong_friction_costs(record_property):
    _, _, task = posed("finger")
    found = design_feedback(task)
    both, alone = found.cases["both"], found.cases["feedforward"]
    record_property("figure", f"finger, mu 20 % off: {alone.worst_rms:.2f} N, with feedback {both.worst_rms:.2f} N")
    assert both.worst_rms < 0.5 * alone.worst_rms
    assert both.worst_peak < 1.1 * alone.worst_peak
    assert not found.hunts


def test_another_sensor_is_refused():
    problem, profiles, _ = posed("finger")
    with pytest.raises(InputError, match='needs sensor = "output_tension", got "joint_angle"'):
        TensionFeedbackTask.of(problem, replace(SENSOR, sensor="joint_angle"), profiles, "finger.toml")
