"""Feedback of the tension of one tendon: its loop about the transmission, from the scenario's data."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Inverse, Uncompensated
from tendonff.compensator.compensators.plant import FINE_SEGMENTS
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.feedback.run import design_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.scenario.settings import Feedback
from tendonff.compensator.scenario.unit import NEWTON
from tendonff.models.mechanism import Mechanism
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.feedback.closed_loop import Course
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity, behind_servos
from tendonff.ocp.mechanism.start import mechanism_problem

_SEEN_UNIT = "ln N"
_CYCLES = 3  # of a reference that repeats, of which the last counts
MORE_FRICTION = 0.05  # share by which friction is changed for its shape
_LEAST_OFFSET = 0.01  # of the largest tension, which logarithms need


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionFeedbackTask(FeedbackTask):
    """Feedback of one tension.

    Attributes
    ----------
    problem : Problem
    """

    problem: Problem

    @classmethod
    def of(
        cls, problem: Problem, settings: Feedback, profiles: Mapping[str, Profile], file: str
    ) -> "TensionFeedbackTask":
        """The feedback that a scenario asks for; InputError where it has none."""
        settings.require_tension(file)
        cycles = _CYCLES if problem.reference.periodic else 1
        rows = len(problem.reference.tension_N)
        return cls(
            settings=settings,
            file=file,
            names=("output_tension",),
            unit=NEWTON,
            seen_unit=_SEEN_UNIT,
            command_unit=_SEEN_UNIT,
            doubt=problem.doubt,
            masses=max(FINE_SEGMENTS, 2 * problem.transmission.path.segments),
            feedforward=_course(problem, inverse := profiles["inverse"], cycles, _shape(problem, inverse)),
            alone=_course(problem, profiles.get("none", inverse), cycles),
            scored=slice((cycles - 1) * (rows - 1), None),
            problem=problem,
        )

    @property
    def limit(self) -> float | None:
        """See `FeedbackTask.limit`: of a servo's command the force that it stands for."""
        limit, stiffness = self.settings.limit, self.problem.transmission.actuator.servo_stiffness_N_per_m
        return limit if limit is None or stiffness is None else limit * stiffness

    def system(self, mechanism: Transmission, masses: int | None = None) -> FeedbackSystem:
        """See `FeedbackTask.system`."""
        described, _ = behind_servos(Mechanism.of(mechanism))
        tension_N, motion, load = self.problem.reference.initial_tension_N, mechanism.motion, mechanism.load
        start = {} if motion is None else dict(zip(motion.names, motion.angle_rad[0].tolist(), strict=True))
        if load.joint is None:
            start["load"] = tension_N / load.stiffness_N_per_m
        problem = mechanism_problem(described, self.problem.level, start, segments=masses)
        servo = mechanism.actuator.servo
        return FeedbackSystem(
            problem=problem.starting(np.array([tension_N])),
            quantity=Quantity.TENSION,
            goals=(0,),
            direction=np.ones((1, 1)),
            offset_N=offset_of(self.problem),
            lag_s=servo.servo_time_s,
            drive_delay_s=servo.lag_s(self.problem.reference.step_s, live=True),
        )

    def followed(self, mechanism: Transmission) -> Course:
        """See `FeedbackTask.followed`."""
        own = replace(self.problem, transmission=mechanism, model=None)
        return _course(own, own.answer(Inverse()), 1)


def tension_task(problem: Problem, settings: Feedback, file: str) -> TensionFeedbackTask:
    """The feedback that a scenario asks for, beside the exact inverse; errors as of `TensionFeedbackTask.of`."""
    profiles = {each.name: problem.answer(each) for each in (Inverse(), Uncompensated())}
    return TensionFeedbackTask.of(problem, settings, profiles, file)


def feedback_of(problem: Problem, settings: Feedback, profiles: Mapping[str, Profile], file: str) -> FeedbackResult:
    """Feedback beside the feedforward; arguments and errors as of `TensionFeedbackTask.of`."""
    return design_feedback(TensionFeedbackTask.of(problem, settings, profiles, file))


def _course(problem: Problem, profile: Profile, cycles: int, shape: FloatArray | None = None) -> Course:
    """Reference and forces on the actuator's end; of a cycle several."""
    reference, motion, actuator = problem.reference, problem.transmission.motion, problem.transmission.actuator
    stiffness, step = actuator.servo_stiffness_N_per_m, reference.step_s
    force = actuator.servo.follow(profile.force_N, step)
    command = force
    if stiffness is not None and profile.command_m is not None:
        command = reference.initial_tension_N + stiffness * actuator.servo.follow(profile.command_m, step)

    def repeated(rows: FloatArray) -> FloatArray:
        return np.vstack([*[rows[:-1]] * (cycles - 1), rows])

    joints = np.zeros((len(force), 0)) if motion is None else motion.at(reference.time_s)
    bodies = np.zeros((len(force), 0 if problem.transmission.load.joint is not None else 1))
    known = repeated(np.hstack([bodies, joints]))
    return Course(
        step_s=reference.step_s,
        reference=repeated(reference.tension_N[:, None]),
        command=repeated(command[:, None]),
        known=known,
        effort=np.zeros_like(known),
        force_N=repeated(force[:, None]),
        shape=None if shape is None else repeated(shape[:, None]),
    )


def offset_of(problem: Problem) -> float:
    """Force added to others before their logarithm: friction without load acts like more tension."""
    least = _LEAST_OFFSET * float(np.abs(problem.reference.tension_N).max())
    return max(problem.transmission.friction.adhesion_N, least)


def _shape(problem: Problem, profile: Profile) -> FloatArray:
    """Change of the logarithm of the force with that of all friction, by a second inverse, shape (rows,)."""
    offset = offset_of(problem)
    more = problem.inverse_of(with_numbers(problem.transmission, {"mu": 1 + MORE_FRICTION})).force_N
    found: FloatArray = np.log((more + offset) / (profile.force_N + offset)) / MORE_FRICTION
    return found
