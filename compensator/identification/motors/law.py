"""The whole mechanism as a law: torques of motors and angles of joints from the motors' angles, fitted to logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.motors.numbers import Number, Values, numbers_of, put_into, start_key
from tendonff.compensator.identification.parameters import Parameter, System
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import (
    Blocks,
    Residuals,
    Solution,
    Unknown,
    block_covariance,
    gauss_newton_step,
    solve,
)
from tendonff.ocp.fits.mechanism import (
    GEAR_SLIP_RAD,
    Change,
    Loop,
    MotorResponse,
    MotorRun,
    MotorSlopes,
    Rig,
    Several,
    differences,
    respond,
    respond_with_slopes,
)

COARSE_MASSES, FINE_MASSES = 6, 12
"""Of each tendon while laws are compared, and at the end."""

TORQUE_SHARE, JOINT_RAD = 0.008, 2e-3
"""Residuals count linearly beyond this share of a torque's range, and beyond this angle of a joint."""

STEP, SLOPE_STEP = 5e-3, 1e-4
"""Differences in usual steps of a search: of simulations, and of what the mechanism of an exact slope is made of."""

STEEPEST = 1e4
"""Change of a residual over a usual step that no law has, eighty times the range: masses of a loose tendon fly free,
and what they differ by may grow without end, but not what the motor feels of it.
"""

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

EFFECT_SHARE = 0.1
"""An effect that a law of several motors lacks is tried with this share of the stiffness, or of the tensions."""

Q = Parameter


@dataclass(frozen=True, kw_only=True)  # without slots: the numbers are kept in the instance
class MechanismLaw:
    """A mechanism with numbers to find.

    Parameters
    ----------
    mechanism : Mechanism or Finger
        Where all other numbers come from.
    logs : sequence of MotorsLog
    fixed : mapping, optional
        Numbers that are held at a value.
    segments, refinement : int, optional
        Masses of each tendon, and steps in one row.
    as_read : bool, optional
        The motor moves in counts, as it was read; else smoothly.
    """

    mechanism: System
    logs: Sequence[MotorsLog]
    fixed: Values = field(default_factory=dict)
    segments: int = COARSE_MASSES
    refinement: int = 1
    as_read: bool = False

    @cached_property
    def numbers(self) -> dict[str, Number]:
        """All numbers that may be searched for, by name."""
        return numbers_of(self.mechanism, self.logs)

    def at(self, values: Values) -> System:
        """The mechanism at given values."""
        found: System = put_into(self.mechanism, {**self.fixed, **values})  # type: ignore[type-var]
        return found

    def rig(self, log: MotorsLog, values: Values) -> Rig:
        """The mechanism at given values, as a log's motors feel it."""
        return self._rig(log, values, self.at(values))

    def _rig(self, log: MotorsLog, values: Values, mechanism: System) -> Rig:
        found = {**self.fixed, **values}
        if not isinstance(mechanism, Mechanism):
            starts = {t.name: start_key(log.name, t.name) for t in mechanism.tendons}
            return Several(mechanism=mechanism, tension_N={t: found[k] for t, k in starts.items() if k in found})
        offset, slip = found.get(Q.OFFSET, 0.0), found.get(Q.GEAR_SLIP, GEAR_SLIP_RAD)
        held = None
        if mechanism.drive.backlash_rad > 0:
            held = (log.torque_N_m - offset - mechanism.drive.coulomb_N_m * log.run.way(slip))[:, 0]
        return Loop(mechanism=mechanism, slip_rad=slip, offset_N_m=offset, backlash_held_N_m=held)

    @property
    def _steps(self) -> int:
        return self.refinement * (READ_STEPS if self.as_read else 1)

    def respond(self, log: MotorsLog, values: Values) -> MotorResponse:
        """Simulate a log; SolveError or ParameterError where it cannot be."""
        how = {"segments": self.segments, "refinement": self._steps}
        return respond(self.rig(log, values), log.run, **how, as_read=self.as_read)

    def _slopes(self, log: MotorsLog, values: Values, over: Sequence[str]) -> tuple[MotorResponse, MotorSlopes]:
        """The same with exact slopes over some of the values."""
        mechanism = self.at(values)
        rig = self._rig(log, values, mechanism)
        changes = [self._change(log, values, name, rig, mechanism) for name in over]
        how = {"segments": self.segments, "refinement": self._steps}
        return respond_with_slopes(rig, log.run, changes, **how, as_read=self.as_read)

    def _change(self, log: MotorsLog, values: Values, name: str, rig: Rig, mechanism: System) -> Change:
        """A rig and one beside it, within the bounds of a value: what they are made of depends on it smoothly."""
        at = values[name]
        low, high = self.numbers[name].around(at, SLOPE_STEP)
        other = high if high > at else low
        beside = self._rig(log, {**values, name: other}, self._moved(mechanism, values, name, other))
        return Change(above=beside, below=rig, apart=other - at)

    def _moved(self, mechanism: System, values: Values, name: str, value: float) -> System:
        """The mechanism of values with one of them changed."""
        parameter, found = self.numbers[name].parameter, {**self.fixed, **values}
        if parameter is Q.SECOND_SIDE or name == parameter.motors.shared:  # which are relative to the first mechanism
            return self.at({**values, name: value})
        together = (Q.RELAXING_SHARE, Q.RELAXATION_TIME)
        beside: dict[str, float] = {n: found[n] for n in together if n in found} if parameter in together else {}
        moved: System = put_into(mechanism, {**beside, name: value})  # type: ignore[type-var]
        return moved

    def errors(self, log: MotorsLog, answer: MotorResponse) -> tuple[Array, Array]:
        """Predicted less measured torques, and angles with no zero of the encoders; NaN where there is none."""
        return answer.torque_N_m - log.torque_N_m, centred(answer.angle_rad - log.joint_rad, log)

    def percent(self, values: Values) -> float:
        """RMS error of a torque in % of its range, the worst of logs and motors."""
        return max(self._percent(log, values) for log in self.logs)

    def _percent(self, log: MotorsLog, values: Values) -> float:
        off = (self.respond(log, values).torque_N_m - log.torque_N_m)[log.counted]
        return float((100 * np.sqrt((off**2).mean(axis=0)) / log.range_N_m).max())

    @staticmethod
    def _scaled(log: MotorsLog, torque: Array, angle: Array) -> list[Array]:
        """Rows of a log that count, a channel after the other, in units of their expected size: errors, or slopes."""
        size = np.maximum(log.noise_N_m, TORQUE_SHARE * np.ptp(log.torque_N_m, axis=0))
        torque, angle = (
            x * _along(np.sqrt(share), x) for x, share in ((torque, log.motor_share), (angle, log.joint_share))
        )
        columns = [column / each for column, each in zip(torque[log.counted].swapaxes(0, 1), size, strict=True)]
        return [*columns, *(angle[log.counted][:, log.encoders] / JOINT_RAD).swapaxes(0, 1)]

    def _known(self, values: Values) -> list[Number]:
        """Numbers of which something is known before."""
        found = (self.numbers[name] for name in values)
        return [n for n in found if n.prior and n.start > 0]

    def _before(self, values: Values) -> Array:
        """Residuals of what is known before."""
        return np.array([np.log(values[n.name] / n.start) / n.prior for n in self._known(values)])

    def weighted(self, values: Values) -> Array:
        """Residuals in units of their expected size, then those of what is known before."""
        rows = [each for log in self.logs for each in self._scaled(log, *self.errors(log, self.respond(log, values)))]
        return np.concatenate([*rows, self._before(values)])

    def _blocks(self, rows: int) -> Blocks:
        """Which rows of the residuals belong together: a stretch of moving, of all channels alike."""
        found, first = list[Blocks](), 0
        for log in self.logs:
            own = first + (_moving_s(log.run)[log.counted] / BLOCK_S).astype(int)
            first = int(own[-1]) + 1
            found += [own] * (len(log.motors) + int(log.encoders.sum()))
        blocks = np.concatenate(found)
        return np.concatenate([blocks, first + np.arange(rows - len(blocks))])

    def kinds(self, rows: int) -> Blocks:
        """Kinds of rows of the residuals: each channel of each log, its motor turning or sliding, either way."""
        found = list[Blocks]()
        for log in self.logs:
            turning = np.maximum(TURNING_SHARE * np.ptp(log.run.motor_rad, axis=0), 1e-9)
            own = 2 * (np.abs(log.run.way(turning)) > SLIDES) + (log.run.way(0.1 * turning) > 0)
            for column in [*own.T, *[own[:, 0]] * int(log.encoders.sum())]:
                found.append(4 * len(found) + column[log.counted].astype(int))
        kinds = np.concatenate(found)
        return np.concatenate([kinds, np.full(rows - len(kinds), 4 * len(found))])

    def joint_friction_N_m(self) -> float:
        """Friction of free strokes, as a torque on the joint: half of what they differ by; zero of several motors."""
        found, mechanism = [0.0], self.mechanism
        if not isinstance(mechanism, Mechanism):
            return 0.0
        for log in self.logs:
            torque = log.torque_N_m[log.counted]
            way = log.run.way(TURNING_SHARE * float(np.ptp(log.run.motor_rad)))[log.counted]
            up, down = torque[way > SLIDES], torque[way < -SLIDES]
            if up.size and down.size:
                found.append(float(np.median(up) - np.median(down)) / 2)
        arm = abs(mechanism.arms_at(float(self.logs[0].run.start_rad[0]))[0])
        return max(found) * mechanism.drive.gear_ratio * arm / mechanism.drum_radius_m[0]

    def evaluate(self, values: Values, over: Sequence[str]) -> Residuals:
        """Residuals with slopes over some of the values."""
        if resolve_engine(Engine.AUTO) is Engine.CASADI:
            return self._differences(values, over)
        residuals, slopes = list[Array](), list[Array]()
        for log in self.logs:
            answer, by = self._slopes(log, values, over)
            residuals += self._scaled(log, *self.errors(log, answer))
            slopes += self._scaled(log, by.torque_N_m, centred(by.angle_rad, log))
        known = self._known(values)
        residuals.append(self._before(values))
        own = [[(n.name == k) / (values[n.name] * n.prior) for k in over] for n in known]
        slopes.append(np.array(own).reshape(-1, len(over)))
        found, by_values = np.concatenate(residuals), np.concatenate(slopes)
        steps = [self.numbers[n].usual(values[n]) for n in over]
        steep = ~(np.abs(by_values) * steps <= STEEPEST).all(axis=0)  # nor is one that is no number
        cornered = np.array([self.numbers[n].search.cornered and values[n] <= 0 for n in over], dtype=bool)
        if poor := np.flatnonzero(steep | cornered).tolist():
            by_values[:, poor] = self._differences(values, [over[k] for k in poor]).slopes
        return Residuals(values=found, slopes=by_values, blocks=self._blocks(len(found)))

    def _differences(self, values: Values, over: Sequence[str]) -> Residuals:
        """Residuals with slopes by differences: a simulation for each value."""
        start, numbers = np.array([values[n] for n in over]), [self.numbers[n] for n in over]

        def predict(x: Array) -> Array:
            return self.weighted({**values, **dict(zip(over, x.tolist(), strict=True))})

        steps = []
        for number, at in zip(numbers, start.tolist(), strict=True):
            low, high = number.around(at, STEP)
            steps.append(high - at if high > at else low - at)
        residuals, slopes = differences(predict, start, steps)
        return Residuals(values=residuals, slopes=slopes, blocks=self._blocks(len(residuals)))

    def with_changes(self, solution: Solution, changed: Values) -> Residuals:
        """Residuals of a solution with slopes over changes of further numbers, each simulated, too."""
        found, columns = solution.residuals, [solution.residuals.slopes]
        for name, value in changed.items():
            start = self.fixed.get(name, self.numbers[name].start)
            off = self.weighted({**solution.values, name: value}) - found.values
            columns.append(off[:, None] / (value - start))
        return replace(found, slopes=np.hstack(columns))

    def unknowns(self, start: Values) -> list[Unknown]:
        """Bounds and steps of a search from given values."""
        return [self._unknown(name, at) for name, at in start.items()]

    def _unknown(self, name: str, start: float) -> Unknown:
        """Bounds and step of a number's search; a stop that was touched stands between start and end of the motors."""
        number, mechanism = self.numbers[name], self.mechanism
        if number.parameter not in (Q.STOP_LOW, Q.STOP_HIGH) or not isinstance(mechanism, Mechanism):
            return number.unknown(start)
        reach = list(reach_rad(mechanism, self.logs))
        margin = STOP_MARGIN * (reach[1] - reach[0])
        begun = [float(log.run.start_rad[0]) for log in self.logs]
        if number.parameter is Q.STOP_LOW:
            reach[1] = max(min(begun), reach[0] + 2 * margin)
        else:
            reach[0] = min(max(begun), reach[1] - 2 * margin)
        at = min(max(start, reach[0] + margin), reach[1] - margin)
        return replace(number.unknown(at), low=reach[0], high=reach[1])

    def fit(
        self, start: Values, *, begun: Residuals | None = None, most: int = 15, tolerance: float = 1e-3
    ) -> Solution:
        """Least squares over the numbers of `start`, whose residuals are `begun`; SolveError if it has no answer."""
        free, rows = tuple(start), [] if begun is None else [begun]

        def evaluate(values: Mapping[str, float]) -> Residuals:
            try:
                rows[:] = [self.evaluate({n: values[n] for n in free}, free)]
            except ParameterError:
                if not rows:
                    raise
                return replace(rows[0], values=np.full_like(rows[0].values, np.nan))  # the search takes a smaller step
            return rows[0]

        def alone(values: Mapping[str, float]) -> Array:
            try:
                return self.weighted({n: values[n] for n in free})
            except ParameterError:
                return np.full_like(rows[0].values, np.nan)

        unknowns = self.unknowns(start)
        # few slopes come with the simulation; many, or those by differences, are wanted at the accepted points alone
        few = isinstance(self.mechanism, Mechanism) and resolve_engine(Engine.AUTO) is not Engine.CASADI
        try:
            values = None if few else alone
            return solve(evaluate, unknowns, values=values, begun=begun, from_afar=True, most=most, tolerance=tolerance)
        except ParameterError as error:
            raise SolveError(str(error)) from None


def reach_rad(mechanism: Mechanism, logs: Sequence[MotorsLog]) -> tuple[float, float]:
    """Least and largest angle that a joint would have without lost motion and stops."""
    places = []
    for log in logs:
        at = float(log.run.start_rad[0])
        per_rad = mechanism.drum_radius_m[0] / (mechanism.drive.gear_ratio * abs(mechanism.arms_at(at)[0]))
        places.append(at + log.run.motor_rad[:, 0] * per_rad)
    joined = np.concatenate(places)
    return float(joined.min()), float(joined.max())


def centred(rows: Array, log: MotorsLog) -> Array:
    """Angles with no zero of the encoders, or their slopes."""
    share = _along(log.joint_share[log.counted], rows)
    return np.asarray(rows - (share * rows[log.counted]).sum(axis=0) / share.sum(axis=0))


def _along(share: Array, rows: Array) -> Array:
    """Shares of rows and channels, shaped to multiply rows that may have further axes."""
    return share.reshape(*share.shape, *[1] * (rows.ndim - 2))


def widened(covariance: Array, residuals: Residuals, kinds: Blocks) -> Array:
    """A covariance whose variances are at least the squares of what each kind of rows would move the values by."""
    weight = 1 / np.sqrt(1 + residuals.values**2)
    size = np.sqrt((weight[:, None] * residuals.slopes**2).sum(axis=0))
    size = np.where(size > 0, size, np.inf)  # a value that no row tells
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
    """Time up to each row that a motor moved."""
    speed = np.abs(np.gradient(run.motor_rad, run.step_s, axis=0))
    moves = (speed > STANDS * np.percentile(speed, 95, axis=0)).any(axis=1)
    return np.asarray(np.cumsum(moves) * run.step_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """Change that one more number would bring, by a Gauss-Newton step.

    Attributes
    ----------
    gain : float
        Of the log-likelihood; 0 where the number would leave its bounds.
    shift : ndarray, shape (k,)
        By which the values would change.
    """

    gain: float
    shift: Array


def promises(law: MechanismLaw, solution: Solution, tried: Sequence[Parameter]) -> dict[Parameter, Promise]:
    """Gain that each of these numbers promises, which the solution does not have.

    Of several motors a change that is not small is simulated: others have taken the place of a small one.
    """
    own = list(solution.values)
    extras = [n for n in tried if n not in own]
    start: dict[str, float] = {n: law.fixed.get(n, law.numbers[n].start) for n in extras}
    if isinstance(law.mechanism, Mechanism):
        found = law.evaluate({**solution.values, **start}, [*own, *extras])
    else:
        found = law.with_changes(solution, {n: start[n] + _tried(law, solution, n) for n in extras})
    before, _ = stepped(found, list(range(len(own))))
    blocks = len(np.unique(solution.residuals.blocks))
    promised = {}
    for k, number in enumerate(extras):
        left, steps = stepped(found, [*range(len(own)), len(own) + k])
        search, step = number.motors, float(steps[-1])
        low = search.low if not search.logarithmic else 0.0
        feasible = low <= start[number] + step <= search.high
        gain = blocks / 2 * float(np.log(before / left)) if feasible else 0.0
        promised[number] = Promise(gain=gain, shift=steps[:-1])
    return promised


def _tried(law: MechanismLaw, solution: Solution, parameter: Parameter) -> float:
    """A change of the effect that is not small: a share of the stiffness, or of the tensions."""
    if parameter is not Q.ADHESION:
        return EFFECT_SHARE
    tensions = [v for k, v in solution.values.items() if law.numbers[k].parameter in (Q.TENSION, Q.TENSION_AT_START)]
    return EFFECT_SHARE * (float(np.mean(tensions)) if tensions else 10.0)


def stepped(found: Residuals, columns: list[int]) -> tuple[float, Array]:
    """Weighted squares after a Gauss-Newton step over some columns, and their steps."""
    slopes = found.slopes[:, columns]
    step = gauss_newton_step(found.values, slopes)
    left = (found.values + slopes @ step) / (1 + found.values**2) ** 0.25
    return float(left @ left), step


def covariance_of(law: MechanismLaw, solution: Solution) -> Array:
    """Covariance of the values, with the floor of the method; infinite where the data do not tell, shape (k, k).

    Not less than what kinds of rows disagree by: friction that is not that of the law errs alike at every reversal.
    """
    residuals, numbers = solution.residuals, [law.numbers[name] for name in solution.values]
    covariance, _ = block_covariance(residuals, robust=True)
    covariance = widened(covariance, residuals, law.kinds(len(residuals.values)))
    friction = law.joint_friction_N_m()
    floor = [np.hypot(n.floor(solution.values[n.name]), n.search.floor_of_friction * friction) for n in numbers]
    return np.asarray(covariance + np.diag(np.square(floor)))
