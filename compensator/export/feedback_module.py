"""The feedback of a task as a module of exported C."""

import numpy as np

from tendonff.compensator.export.feedback import FeedbackModule
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.files.reading import InputError
from tendonff.ocp.feedback.closed_loop import samples_of

_GOLDEN = 300  # samples of the reference that golden vectors follow


def feedback_module(task: FeedbackTask) -> FeedbackModule:
    """Tune the feedback of a task with one goal; InputError where it has several."""
    if len(task.names) > 1:
        raise InputError(
            f"{task.file} [feedback]: a module has one goal, this scenario {len(task.names)}; leave it out"
        )
    (law,) = tune_feedback(task).design.laws
    every = samples_of(law.sample_s, task.feedforward.step_s)
    reference = task.feedforward.reference[::every, 0][:_GOLDEN]
    direction = task.system(task.doubt.system).direction[:, 0]
    if not task.system(task.doubt.system).is_led:
        direction = direction / np.abs(direction).max()  # forces of a servo are places of its command
    return FeedbackModule(
        law=law,
        direction=tuple(direction.tolist()),
        start=float(reference[0]),
        reference=tuple(reference.tolist()),
        unit=task.unit.key,
        command_unit=task.command_unit,
    )
