"""The whole mechanism as a law: torque of the motor and angle of the joint from the motor's angle, fitted to logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.joint.log import JointLog
from tendonff.compensator.identification.joint.parameters import EXTRAS, JointNumber, put_into
from tendonff.compensator.identification.measured import Array
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Blocks, Residuals, Solution, Unknown, block_covariance, solve
from tendonff.ocp.fits.mechanism import (
    GEAR_SLIP_RAD,
    Change,
    Loop,
    MotorResponse,
    MotorRun,
    MotorSlopes,
    differences,
    respond,
    respond_with_slopes,
)

COARSE_MASSES, FINE_MASSES = 6, 12
"""Of each tendon while laws are compared, and at the end."""

TORQUE_SHARE, JOINT_RAD = 0.008, 2e-3
"""Residuals count linearly beyond this share of the torque's range, and beyond this angle of the joint."""

STEP = 5e-3
"""Difference that slopes are taken over, in usual steps of a search."""

READ_STEPS = 5
"""Steps for each one else that resolve how a joint rings while its motor goes from count to count."""

STOP_MARGIN = 2e-3
"""Share of the motor's range by which a stop that was touched stands inside of it at the start of a search."""

TURNING_SHARE, SLIDES = 0.02, 0.7
"""A reversal is under way until a bristle that builds up within this share of the motor's range has so much of its
friction.
"""

BLOCK_S, STANDS = 0.5, 0.02
"""Rows so much moving apart are taken as independent: about a reversal. A motor stands below this share of its speed,
and keeps one error of the friction for as long.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismLaw:
    """A mechanism with numbers to find.

    Parameters
    ----------
    mechanism : Mechanism
        Where all other numbers come from.
    logs : sequence of JointLog
    fixed : mapping
        Numbers that are held at a value.
    segments, refinement : int
        Masses of each tendon, and steps in one row.
    as_read : bool
        The motor moves in counts, as it was read; else smoothly.
    """

    mechanism: Mechanism
    logs: Sequence[JointLog]
    fixed: Mapping[JointNumber, float]
    segments: int = COARSE_MASSES
    refinement: int = 1
    as_read: bool = False

    def at(self, values: Mapping[JointNumber, float]) -> Mechanism:
        """The mechanism at given values."""
        held: dict[JointNumber, float] = {
            k: v for k, v in {**self.fixed, **values}.items() if k is not JointNumber.OFFSET
        }
        return put_into(self.mechanism, held)

    def loop(self, log: JointLog, values: Mapping[JointNumber, float]) -> Loop:
        """The mechanism at given values, as a log's motor feels it."""
        found = {**self.fixed, **values}
        mechanism, offset = self.at(values), found.get(JointNumber.OFFSET, 0.0)
        slip = found.get(JointNumber.GEAR_SLIP, GEAR_SLIP_RAD)
        held = None
        if mechanism.drive.backlash_rad > 0:
            held = log.torque_N_m - offset - mechanism.drive.coulomb_N_m * log.run.way(slip)
        return Loop(mechanism=mechanism, slip_rad=slip, offset_N_m=offset, backlash_held_N_m=held)

    @property
    def _steps(self) -> int:
        return self.refinement * (READ_STEPS if self.as_read else 1)

    def respond(self, log: JointLog, values: Mapping[JointNumber, float]) -> MotorResponse:
        """Simulate a log; SolveError or ParameterError where it cannot be."""
        loop = self.loop(log, values)
        return respond(loop, log.run, segments=self.segments, refinement=self._steps, as_read=self.as_read)

    def _slopes(
        self, log: JointLog, values: Mapping[JointNumber, float], over: Sequence[JointNumber]
    ) -> tuple[MotorResponse, MotorSlopes]:
        """The same with exact slopes over some of the values."""
        changes = [self._change(log, values, number) for number in over]
        how = {"segments": self.segments, "refinement": self._steps}
        return respond_with_slopes(self.loop(log, values), log.run, changes, **how, as_read=self.as_read)

    def _change(self, log: JointLog, values: Mapping[JointNumber, float], number: JointNumber) -> Change:
        """Loops on either side of a value, within its bounds: what they are made of depends on it smoothly."""
        spec, at = number.spec, values[number]
        step = STEP * spec.step * (at if spec.logarithmic else 1.0)
        low, high = (
            (at - step, at + step) if spec.logarithmic else (max(at - step, spec.low), min(at + step, spec.high))
        )
        above, below = (self.loop(log, {**values, number: value}) for value in (high, low))
        return Change(above=above, below=below, apart=high - low)

    def errors(self, values: Mapping[JointNumber, float]) -> list[tuple[Array, Array | None]]:
        """Predicted less measured torque and joint angle of each log, with no zero of the encoder."""
        found = []
        for log in self.logs:
            answer = self.respond(log, values)
            angle = None if log.joint_rad is None else _centred(answer.angle_rad - log.joint_rad, log)
            found.append((answer.torque_N_m - log.torque_N_m, angle))
        return found

    def _weighted(self, values: Mapping[JointNumber, float]) -> Array:
        """Residuals in units of their expected size, then those of what is known before."""
        rows = [
            each
            for log, found in zip(self.logs, self.errors(values), strict=True)
            for each in self._scaled(log, *found)
        ]
        known = [n for n in values if self._is_known(n)]
        return np.concatenate(
            [*rows, np.array([np.log(values[n] / n.of(self.mechanism)) / n.spec.prior for n in known])]
        )

    @staticmethod
    def _scaled(log: JointLog, torque: Array, angle: Array | None) -> list[Array]:
        """Rows of a log that count, in units of their expected size: errors, or their slopes."""
        size = max(log.noise_N_m, TORQUE_SHARE * float(np.ptp(log.torque_N_m)))
        found = [torque[log.counted] / size]
        return found if angle is None else [*found, angle[log.counted] / JOINT_RAD]

    def _is_known(self, number: JointNumber) -> bool:
        return bool(number.spec.prior) and number.of(self.mechanism) > 0

    def _blocks(self, rows: int) -> Blocks:
        """Which rows of the residuals belong together: a stretch of moving, of torque and angle alike."""
        found, first = [], 0
        for log in self.logs:
            own = first + (_moving_s(log.run)[log.counted] / BLOCK_S).astype(int)
            first = int(own[-1]) + 1
            found.append(own)
            if log.joint_rad is not None:
                found.append(own)
        blocks = np.concatenate(found)
        return np.concatenate([blocks, first + np.arange(rows - len(blocks))])

    def joint_friction_N_m(self) -> float:
        """Friction of free strokes, as a torque on the joint: half of what they differ by."""
        found = []
        for log in self.logs:
            torque = log.torque_N_m[log.counted]
            way = log.run.way(TURNING_SHARE * float(np.ptp(log.run.motor_rad)))[log.counted]
            up, down = torque[way > SLIDES], torque[way < -SLIDES]
            if up.size and down.size:
                found.append(float(np.median(up) - np.median(down)) / 2)
        mechanism, start = self.mechanism, self.logs[0].run.start_rad
        arm = abs(mechanism.arms_at(start)[0])
        return max(found, default=0.0) * mechanism.drive.gear_ratio * arm / mechanism.drum_radius_m[0]

    def kinds(self, rows: int) -> Blocks:
        """Kinds of rows of the residuals: torque or angle, of each log, turning or sliding, either way."""
        found = list[Blocks]()
        for log in self.logs:
            turning = TURNING_SHARE * float(np.ptp(log.run.motor_rad))
            slides = np.abs(log.run.way(turning)) > SLIDES
            own = 2 * slides[log.counted] + (log.run.way(0.1 * turning) > 0)[log.counted]
            for _ in range(1 if log.joint_rad is None else 2):
                found.append(4 * len(found) + own.astype(int))
        kinds = np.concatenate(found)
        return np.concatenate([kinds, np.full(rows - len(kinds), 4 * len(found))])

    def evaluate(self, values: Mapping[JointNumber, float], over: Sequence[JointNumber]) -> Residuals:
        """Residuals with slopes over some of the values."""
        if resolve_engine(Engine.AUTO) is Engine.CASADI:
            return self._differences(values, over)
        residuals, slopes = list[Array](), list[Array]()
        for log in self.logs:
            answer, by = self._slopes(log, values, over)
            angle = None if log.joint_rad is None else _centred(answer.angle_rad - log.joint_rad, log)
            residuals += self._scaled(log, answer.torque_N_m - log.torque_N_m, angle)
            slopes += self._scaled(log, by.torque_N_m, None if angle is None else _centred(by.angle_rad, log))
        known = [n for n in values if self._is_known(n)]
        residuals.append(np.array([np.log(values[n] / n.of(self.mechanism)) / n.spec.prior for n in known]))
        slopes.append(
            np.array([[(n == k) / (values[n] * n.spec.prior) for k in over] for n in known]).reshape(-1, len(over))
        )
        found, by_values = np.concatenate(residuals), np.concatenate(slopes)
        for k, number in enumerate(over):
            if number is JointNumber.JOINT_COULOMB and values[number] <= 0:  # no slope there: its law has a corner
                by_values[:, k] = self._differences(values, [number]).slopes[:, 0]
        return Residuals(values=found, slopes=by_values, blocks=self._blocks(len(found)))

    def _differences(self, values: Mapping[JointNumber, float], over: Sequence[JointNumber]) -> Residuals:
        """Residuals with slopes by differences: a simulation for each value."""
        start = np.array([values[n] for n in over])

        def predict(x: Array) -> Array:
            return self._weighted({**values, **dict(zip(over, x.tolist(), strict=True))})

        steps = [STEP * n.spec.step * (values[n] if n.spec.logarithmic else 1.0) for n in over]
        steps = [-s if v + s > n.spec.high else s for s, v, n in zip(steps, start.tolist(), over, strict=True)]
        residuals, slopes = differences(predict, start, steps)
        return Residuals(values=residuals, slopes=slopes, blocks=self._blocks(len(residuals)))

    def _unknown(self, number: JointNumber, start: float) -> Unknown:
        """Bounds and step of a number's search; a stop that was touched stands where the motors went."""
        if number not in (JointNumber.STOP_LOW, JointNumber.STOP_HIGH):
            return number.unknown(start)
        mechanism = self.mechanism
        places = [
            log.run.start_rad
            + log.run.motor_rad
            * mechanism.drum_radius_m[0]
            / (mechanism.drive.gear_ratio * abs(mechanism.arms_at(log.run.start_rad)[0]))
            for log in self.logs
        ]
        reach = [float(f(np.concatenate(places))) for f in (np.min, np.max)]
        margin = STOP_MARGIN * (reach[1] - reach[0])
        at = min(max(start, reach[0] + margin), reach[1] - margin)
        return replace(number.unknown(at), low=reach[0], high=reach[1])

    def fit(self, start: Mapping[JointNumber, float], *, most: int = 15, tolerance: float = 1e-4) -> Solution:
        """Least squares over the numbers of `start`; SolveError where the start has no answer."""
        free = tuple(start)

        def evaluate(values: Mapping[str, float]) -> Residuals:
            return self.evaluate({n: values[n] for n in free}, free)

        def alone(values: Mapping[str, float]) -> Array:
            return self._weighted({n: values[n] for n in free})

        unknowns = [self._unknown(n, start[n]) for n in free]
        try:
            # slopes come with the simulation; by differences they are wanted at the accepted points alone
            plain = alone if resolve_engine(Engine.AUTO) is Engine.CASADI else None
            return solve(evaluate, unknowns, values=plain, most=most, tolerance=tolerance)
        except ParameterError as error:
            raise SolveError(str(error)) from None


def _centred(rows: Array, log: JointLog) -> Array:
    """Angles with no zero of the encoder, or their slopes."""
    return np.asarray(rows - rows[log.counted].mean(axis=0))


def widened(covariance: Array, residuals: Residuals, kinds: Blocks) -> Array:
    """A covariance whose variances are at least the squares of what each kind of rows would move the values by."""
    weight = 1 / np.sqrt(1 + residuals.values**2)
    size = np.maximum(np.sqrt((weight[:, None] * residuals.slopes**2).sum(axis=0)), 1e-300)
    slopes = residuals.slopes / size
    inverse = np.linalg.pinv(slopes.T @ (weight[:, None] * slopes), hermitian=True)
    names, index = np.unique(kinds, return_inverse=True)
    score = np.zeros((len(names), slopes.shape[1]))
    np.add.at(score, index, slopes * (weight * residuals.values)[:, None])
    moved = ((score @ inverse / size) ** 2).sum(axis=0) * len(names) / max(len(names) - 1, 1)
    own = np.diag(covariance)
    known = np.isfinite(own) & (own > 0)
    wider = np.ones(len(own))
    wider[known] = np.sqrt(np.maximum(moved[known] / own[known], 1.0))
    return np.asarray(covariance * np.outer(wider, wider))


def _moving_s(run: MotorRun) -> Array:
    """Time up to each row that the motor moved."""
    speed = np.abs(np.gradient(run.motor_rad, run.step_s))
    return np.asarray(np.cumsum(speed > STANDS * np.percentile(speed, 95)) * run.step_s)


def gains(law: MechanismLaw, solution: Solution, tried: Sequence[JointNumber] = EXTRAS) -> dict[JointNumber, float]:
    """Gain in the logarithm of the error that one more number promises, by a Gauss-Newton step from a solution.

    Times the number of independent blocks over two it is a difference of log-likelihoods.
    """
    values = {JointNumber(n): v for n, v in solution.values.items()}
    own = list(values)
    extras = [n for n in tried if n not in own]
    start = {n: law.fixed.get(n, n.of(law.mechanism)) for n in extras}
    found = law.evaluate({**values, **start}, [*own, *extras])
    before, _ = stepped(found, list(range(len(own))))
    promised = {}
    for k, number in enumerate(extras):
        columns = [*range(len(own)), len(own) + k]
        left, steps = stepped(found, columns)
        step = float(steps[-1])
        low = number.spec.low if not number.spec.logarithmic else 0.0
        feasible = low <= start[number] + step <= number.spec.high
        promised[number] = float(np.log(before / left)) if feasible else 0.0
    return promised


def stepped(found: Residuals, columns: list[int]) -> tuple[float, Array]:
    """Weighted squares after a Gauss-Newton step over some columns, and their steps."""
    weight = 1 / (1 + found.values**2) ** 0.25
    slopes = found.slopes[:, columns] * weight[:, None]
    scale = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    step = np.linalg.lstsq(slopes / scale, -found.values * weight, rcond=None)[0]
    left = found.values * weight + (slopes / scale) @ step
    return float(left @ left), np.asarray(step / scale)


def covariance_of(law: MechanismLaw, solution: Solution) -> Array:
    """Covariance of the values, with the floor of the method; infinite where the data do not tell, shape (k, k).

    Not less than what kinds of rows disagree by: friction that is not that of the law errs alike at every reversal.
    """
    names = [JointNumber(n) for n in solution.values]
    values = {n: solution.values[n] for n in names}
    residuals = solution.residuals
    covariance, _ = block_covariance(residuals, robust=True)
    covariance = widened(covariance, residuals, law.kinds(len(residuals.values)))
    friction = law.joint_friction_N_m()
    floor = np.array([np.hypot(n.floor(values[n]), n.spec.floor_of_friction * friction) for n in names])
    return np.asarray(covariance + np.diag(floor**2))
