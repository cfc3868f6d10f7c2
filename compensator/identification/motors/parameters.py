"""The numbers of joints that identification looks for: each is one entry, which fit, file, report and advice read.

The tendons of a loop have a number alike, which one torque tells; where several motors feel them, each tendon, motor
and joint has its own, by its place in the scenario.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import ReprEnum, StrEnum
from typing import Any, TypeAlias, TypeVar

import numpy as np

from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.spec import Scale, Spec
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger, Motor
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.fits.entries import Entry
from tendonff.ocp.fits.least_squares import Unknown
from tendonff.ocp.fits.mechanism import GEAR_SLIP_RAD

System: TypeAlias = Mechanism | Finger
S = TypeVar("S", Mechanism, Finger)


class Role(StrEnum):
    """When a number is free."""

    CORE = "always"
    STOP = "where the joint ran into a stop"
    EXTRA = "where the data support it"
    PARTNER = "beside the number that it belongs to"
    START = "in each log"


@dataclass(frozen=True, slots=True, kw_only=True)
class OfMotors(Spec):
    """Everything that is particular to one number that motors feel.

    Parameters
    ----------
    role : Role
    shared : str
        Factor that scales it on all tendons alike, which may differ in it otherwise.
    apart : bool
        Each tendon, motor and joint has its own where several motors feel them; else it is searched for as a factor.
    start : float
        Where an extra number starts that the scenario does not have.
    prior, prior_apart : float
        Standard deviation that is known before, of the logarithm; 0 for none. The second of each tendon's own.
    floor_of_friction : float
        Floor as a share of the friction of free strokes, beside which it is seen.
    of_force : bool
        It is a force or torque: known as well as the scale of the measured torque.
    cornered : bool
        Its law has a corner at zero, and so no slope.
    advice_apart : str
        Which move would identify each tendon's or motor's own, by default the same.

    Notes
    -----
    The table of `key` is joint for that of the driven joint. `floor` is a share of what is positive or a force, else in
    the number's unit.
    """

    role: Role
    scale: Scale = Scale.ABSOLUTE
    low: float = -np.inf
    high: float = np.inf
    step: float = 0.2
    shared: str = ""
    apart: bool = True
    start: float = 0.0
    prior: float = 0.0
    prior_apart: float = 0.0
    floor_of_friction: float = 0.0
    of_force: bool = False
    cornered: bool = False
    advice_apart: str = ""


_POSITIVE: dict[str, Any] = {"scale": Scale.START, "high": 30.0}
_PUSH = "push slowly against a stop until a tendon is slack, and on as far again"
ANGLE_OR_PUSH = f"log the angle of the joint (joint_rad), or {_PUSH}"
"""Measurement that tells the lost motion of a loop."""

_STROKES = "add strokes over the whole range, both ways"


class Quantity(Entry[OfMotors], ReprEnum):
    """The list; values are names of estimates, in the order of the report."""

    MU = (
        "mu_dynamic",
        OfMotors(
            role=Role.CORE,
            key="friction.mu_dynamic",
            shared="mu",
            **_POSITIVE,
            prior_apart=0.7,
            floor=0.008,
            advice=_PUSH,
            advice_apart="strokes of this tendon's joints over their range, both ways",
        ),
    )
    TENSION = (
        "pretension_N",
        OfMotors(
            role=Role.CORE,
            key="drive.pretension_N",
            **_POSITIVE,
            floor=0.008,
            of_force=True,
            advice=_PUSH,
            advice_apart=_STROKES,
        ),
    )
    STIFFNESS = (
        "stiffness_N_per_m",
        OfMotors(
            role=Role.CORE,
            key="tendon.stiffness_N_per_m",
            shared="stiffness",
            **_POSITIVE,
            prior_apart=0.7,
            floor=0.006,
            of_force=True,
            advice=_PUSH,
            advice_apart="the same motion at a higher level of tension, and the angles of the joints (joint_NAME_rad)",
        ),
    )
    BRISTLE = (
        "soft_bristle_stiffness_N_per_m",
        OfMotors(
            role=Role.CORE,
            key="friction.soft_bristle_stiffness_N_per_m",
            shared="bristle_stiffness",
            apart=False,
            scale=Scale.START,
            high=8.0,
            step=0.7,
            prior=1.0,
            floor=0.03,
            of_force=True,
            advice="add small reversals in free motion",
        ),
    )
    COULOMB = (
        "coulomb_N_m",
        OfMotors(
            role=Role.CORE,
            key="drive.coulomb_N_m",
            low=0.0,
            step=0.02,
            floor=0.04,
            of_force=True,
            advice="add small reversals in free motion",
            advice_apart="small reversals of this motor",
        ),
    )
    GEAR_SLIP = (
        "gear_slip_rad",
        OfMotors(
            role=Role.CORE,
            scale=Scale.START,
            start=GEAR_SLIP_RAD,
            high=5.0,
            step=0.5,
            prior=0.7,
            floor=0.3,
            advice="it has little effect: not needed",
        ),
    )
    GRAVITY = (
        "gravity_N_m",
        OfMotors(
            role=Role.CORE,
            key="joint.gravity_N_m",
            step=0.02,
            floor=0.012,
            floor_of_friction=0.008,
            of_force=True,
            advice=_STROKES,
        ),
    )
    JOINT_STIFFNESS = (
        "joint_stiffness_N_m_per_rad",
        OfMotors(
            role=Role.CORE,
            key="joint.stiffness_N_m_per_rad",
            low=0.0,
            step=0.02,
            floor=0.008,
            of_force=True,
            advice=_STROKES,
        ),
    )
    STOP_HIGH = (
        "stop_high_rad",
        OfMotors(role=Role.STOP, key="joint.stop_high_rad", step=0.05, floor=1e-3),
    )
    STOP_LOW = (
        "stop_low_rad",
        OfMotors(role=Role.STOP, key="joint.stop_low_rad", step=0.05, floor=1e-3),
    )
    STOP_STIFFNESS = (
        "stop_stiffness_N_m_per_rad",
        OfMotors(
            role=Role.STOP,
            key="joint.stop_stiffness_N_m_per_rad",
            scale=Scale.START,
            high=4.0,
            step=0.7,
            prior=0.5,
            floor=0.5,
            of_force=True,
            advice="it gives way less than the tendons: not needed",
        ),
    )
    OFFSET = (
        "torque_offset_N_m",
        OfMotors(role=Role.EXTRA, step=0.01, of_force=True, effect="offset of the torque"),
    )
    EFFICIENCY = (
        "gear_efficiency",
        OfMotors(
            role=Role.EXTRA,
            key="drive.gear_efficiency",
            low=0.3,
            high=1.0,
            step=0.05,
            start=1.0,
            floor=0.005,
            effect="efficiency of the gear",
        ),
    )
    JOINT_COULOMB = (
        "joint_coulomb_N_m",
        OfMotors(
            role=Role.EXTRA,
            key="joint.coulomb_N_m",
            low=0.0,
            step=0.01,
            of_force=True,
            cornered=True,
            effect="dry friction of the joint",
        ),
    )
    ADHESION = (
        "adhesion_N",
        OfMotors(
            role=Role.EXTRA,
            key="friction.adhesion_N",
            low=0.0,
            step=1.0,
            of_force=True,
            effect="load-independent friction",
            advice="push until a tendon is slack at another pre-tension too",
        ),
    )
    BACKLASH = (
        "backlash_rad",
        OfMotors(role=Role.EXTRA, key="drive.backlash_rad", low=0.0, step=5e-3, effect="backlash of the gear"),
    )
    SECOND_SIDE = (
        "second_side_softer",
        OfMotors(
            role=Role.EXTRA,
            **_POSITIVE,
            start=1.0,
            step=0.3,
            effect="a softer second tendon, as behind a spring",
        ),
    )
    RELAXING = (
        "relaxing_share",
        OfMotors(
            role=Role.EXTRA,
            low=0.0,
            high=20.0,
            step=0.2,
            floor=0.02,
            effect="stress relaxation of the tendons",
            advice="add a push against a stop that is held for some relaxation times",
        ),
    )
    STIFFENING = (
        "stiffening",
        OfMotors(
            role=Role.EXTRA,
            key="tendon.stiffening",
            low=1e-3,
            high=0.95,
            step=0.1,
            floor=0.01,
            effect="stiffness that grows with the tension",
            advice="the same motion at a higher level of tension",
        ),
    )
    RELAXATION_TIME = (
        "relaxation_time_s",
        OfMotors(
            role=Role.PARTNER,
            key="tendon.relaxation_time_s",
            **_POSITIVE,
            step=0.5,
            prior=1.5,
            floor=0.05,
            advice="add a push against a stop that is held for some relaxation times",
        ),
    )

    TENSION_AT_START = "start", OfMotors(role=Role.START, **_POSITIVE)

    def of(self, mechanism: System) -> float:
        """The mechanism's value, of its first tendon; a start where it has none."""
        first = mechanism.tendons[0]
        if self is Quantity.RELAXING:
            return first.tendon.relaxing_stiffness_N_per_m / first.tendon.stiffness_N_per_m
        table, _, key = self.spec.key.partition(".")
        if not key:
            return self.spec.start
        holder = mechanism.joints[0] if table == "joint" else getattr(first, table, None) or getattr(mechanism, table)
        value = getattr(holder, key)
        return self.spec.start if value is None else float(value)


QUANTITIES = tuple(q for q in Quantity if q.spec.role is not Role.START)
OF_TENDONS = (Quantity.STIFFENING, Quantity.RELAXING, Quantity.ADHESION)
"""Effects that all tendons of several motors are tried with."""
EXTRAS = tuple(q for q in Quantity if q.spec.role is Role.EXTRA and q is not Quantity.STIFFENING)
"""Effects of a loop, whose tendons have one level of tension."""
PARTNERS = {Quantity.RELAXING: (Quantity.RELAXATION_TIME,)}
"""Numbers that mean something beside another one only."""

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number to find: a quantity at its place.

    Parameters
    ----------
    name : str
        Of its estimate: its quantity, or its key in the scenario where several motors tell each their own.
    quantity : Quantity
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
    quantity: Quantity
    start: float
    step: float
    prior: float
    advice: str
    of_start: str = ""

    @property
    def spec(self) -> OfMotors:
        """Particulars of its quantity."""
        return self.quantity.spec

    def unknown(self, start: float) -> Unknown:
        """Bounds and step of its search."""
        return self.spec.unknown(self.name, start, self.step)

    def around(self, value: float, share: float) -> tuple[float, float]:
        """Values on either side, within its bounds, so many steps away."""
        by = share * self.step * (value if self.spec.logarithmic else 1.0)
        if self.spec.logarithmic:
            return value - by, value + by
        return max(value - by, self.spec.low), min(value + by, self.spec.high)

    def size(self, value: float) -> float:
        """Size that its standard error is judged against."""
        return abs(value) if self.spec.logarithmic or self.spec.of_force else max(abs(value), self.step)

    def floor(self, value: float) -> float:
        """Standard error of the method itself."""
        share = self.spec.logarithmic or self.spec.of_force
        return self.spec.floor * (abs(value) if share else 1.0)


_LEAST_MU = 0.02


def numbers_of(mechanism: System, logs: Sequence[MotorsLog]) -> dict[str, Number]:
    """All numbers that there are, by name, in the order of the report; those of the logs last."""
    alike = (*OF_TENDONS, *PARTNERS[Quantity.RELAXING]) if isinstance(mechanism, Finger) else QUANTITIES
    found = [_number(quantity, str(quantity), quantity.of(mechanism)) for quantity in alike]
    if isinstance(mechanism, Finger):
        apart = (number for quantity in QUANTITIES for number in _apart(mechanism, quantity, logs))
        found = [*apart, *found, *_starts(mechanism, logs)]
    return {number.name: number for number in found}


def _number(quantity: Quantity, name: str, start: float, step: float | None = None, log: str = "") -> Number:
    spec, apart = quantity.spec, name != quantity
    return Number(
        name=name,
        quantity=quantity,
        start=start,
        step=spec.step if step is None else step,
        prior=(spec.prior_apart if apart else 0.0) or spec.prior,
        advice=(spec.advice_apart if apart else "") or spec.advice,
        of_start=log,
    )


def _apart(finger: Finger, quantity: Quantity, logs: Sequence[MotorsLog]) -> Iterator[Number]:
    """A quantity at every place that has one."""
    q, spec = Quantity, quantity.spec
    table, _, key = spec.key.partition(".")
    if spec.role is not Role.CORE or not key:
        return
    if not spec.apart:
        yield _number(quantity, spec.shared, 1.0)
    elif table in ("friction", "tendon"):
        for tendon in finger.tendons:
            at = getattr(getattr(tendon, table), key)
            yield _number(quantity, f"tendons.{tendon.name}.{spec.key}", max(at, _LEAST_MU) if quantity is q.MU else at)
    elif table == "joint":
        for joint in finger.joints:
            if at := getattr(joint, key):
                yield _number(quantity, f"joints.{joint.name}.{key}", at, 0.1 * abs(at))
    else:
        for motor in finger.motors:
            if quantity is q.TENSION and len(motor.winds) == 1:
                continue
            if quantity is q.COULOMB and logs and all(log.run.cells for log in logs):
                continue  # no motor is in the way of its cells
            at, step = getattr(motor.drive, key) or spec.start, None
            if not spec.logarithmic:
                step = spec.step * _held_N(motor, logs) * abs(motor.winding_m[0])
                at = max(at, step)
            yield _number(quantity, f"motors.{motor.name}.drive.{key}", at, step)


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
    quantity = Quantity.TENSION_AT_START
    for log, tendon, tension in told_N(finger.motors, logs):
        yield _number(quantity, start_key(log, tendon), max(tension, 0.1), log=log)


def start_key(log: str, tendon: str) -> str:
    """Name of a tension at the start of a log."""
    return f"{Quantity.TENSION_AT_START}.{log}.{tendon}"


def key_in(mechanism: System, quantity: Quantity) -> str:
    """Dotted key of a quantity in the scenario of one joint; empty where it has none."""
    table, _, key = quantity.spec.key.partition(".")
    return f"joints.{mechanism.joints[0].name}.{key}" if table == "joint" else quantity.spec.key


def put_into(mechanism: S, values: Values) -> S:
    """The mechanism with values put in; tendons that differ keep their ratio to the first."""
    q, numbers = Quantity, dict[str, float]()
    for name, value in values.items():
        if name not in _BY_NAME:
            if not name.startswith(f"{q.TENSION_AT_START}."):
                numbers[name] = value
            continue
        quantity = q(name)
        table = quantity.spec.key.partition(".")[0]
        if quantity.spec.shared:
            numbers[quantity.spec.shared] = value / quantity.of(mechanism)
        elif quantity is q.RELAXATION_TIME:
            continue
        elif table in ("friction", "tendon"):
            numbers |= {f"tendons.{t.name}.{quantity.spec.key}": value for t in mechanism.tendons}
        elif table:
            numbers[key_in(mechanism, quantity)] = value
    changed = _relaxing(with_numbers(mechanism, numbers), values)
    if (softer := values.get(q.SECOND_SIDE, 1.0)) == 1.0:
        return changed
    first, second = changed.tendons
    return replace(changed, tendons=(first, replace(second, tendon=second.tendon.scaled(1 / softer))))


_BY_NAME = frozenset(map(str, Quantity))


def _relaxing(mechanism: S, values: Values) -> S:
    """The mechanism with the relaxation of all tendons that the values hold, a share of their stiffness."""
    share, time_s = values.get(Quantity.RELAXING), values.get(Quantity.RELAXATION_TIME)
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
    if not Quantity.MU.of(mechanism) > 0:
        raise ParameterError(f"{file} [friction]: mu_dynamic must be > 0 to begin with; 0.15 is a usual value")
