"""Stated margins are those found by simulation: the gain is raised until an independent plant oscillates."""

import numpy as np
import pytest

from benchmarks.feedback_margins import gain_margins, joint_task, phase_margins, tension_task
from tendonff.ocp.feedback.design import LoopDesign, linearised
from tendonff.ocp.feedback.law import FeedbackLaw
from tendonff.ocp.feedback.requirement import Requirement
from tendonff.ocp.feedback.tune import Sampled, as_high_as_allowed, worst_margins

pytestmark = pytest.mark.compiler


def as_designed(task, integral_per_s, samples=2):
    """Gains within the margins over some of the mechanisms, in a given ratio."""
    delay_s, plants = task.settings.delay_s, []
    for number, sample in enumerate(task.doubt.samples[:samples]):
        found = linearised(task.system(sample.system), task.followed(sample.system), f"system {number}")
        plants += [Sampled.of(branch, task.sample_s, delay_s) for branch in found]
    law = FeedbackLaw(
        sample_s=task.sample_s, delay_s=delay_s, proportional=1.0, integral_per_s=integral_per_s, lag_s=0.0
    )
    laws = as_high_as_allowed(plants, [law], Requirement())
    margins = worst_margins(plants, laws)
    return LoopDesign(laws=laws, plants=tuple(plants), growing=(), least_damping=0.0, margins=margins)


@pytest.mark.parametrize("kind", ["tension", "joint"])
def test_the_stated_gain_margin_is_that_of_the_simulation(kind, record_property):
    task = tension_task("surgical", 0.004) if kind == "tension" else joint_task(np.random.default_rng(50), 0)
    stated, found, where = gain_margins(task, as_designed(task, 3.0))
    record_property("figure", f"{kind}: gain margin {stated:.2f}, simulated {found:.2f} ({where})")
    assert found == pytest.approx(stated, rel=0.15)


@pytest.mark.nightly
def test_without_the_stated_phase_margin_a_joint_oscillates_at_its_gain(record_property):
    task = joint_task(np.random.default_rng(50), 0)
    stated, found, where = phase_margins(task, as_designed(task, 25.0))
    record_property("figure", f"phase margin {stated:.0f} deg, without it it oscillates at {found:.2f} times the gain")
    assert found == pytest.approx(1.0, rel=0.15), where
