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
from tendonff.ocp.fits.mechanism import MotorRun
from tendonff.ocp.mechanism.response import MechanismRun, simulate_mechanism
from tendonff.ocp.mechanism.slopes import Direction, Start, simulate_slopes
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
        led = self._led(log)
        run = simulate_mechanism(self._start(log, values).problem, led, log.step_s / self.refinement)
        held, angle = (_whole(each, len(led))[:: self.refinement] for each in (run.effort, run.position))
        torque = _torques(put_into(self.finger, values), log, held)
        return Predicted(torque_N_m=torque, angle_rad=angle[:, : len(self.finger.joints)], run=run)

    def _led(self, log: MotorsLog) -> Array:
        """Angles of the motors at the steps of the simulation, shape (steps, motors)."""
        count, parts = len(log.motor_rad), self.refinement
        rows = np.arange((count - 1) * parts + 1) / parts
        return np.column_stack([np.interp(rows, np.arange(count), column) for column in log.motor_rad.T])

    def _start(self, log: MotorsLog, values: Mapping[str, float]) -> Start:
        """The mechanism at rest where a log begins."""
        finger = put_into(self.finger, values)
        start = dict(zip(finger.names, log.start_rad.tolist(), strict=True))
        motion = JointMotion(names=finger.names, time_s=np.arange(3.0), angle_rad=self._spans(log))
        loops = {m.body: m.drive.pretension_N or 0.0 for m in finger.motors if len(m.winds) > 1}
        mechanism, sharing = finger.mechanism(motion), finger.sharing
        problem = mechanism_problem(
            mechanism, Level.PRESLIDING, start, pretension_N=loops, sharing=sharing, segments=self.segments
        )
        own = [
            values.get(f"{START}.{log.name}.{tendon.name}", float(tension))
            for tendon, tension in zip(finger.tendons, problem.tension_N, strict=True)
        ]
        return Start.at_rest(problem.starting(np.array(own)))

    def _slopes(self, log: MotorsLog, values: Mapping[str, float]) -> tuple[Predicted, Array, Array]:
        """As `predict`, with exact slopes of torques and angles over all numbers, shape (rows, each, numbers)."""
        led, parts, around = self._led(log), self.refinement, [self._around(values, n) for n in self.numbers]
        directions = [
            Direction(
                above=self._start(log, {**values, number.key: high}),
                below=self._start(log, {**values, number.key: low}),
                apart=high - low,
            )
            for number, (low, high) in zip(self.numbers, around, strict=True)
        ]
        run, slopes = simulate_slopes(self._start(log, values), led, log.step_s / parts, directions)
        held, angle, by_held, by_angle = (
            _whole(each, len(led))[::parts] for each in (run.effort, run.position, slopes.effort, slopes.position)
        )
        joints, finger = len(self.finger.joints), put_into(self.finger, values)
        by_torque = np.zeros((*held.shape, len(self.numbers)))
        for k, (number, (low, high)) in enumerate(zip(self.numbers, around, strict=True)):
            above, below = (
                _torques(put_into(self.finger, {**values, number.key: value}), log, held + way * by_held[..., k])
                for value, way in ((high, (high - low) / 2), (low, (low - high) / 2))
            )
            by_torque[..., k] = (above - below) / (high - low)
        found = Predicted(torque_N_m=_torques(finger, log, held), angle_rad=angle[:, :joints], run=run)
        return found, by_torque, by_angle[:, :joints]

    @staticmethod
    def _around(values: Mapping[str, float], number: Number) -> tuple[float, float]:
        """On either side of a value, within its bounds: what a mechanism is made of depends on it smoothly."""
        at = values[number.key]
        step = STEP * number.step * (at if number.logarithmic else 1.0)
        return max(at - step, number.unknown.low if not number.logarithmic else 0.0), at + step

    def _spans(self, log: MotorsLog) -> Array:
        """Angles of the joints that decide which sections get masses, shape (3, joints)."""
        lengths = np.where(np.isfinite(log.joint_rad), log.joint_rad, log.start_rad)
        return np.vstack([log.start_rad, lengths.min(axis=0) - _ROOM_RAD, lengths.max(axis=0) + _ROOM_RAD])

    def errors(self, log: MotorsLog, found: Predicted) -> tuple[Array, Array]:
        """Predicted less measured torques, and angles with no zero of the encoders; NaN where there is none."""
        return found.torque_N_m - log.torque_N_m, _centred(found.angle_rad - log.joint_rad, log)

    @staticmethod
    def _scaled(log: MotorsLog, torque: Array, angle: Array) -> list[Array]:
        """Rows of a log that count, a channel after the other, in units of their expected size: errors, or slopes."""
        size = np.maximum(log.noise_N_m, TORQUE_SHARE * np.ptp(log.torque_N_m, axis=0))
        columns = [column / each for column, each in zip(torque[log.counted].swapaxes(0, 1), size, strict=True)]
        seen = angle[log.counted][:, log.encoders] / JOINT_RAD
        return [*columns, *seen.swapaxes(0, 1)]

    @property
    def _known(self) -> list[Number]:
        return [n for n in self.numbers if n.prior]

    def _before(self, values: Mapping[str, float]) -> Array:
        """Residuals of what is known before."""
        return np.array([np.log(values[n.key] / n.start) / n.prior for n in self._known])

    def _weighted(self, values: Mapping[str, float]) -> Array:
        """Residuals in units of their expected size, then those of what is known before."""
        found = [each for log in self.logs for each in self._scaled(log, *self.errors(log, self.predict(log, values)))]
        return np.concatenate([*found, self._before(values)])

    def evaluate(self, values: Mapping[str, float]) -> Residuals:
        """Residuals with exact slopes over all numbers."""
        residuals, slopes = list[Array](), list[Array]()
        for log in self.logs:
            found, by_torque, by_angle = self._slopes(log, values)
            residuals += self._scaled(log, *self.errors(log, found))
            slopes += self._scaled(log, by_torque, _centred(by_angle, log))
        residuals.append(self._before(values))
        own = [[(n is k) / (values[n.key] * n.prior) for k in self.numbers] for n in self._known]
        slopes.append(np.array(own).reshape(-1, len(self.numbers)))
        whole = np.concatenate(residuals)
        return Residuals(values=whole, slopes=np.concatenate(slopes), blocks=self._labels(len(whole))[0])

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
        unknowns = [replace(n, start=start[key]).unknown for key, n in by_key.items()]
        try:
            return solve(self.evaluate, unknowns, values=self._weighted, most=most, tolerance=1e-4)
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
    return np.concatenate([values, np.repeat(values[-1:], rows - len(values), axis=0)])


def _centred(rows: Array, log: MotorsLog) -> Array:
    """Angles with no zero of the encoders, or their slopes."""
    return np.asarray(rows - rows[log.counted].mean(axis=0))


def _torques(finger: Finger, log: MotorsLog, held_N_m: Array) -> Array:
    """Torques of the motors where their tendons take so much, shape (rows, motors)."""
    torques = [
        motor.drive.torque_N_m(held, turning.acceleration_rad_per_s2, turning.way())
        for motor, turning, held in zip(finger.motors, log.turning, held_N_m.T, strict=True)
    ]
    return np.column_stack(torques)
