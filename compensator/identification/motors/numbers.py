"""Numbers of the list at their places: what motors are to find of a mechanism, and how values are put into it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.parameters import BY_MOTORS, OF_TENDONS, PARTNERS, Parameter, System
from tendonff.compensator.identification.searches import ByMotors, Role
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger, Motor
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.fits.least_squares import Unknown

S = TypeVar("S", Mechanism, Finger)
Values = Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number to find: a parameter at its place.

    Parameters
    ----------
    name : str
        Of its estimate: its parameter, or its key in the scenario where several motors tell each their own.
    parameter : Parameter
    start, step : float
        Where its search begins, and its usual step.
    prior : float
        Standard deviation of the logarithm that is known before, 0 for none.
    advice : str
        Move that identifies it.
    of_start : str
        Log to which it belongs, and not to the mechanism.
    """

    name: str
    parameter: Parameter
    start: float
    step: float
    prior: float
    advice: str
    of_start: str = ""

    @property
    def search(self) -> ByMotors:
        """Search for its parameter."""
        return self.parameter.motors

    def unknown(self, start: float) -> Unknown:
        """Bounds and step of its search."""
        return self.search.unknown(self.name, start, self.step)

    def usual(self, value: float) -> float:
        """Usual step of its search at a value, in its unit."""
        return self.step * (value if self.search.logarithmic else 1.0)

    def around(self, value: float, share: float) -> tuple[float, float]:
        """Values on either side, within its bounds, so many steps away."""
        by = share * self.usual(value)
        if self.search.logarithmic:
            return value - by, value + by
        return max(value - by, self.search.low), min(value + by, self.search.high)

    def size(self, value: float) -> float:
        """Size that its standard error is judged against."""
        return abs(value) if self.search.logarithmic or self.search.of_force else max(abs(value), self.step)

    def floor(self, value: float) -> float:
        """Standard error of the method itself."""
        share = self.search.logarithmic or self.search.of_force
        return self.search.floor * (abs(value) if share else 1.0)


_LEAST_MU = 0.02


def numbers_of(mechanism: System, logs: Sequence[MotorsLog]) -> dict[str, Number]:
    """All numbers that there are, by name, in the order of the report; those of the logs last."""
    alike = (*OF_TENDONS, *PARTNERS[Parameter.RELAXING_SHARE]) if isinstance(mechanism, Finger) else BY_MOTORS
    found = [_number(parameter, str(parameter), parameter.of(mechanism)) for parameter in alike]
    if isinstance(mechanism, Finger):
        apart = (number for parameter in BY_MOTORS for number in _apart(mechanism, parameter, logs))
        found = [*apart, *found, *_starts(mechanism, logs)]
    return {number.name: number for number in found}


def _number(parameter: Parameter, name: str, start: float, step: float | None = None, log: str = "") -> Number:
    search, apart = parameter.motors, name != parameter
    return Number(
        name=name,
        parameter=parameter,
        start=start,
        step=search.step if step is None else step,
        prior=(search.prior_apart if apart else 0.0) or search.prior,
        advice=(search.advice_apart if apart else "") or search.advice,
        of_start=log,
    )


def _apart(finger: Finger, parameter: Parameter, logs: Sequence[MotorsLog]) -> Iterator[Number]:
    """A parameter at every place that has one."""
    q, search, place = Parameter, parameter.motors, parameter.spec.key
    table, _, key = place.partition(".")
    if search.role is not Role.CORE or not key:
        return
    if not search.apart:
        yield _number(parameter, search.shared, 1.0)
    elif table in ("friction", "tendon"):
        for tendon in finger.tendons:
            at = getattr(getattr(tendon, table), key)
            yield _number(parameter, f"tendons.{tendon.name}.{place}", max(at, _LEAST_MU) if parameter is q.MU else at)
    elif table == "joint":
        for joint in finger.joints:
            if at := getattr(joint, key):
                yield _number(parameter, f"joints.{joint.name}.{key}", at, 0.1 * abs(at))
    else:
        for motor in finger.motors:
            if parameter is q.TENSION and len(motor.winds) == 1:
                continue
            if parameter is q.COULOMB and logs and all(log.run.cells for log in logs):
                continue  # no motor is in the way of its cells
            at, step = getattr(motor.drive, key) or search.start, None
            if not search.logarithmic:
                step = search.step * _held_N(motor, logs) * abs(motor.winding_m[0])
                at = max(at, step)
            yield _number(parameter, f"motors.{motor.name}.drive.{key}", at, step)


def _held_N(motor: Motor, logs: Sequence[MotorsLog]) -> float:
    """About the tension of a motor's tendons at the start of its logs."""
    own = [tension for (_, _, tension) in told_N((motor,), logs)]
    return float(np.mean(own)) if own and sum(own) > 0 else motor.drive.pretension_N or 1.0


def told_N(motors: Sequence[Motor], logs: Sequence[MotorsLog]) -> Iterator[tuple[str, str, float]]:
    """Logs, tendons that are alone on their motors, and about their tensions at the start."""
    for log in logs:
        for motor in motors:
            if len(motor.winds) == 1:
                k = log.motors.index(motor.name)
                yield log.name, motor.winds[0], abs(float(np.median(log.torque_N_m[:5, k])) / motor.winding_m[0])


def _starts(finger: Finger, logs: Sequence[MotorsLog]) -> Iterator[Number]:
    parameter = Parameter.TENSION_AT_START
    for log, tendon, tension in told_N(finger.motors, logs):
        yield _number(parameter, start_key(log, tendon), max(tension, 0.1), log=log)


def start_key(log: str, tendon: str) -> str:
    """Name of a tension at the start of a log."""
    return f"{Parameter.TENSION_AT_START}.{log}.{tendon}"


def key_in(mechanism: System, parameter: Parameter) -> str:
    """Dotted key of a parameter in the scenario of one joint; empty where it has none."""
    table, _, key = parameter.spec.key.partition(".")
    return f"joints.{mechanism.joints[0].name}.{key}" if table == "joint" else parameter.spec.key


def put_into(mechanism: S, values: Values) -> S:
    """The mechanism with values put in; tendons that differ keep their ratio to the first."""
    q, numbers = Parameter, dict[str, float]()
    for name, value in values.items():
        if name not in _BY_NAME:
            if not name.startswith(f"{q.TENSION_AT_START}."):
                numbers[name] = value
            continue
        parameter = q(name)
        table = parameter.spec.key.partition(".")[0]
        if parameter.motors.shared:
            numbers[parameter.motors.shared] = value / parameter.of(mechanism)
        elif parameter is q.RELAXATION_TIME:
            continue
        elif table in ("friction", "tendon"):
            numbers |= {f"tendons.{t.name}.{parameter.spec.key}": value for t in mechanism.tendons}
        elif table:
            numbers[key_in(mechanism, parameter)] = value
    changed = _relaxing(with_numbers(mechanism, numbers), values)
    if (softer := values.get(q.SECOND_SIDE, 1.0)) == 1.0:
        return changed
    first, second = changed.tendons
    return replace(changed, tendons=(first, replace(second, tendon=second.tendon.scaled(1 / softer))))


_BY_NAME = frozenset(map(str, (*BY_MOTORS, Parameter.TENSION_AT_START)))


def _relaxing(mechanism: S, values: Values) -> S:
    """The mechanism with the relaxation of all tendons that the values hold, a share of their stiffness."""
    share, time_s = values.get(Parameter.RELAXING_SHARE), values.get(Parameter.RELAXATION_TIME)
    if share is None:
        return mechanism
    tendons = tuple(
        replace(
            each,
            tendon=replace(
                each.tendon,
                relaxing_stiffness_N_per_m=share * each.tendon.stiffness_N_per_m,
                relaxation_time_s=each.tendon.relaxation_time_s if time_s is None else time_s,
            ),
        )
        for each in mechanism.tendons
    )
    return replace(mechanism, tendons=tendons)


def require_loop(mechanism: Mechanism, file: str) -> None:
    """Refuse a mechanism that is no loop, or has no friction to begin with."""
    if mechanism.drive.kind != "loop":
        raise ParameterError(
            f"{file}: a pair has no pre-tension that its motors keep; tendonff identify fits both motors together"
        )
    if not Parameter.MU.of(mechanism) > 0:
        raise ParameterError(f"{file} [friction]: mu_dynamic must be > 0 to begin with; 0.15 is a usual value")
