"""Feedback of a driven joint: its loop about the mechanism, from the scenario's data."""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.task import verifying_masses
from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.feedback.run import design_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.settings import Feedback
from tendonff.models.joint.description import MOTOR, describe
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.mechanism.sharing import Sharing
from tendonff.ocp.feedback.closed_loop import Course
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity, motors_per_joint
from tendonff.ocp.mechanism.start import mechanism_problem

_CYCLES = 3  # of a reference that repeats, of which the last counts
_BARRIER_N = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFeedbackTask(FeedbackTask):
    """Feedback of one joint.

    Attributes
    ----------
    joint : JointTask
    """

    joint: JointTask

    @classmethod
    def of(cls, task: JointTask, settings: Feedback) -> "JointFeedbackTask":
        """The feedback that a scenario asks for; InputError where it has none."""
        scenario = task.scenario
        file = scenario.source.name
        settings.require_joint(file)
        if scenario.reference.quantity is not JointQuantity.ANGLE:
            raise InputError(f'{file} [feedback]: it is for quantity = "joint_angle", not for a torque; leave it out')
        lead = task.sampled.lead
        rows = len(task.sampled.time_s)
        cycles = _CYCLES if scenario.reference.periodic else 1
        return cls(
            settings=settings,
            file=file,
            names=(task.mechanism.joint.name,),
            unit=task.unit,
            seen_unit=task.unit.key,
            command_unit="rad",
            doubt=task.doubt,
            masses=verifying_masses(task.mechanism),
            feedforward=_course(task, "inverse", cycles),
            alone=_course(task, "linear", cycles),
            scored=slice((cycles - 1) * (rows - 1) or lead, None),
            joint=task,
        )

    def system(self, mechanism: Mechanism, masses: int | None = None) -> FeedbackSystem:
        """See `FeedbackTask.system`."""
        sampled, drive = self.joint.sampled, mechanism.drive
        start = dict(zip(sampled.motion.names, sampled.motion.angle_rad[0].tolist(), strict=True))
        problem = mechanism_problem(
            describe(mechanism, sampled.motion),
            self.joint.level,
            start,
            effort={mechanism.joint.name: float(sampled.contact_N_m[0])},
            pretension_N={MOTOR: drive.pretension_N or 0.0},
            sharing=Sharing(least_tension_N=drive.least_tension_N or 2.0, smooth_N=_BARRIER_N, change_weight=0.0),
            segments=masses,
        )
        return FeedbackSystem(
            problem=problem,
            quantity=Quantity.POSITION,
            goals=(0,),
            direction=motors_per_joint(problem, (0,)),
            lag_s=drive.servo.servo_time_s,
            drive_delay_s=drive.servo.lag_s(self.joint.scenario.run.step_s, live=True),
            play=drive.play_rad,
        )

    def followed(self, mechanism: Mechanism) -> Course:
        """See `FeedbackTask.followed`."""
        return _course(self.joint.with_system(mechanism), "inverse", 1)


def feedback_of(task: JointTask, settings: Feedback) -> FeedbackResult:
    """Feedback beside the feedforward; errors as of `JointFeedbackTask.of`."""
    return design_feedback(JointFeedbackTask.of(task, settings))


def _course(task: JointTask, name: str, cycles: int) -> Course:
    """Reference and commands behind the drive, without the play of its gear; of a cycle several."""
    scenario, sampled = task.scenario, task.sampled
    step, drive = scenario.run.step_s, replace(task.mechanism.drive, backlash_rad=0.0)
    command = driven(drive, task.answer(compensator_of(task, name)), step)
    others = np.column_stack([sampled.angle_rad, *sampled.others(task.mechanism.joint.name).values()])

    def repeated(rows: FloatArray) -> FloatArray:
        return np.vstack([*[rows[:-1]] * (cycles - 1), rows])

    command = repeated(command)
    if cycles > 1:  # from rest: the motor starts where it stands
        rise = np.arange(len(command)) / (0.1 * len(sampled.time_s))
        command = command * np.minimum(rise, 1.0)[:, None]
    known = repeated(others)
    return Course(
        step_s=step,
        reference=repeated(sampled.wanted[:, None]),
        command=command,
        known=known,
        effort=np.hstack([repeated(sampled.contact_N_m[:, None]), np.zeros((len(known), known.shape[1] - 1))]),
    )
