"""The observer of a joint on a spring between two motors: its mechanism, driven by the tensions at the drums.

Angles of two motors do not determine such a joint: they share its load as they like. Tensions do, where a spring holds
the joint against them, and each cable's friction keeps the history of both its ends.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus
from tendonff.compensator.observe.mechanism import SPREAD, rubbing
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.ocp.mechanism.problem import MechanismMemory, MechanismProblem, rest
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, simulate_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem
from tendonff.ocp.step.protocol import Array

LONGEST_STEP_S = 0.005
"""Calls further apart are simulated in several steps, as the fits do."""


class PairObserver:
    """The mechanism at the scenario's friction, and at less and more of it."""

    tensions = 2

    def __init__(self, scenario: JointScenario, start: float | None) -> None:
        finger, sampled = problem_of(scenario).by_motor()
        if not finger.joints[0].stiffness_N_m_per_rad > 0:
            raise InputError(
                f"{scenario.source.name}: a pair has two motors that share the load as they like, so their angles do "
                "not determine the joint's, and without a spring (stiffness_N_m_per_rad) tensions do not either; "
                "measure the tensions, and observe each tendon"
            )
        places = {name: float(angle[0]) for name, angle in sampled.motion.by_joint.items()}
        if start is not None:
            places[finger.names[0]] = start
        self.joints: tuple[str, ...] = finger.others
        self.step_s, self.start = scenario.run.step_s, places[finger.names[0]]
        self._geometry = finger.geometry()
        self._windings = np.array([motor.winding_m[0] for motor in finger.motors])
        self._others = np.array([places[name] for name in self.joints])
        motion = replace(sampled.motion, period_s=None)
        try:
            self._problems = [
                mechanism_problem(
                    rubbing(finger, factor).mechanism(motion), Level.PRESLIDING, places, sharing=finger.sharing
                ).forced()
                for factor in (1.0, 1 - SPREAD, 1 + SPREAD)
            ]
        except ParameterError as error:
            raise InputError(f"{scenario.source.name}: {error}") from None
        self._memories: list[MechanismMemory] = []
        self._tension, self._step = np.zeros(len(self._windings)), self.step_s
        self._last = Observation(angle_rad=Estimate(value=self.start, low=self.start, high=self.start))
        self.status: tuple[ObserverStatus, ...] = ()

    def step(self, dt: float, tension_N: Sequence[float], _second: float, others: Sequence[float]) -> Observation:
        """Advance; the last answer is held where a tension is no number."""
        tension = np.asarray(tension_N, dtype=np.float64)
        if not np.isfinite(tension).all():
            self.status = (ObserverStatus.INPUT_HELD,)
            return self._last
        if not self._memories:
            self._memories = [rest(problem.starting(tension)) for problem in self._problems]
            self._tension = tension
        self._others[: len(others)] = others
        parts = max(1, math.ceil(dt / LONGEST_STEP_S * (1 - 1e-9)))
        rows = [
            self._advanced(*each, tension, dt / parts, parts)
            for each in zip(self._problems, self._memories, strict=True)
        ]
        self._tension, self._step = tension, dt / parts
        if any(len(row.position) <= parts for row in rows):
            self.status = (ObserverStatus.FAILED,)
            return self._last
        self._memories = [row.final for row in rows]
        self.status = (ObserverStatus.SLACK,) if any(r.status is MechanismStatus.SLACK for r in rows) else ()
        angles = [float(row.position[-1, 0]) for row in rows]
        arms = self._geometry.moment_arm_m(np.array(angles)[:, None])[:, :, 0]
        torques = [float(arm @ row.tension_N[-1]) for arm, row in zip(arms, rows, strict=True)]
        self._last = Observation(angle_rad=_enclosed(angles), torque_N_m=_enclosed(torques))
        return self._last

    def _advanced(
        self, problem: MechanismProblem, memory: MechanismMemory, tension: Array, step_s: float, parts: int
    ) -> MechanismRun:
        """The mechanism after some steps, tensions straight between two samples."""
        share = np.arange(parts + 1)[:, None] / parts
        known = np.tile(np.concatenate([problem.start[: problem.driven], self._others]), (parts + 1, 1))
        before = memory.copy()
        for old, now in (*zip(before.x_old, before.x, strict=True), (before.z_old, before.z)):
            old[...] = now - (now - old) * (step_s / self._step)  # the step before, as long as those that follow
        held = (self._tension + share * (tension - self._tension)) * self._windings
        return simulate_mechanism(problem, held, step_s, known=known, memory=before)


def _enclosed(values: Sequence[float]) -> Estimate:
    return Estimate(value=values[0], low=min(values), high=max(values))
