"""The feedback of a task as a module of exported C."""

import numpy as np

from tendonff.compensator.export.feedback import FeedbackModule, JointModule, TensionModule
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.feedback.tension import MORE_FRICTION, TensionFeedbackTask
from tendonff.ocp.feedback.closed_loop import samples_of
from tendonff.ocp.feedback.law import FeedbackLaw

_GOLDEN = 300  # samples of the reference that golden vectors follow


def joint_module(task: JointFeedbackTask) -> FeedbackModule:
    """Tune the feedback of a joint."""
    law, every = _tuned(task)
    direction = task.system(task.doubt.system).direction[:, 0]
    return JointModule(
        law=law,
        reference=tuple(task.feedforward.reference[every, 0].tolist()),
        unit=task.unit.key,
        command_unit=task.command_unit,
        direction=tuple(direction.tolist()),
    )


def tension_module(task: TensionFeedbackTask) -> FeedbackModule:
    """Tune the feedback of a tension."""
    law, every = _tuned(task)
    stiffness = task.problem.transmission.actuator.servo_stiffness_N_per_m
    offset = task.system(task.doubt.system).offset_N
    force, shape = task.feedforward.forces_N[every, 0], task.feedforward.shapes[every, 0]
    return TensionModule(
        law=law,
        reference=tuple(task.feedforward.reference[every, 0].tolist()),
        unit=task.unit.key,
        command_unit=task.command_unit,
        force_N=tuple(force.tolist()),
        more_N=tuple(((force + offset) * np.exp(MORE_FRICTION * shape) - offset).tolist()),
        offset_N=offset,
        more_friction=MORE_FRICTION,
        command_per_N=1.0 if stiffness is None else 1 / stiffness,
        added_unit="N" if stiffness is None else "m",
    )


def _tuned(task: FeedbackTask) -> tuple[FeedbackLaw, slice]:
    """The law, and the rows of the samples that golden vectors follow."""
    (law,) = tune_feedback(task).design.laws
    every = samples_of(law.sample_s, task.feedforward.step_s)
    return law, slice(0, every * _GOLDEN, every)
