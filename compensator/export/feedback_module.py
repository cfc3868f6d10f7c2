"""The feedback of a task as a module of exported C."""

from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Inverse
from tendonff.compensator.export.feedback import FeedbackModule, JointModule, TensionModule
from tendonff.compensator.export.modules import accepted_steps
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.feedback.tension import MORE_FRICTION, TensionFeedbackTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.feedback.closed_loop import samples_of
from tendonff.ocp.feedback.law import FeedbackLaw
from tendonff.ocp.joint.target import other_joints

_GOLDEN = 300  # samples of the reference that golden vectors follow


def joint_module(task: JointFeedbackTask) -> FeedbackModule:
    """Tune the feedback of a joint."""
    law, every, reference = _tuned(task)
    sampled = task.joint.sampled
    others = sampled.others(task.joint.mechanism.joint.name)
    followed = other_joints((task.joint.problem,))
    direction = task.system(task.doubt.system).direction[:, 0]
    return JointModule(
        law=law,
        every=every,
        reference=tuple(reference.tolist()),
        unit=task.unit.key,
        seen_unit=task.seen_unit,
        command_unit=task.command_unit,
        direction=tuple(direction.tolist()),
        other_rad=tuple(float(others[name][0]) for name in followed),
    )


def tension_module(task: TensionFeedbackTask) -> FeedbackModule:
    """Tune the feedback of a tension; InputError where its samples are no steps of an inverse."""
    most_s = accepted_steps(task.feedforward.step_s)[1]
    if task.sample_s > most_s:
        raise InputError(
            f"{task.file} [feedback]: sample_s = {task.sample_s:g} s is longer than a step of the exported inverse, "
            f"{most_s:g} s; sample more often"
        )
    law, every, reference = _tuned(task)
    stiffness = task.problem.transmission.actuator.servo_stiffness_N_per_m
    followed = _followed(task.problem, reference, law.sample_s)
    changed = with_numbers(followed.transmission, {"mu": 1 + MORE_FRICTION})
    motion = followed.chain.motion
    angles = np.zeros((len(reference), 0)) if motion is None else motion.at(followed.reference.time_s)
    return TensionModule(
        law=law,
        every=every,
        reference=tuple(reference.tolist()),
        unit=task.unit.key,
        seen_unit=task.seen_unit,
        command_unit="N" if stiffness is None else "m",
        force_N=tuple(Inverse().profile(followed).force_N.tolist()),
        more_N=tuple(followed.inverse_of(changed).force_N.tolist()),
        joint_rad=tuple(map(tuple, angles.tolist())),
        offset_N=task.system(task.doubt.system).offset_N,
        more_friction=MORE_FRICTION,
        command_per_N=1.0 if stiffness is None else 1 / stiffness,
    )


def _tuned(task: FeedbackTask) -> tuple[FeedbackLaw, int, FloatArray]:
    """The law, steps in a sample, and the reference at the samples that golden vectors follow."""
    (law,) = tune_feedback(task).design.laws
    every = samples_of(law.sample_s, task.feedforward.step_s)
    return law, every, np.resize(task.feedforward.reference[: every * _GOLDEN : every, 0], _GOLDEN)


def _followed(problem: Problem, reference_N: FloatArray, step_s: float) -> Problem:
    """The problem of a reference that arrives live, with another step."""
    reference = replace(
        problem.reference,
        step_s=step_s,
        time_s=np.arange(len(reference_N), dtype=np.float64) * step_s,
        tension_N=reference_N,
        initial_tension_N=float(reference_N[0]),
        periodic=False,
        position_m=None,
    )
    return replace(problem, reference=reference, live=True, model=None)
