"""The mechanism as a law: torques of its motors and angles of its joints from the motors' angles, fitted to logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.joint.mechanism_law import stepped, widened
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.motors.numbers import START, Number, put_into
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.path import JointMotion
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Blocks, Residuals, Solution, block_covariance, solve
from tendonff.ocp.fits.mechanism import MotorRun, differences
from tendonff.ocp.mechanism.response import MechanismRun, simulate_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem

TORQUE_SHARE, JOINT_RAD = 0.008, 2e-3
"""Residuals count linearly beyond this share of a torque's range, and beyond this angle of a joint."""

STEP = 5e-3
"""Difference that slopes are taken over, in usual steps of a search."""

BLOCK_S = 0.5
"""Rows so far apart are taken as independent: about a reversal."""

TURNING_SHARE, SLIDES = 0.02, 0.7

EFFECT_SHARE = 0.1
"""An effect that the law lacks is tried with this share of each tendon's stiffness, or of the tension at the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """Response of a mechanism in a log."""

    torque_N_m: Array  # shape (rows, motors)
    angle_rad: Array  # shape (rows, joints)
    run: MechanismRun


@dataclass(frozen=True, slots=True, kw_only=True)
class Lacking:
    """An effect of all tendons that a law lacks.

    Attributes
    ----------
    name : str
    gain : float
        Gain of log-likelihood that it promises; 0 where it would have to be negative.
    shift : ndarray, shape (k,)
        By which the values would change.
    """

    name: str
    gain: float
    shift: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorsLaw:
    """A mechanism with numbers to find.

    Parameters
    ----------
    finger : Finger
        Where all other numbers come from.
    logs : sequence of MotorsLog
    numbers : tuple of Number
    segments, refinement : int
        Masses of each tendon, and steps in one row.
    """

    finger: Finger
    logs: Sequence[MotorsLog]
    numbers: tuple[Number, ...]
    segments: int
    refinement: int = 1

    def predict(self, log: MotorsLog, values: Mapping[str, float]) -> Predicted:
        """Simulate a log; SolveError or ParameterError where it cannot be."""
        finger = put_into(self.finger, values)
        count, parts = len(log.motor_rad), self.refinement
        start = dict(zip(finger.names, log.start_rad.tolist(), strict=True))
        spans = self._spans(log)
        motion = JointMotion(names=finger.names, time_s=np.arange(3.0), angle_rad=spans)
        mechanism, tension = finger.mechanism(motion), {}
        loops = {m.body: m.drive.pretension_N or 0.0 for m in finger.motors if len(m.winds) > 1}
        problem = mechanism_problem(
            mechanism, Level.PRESLIDING, start, pretension_N=loops, sharing=finger.sharing, segments=self.segments
        )
        own = problem.tension_N.copy()
        for k, tendon in enumerate(finger.tendons):
            tension[tendon.name] = values.get(f"{START}.{log.name}.{tendon.name}", own[k])
        problem = problem.starting(np.array([tension[tendon.name] for tendon in finger.tendons]))
        rows = np.arange((count - 1) * parts + 1) / parts
        led = np.column_stack([np.interp(rows, np.arange(count), column) for column in log.motor_rad.T])
        run = simulate_mechanism(problem, led, log.step_s / parts)
        held = _whole(run.effort, len(led))[::parts]
        angle = _whole(run.position, len(led))[::parts]
        torque = np.column_stack(
            [
                motor.drive.torque_N_m(held[:, k], turning.acceleration_rad_per_s2, turning.way())
                for k, motor in enumerate(finger.motors)
                for turning in (MotorRun(motor_rad=log.motor_rad[:, k], step_s=log.step_s, start_rad=0.0),)
            ]
        )
        return Predicted(torque_N_m=torque, angle_rad=angle[:, : len(finger.joints)], run=run)

    def _spans(self, log: MotorsLog) -> Array:
        """Angles of the joints that decide which sections get masses, shape (3, joints)."""
        lengths = np.where(np.isfinite(log.joint_rad), log.joint_rad, log.start_rad)
        return np.vstack([log.start_rad, lengths.min(axis=0) - _ROOM_RAD, lengths.max(axis=0) + _ROOM_RAD])

    def errors(self, log: MotorsLog, found: Predicted) -> tuple[Array, Array]:
        """Predicted less measured torques, and angles with no zero of the encoders; NaN where there is none."""
        angle = found.angle_rad - log.joint_rad
        angle = angle - angle[log.counted].mean(axis=0)
        return found.torque_N_m - log.torque_N_m, angle

    def _weighted(self, values: Mapping[str, float]) -> Array:
        """Residuals in units of their expected size, then those of what is known before."""
        parts = []
        for log in self.logs:
            torque, angle = self.errors(log, self.predict(log, values))
            size = np.maximum(log.noise_N_m, TORQUE_SHARE * np.ptp(log.torque_N_m, axis=0))
            parts.append((torque[log.counted] / size).T.ravel())
            parts.append((angle[log.counted][:, log.encoders] / JOINT_RAD).T.ravel())
        known = [n for n in self.numbers if n.prior]
        return np.concatenate([*parts, np.array([np.log(values[n.key] / n.start) / n.prior for n in known])])

    def _labels(self, rows: int) -> tuple[Blocks, Blocks]:
        """Blocks of rows that may be correlated, and kinds of rows: channel, turning or sliding, either way."""
        blocks, kinds, first, channel = [], [], 0, 0
        for log in self.logs:
            own = first + (log.time_s[log.counted] / BLOCK_S).astype(int)
            first = int(own[-1]) + 1
            ways = [
                MotorRun(motor_rad=angle, step_s=log.step_s, start_rad=0.0).way(
                    max(TURNING_SHARE * np.ptp(angle), 1e-9)
                )
                for angle in log.motor_rad.T
            ]
            of_channels = [*ways, *[ways[0]] * int(log.encoders.sum())]
            for way in of_channels:
                kind = 2 * (np.abs(way) > SLIDES) + (way > 0)
                kinds.append(4 * channel + kind[log.counted])
                blocks.append(own)
                channel += 1
        block, kind = np.concatenate(blocks), np.concatenate(kinds).astype(int)
        more = rows - len(block)
        return np.concatenate([block, first + np.arange(more)]), np.concatenate([kind, np.full(more, 4 * channel)])

    def fit(self, start: Mapping[str, float], *, most: int) -> Solution:
        """Least squares over all numbers; SolveError where the start has no answer."""
        by_key = {n.key: n for n in self.numbers}

        def vector(values: Mapping[str, float]) -> Array:
            return self._weighted({key: values[key] for key in by_key})

        def evaluate(values: Mapping[str, float]) -> Residuals:
            at = np.array([values[key] for key in by_key])
            steps = [STEP * n.step * (values[key] if n.logarithmic else 1.0) for key, n in by_key.items()]
            residuals, slopes = differences(
                lambda x: self._weighted(dict(zip(by_key, x.tolist(), strict=True))), at, steps
            )
            return Residuals(values=residuals, slopes=slopes, blocks=self._labels(len(residuals))[0])

        unknowns = [replace(n, start=start[key]).unknown for key, n in by_key.items()]
        try:
            return solve(evaluate, unknowns, values=vector, most=most, tolerance=1e-4)
        except ParameterError as error:
            raise SolveError(str(error)) from None

    def lacking(self, solution: Solution) -> tuple[Lacking, ...]:
        """Effects that would explain the logs, by a Gauss-Newton step from a solution."""
        residuals, found = solution.residuals, []
        size = [v for key, v in solution.values.items() if key.startswith(f"{START}.") or key.endswith(".pretension_N")]
        tension = EFFECT_SHARE * float(np.mean(size)) if size else 1.0
        finger, own = put_into(self.finger, solution.values), len(solution.values)
        relaxing, sticking = dict[str, float](), dict[str, float]()
        for each in finger.tendons:
            place, stiffness = f"tendons.{each.name}", EFFECT_SHARE * each.tendon.stiffness_N_per_m
            relaxing[f"{place}.tendon.relaxing_stiffness_N_per_m"] = each.tendon.relaxing_stiffness_N_per_m + stiffness
            sticking[f"{place}.friction.adhesion_N"] = each.friction.adhesion_N + tension
        for name, extra in (("stress relaxation", relaxing), ("load-independent friction", sticking)):
            column = self._weighted({**solution.values, **extra}) - residuals.values
            wider = replace(residuals, slopes=np.column_stack([residuals.slopes, column]))
            before, _ = stepped(wider, list(range(own)))
            left, steps = stepped(wider, list(range(own + 1)))
            blocks = len(np.unique(residuals.blocks))
            gain = blocks / 2 * float(np.log(before / left)) if steps[-1] > 0 else 0.0
            found.append(Lacking(name=name, gain=gain, shift=steps[:-1]))
        return tuple(found)

    def covariance(self, solution: Solution) -> Array:
        """Covariance of the values, with the floor of the method; infinite where the data do not identify one.

        Not less than what kinds of rows disagree by: friction that is not that of the law errs alike at every reversal.
        """
        found, _ = block_covariance(solution.residuals, robust=True)
        found = widened(found, solution.residuals, self._labels(len(solution.residuals.values))[1])
        floor = np.array([n.floor * abs(solution.values[n.key]) for n in self.numbers])
        return np.asarray(found + np.diag(floor**2))


_ROOM_RAD = 0.1
"""By which a joint may go beyond what its encoder shows."""


def _whole(values: Array, rows: int) -> Array:
    """The rows, the last good one repeated."""
    return np.vstack([values, np.repeat(values[-1:], rows - len(values), axis=0)])
