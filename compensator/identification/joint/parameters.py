"""The numbers of a joint that identification looks for: each is one entry, which fit, file, report and advice read."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from typing import Self

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.fits.least_squares import Unknown
from tendonff.ocp.fits.mechanism import GEAR_SLIP_RAD


class Role(StrEnum):
    """When a number is free."""

    CORE = "always"
    STOP = "where the joint ran into a stop"
    EXTRA = "where the data support it"
    PARTNER = "beside the number that it belongs to"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSpec:
    """Everything that is particular to one number.

    Parameters
    ----------
    unit : str
    role : Role
    key : str
        Its place in the scenario, "table.key", joint for that of the driven joint; empty where it has none.
    logarithmic : bool
        Searched by its logarithm.
    factor : float
        How far either way, then.
    low, high : float
        Bounds of the others.
    step : float
        Usual step of the search; of the logarithm for the logarithmic ones.
    start : float
        Where an extra number starts that the scenario does not have.
    prior : float
        Standard deviation that is known before, of the logarithm; 0 for none.
    floor : float
        Standard error of the method itself: a share of what is positive or a force, else in the number's unit.
    floor_of_friction : float
        The same as a share of the friction of free strokes, beside which it is seen.
    of_force : bool
        It is a force or torque: known as well as the scale of the measured torque.
    effect : str
        What the law gains with it, for names of laws.
    advice : str
        Which move would identify it.
    """

    unit: str
    role: Role
    key: str = ""
    logarithmic: bool = False
    factor: float = 30.0
    low: float = -np.inf
    high: float = np.inf
    step: float = 0.2
    start: float = 0.0
    prior: float = 0.0
    floor: float = 0.0
    floor_of_friction: float = 0.0
    of_force: bool = False
    effect: str = ""
    advice: str = ""


_PUSH = "push slowly against a stop until a tendon is slack, and on as far again"
ANGLE_OR_PUSH = f"log the angle of the joint (joint_rad), or {_PUSH}"
"""Measurement that tells the lost motion of a loop."""

_STROKE = "add strokes over the whole range, both ways"


class _Specified(str):
    """A name that carries what is particular to it."""

    __slots__ = ("spec",)

    spec: JointSpec

    def __new__(cls, name: str, spec: JointSpec | None = None) -> Self:
        member = str.__new__(cls, name)
        if spec is not None:
            member.spec = spec
        return member


class JointNumber(_Specified, Enum):
    """The list; values are names of estimates, in the order of the report."""

    def __str__(self) -> str:
        return str.__str__(self)

    def __format__(self, format_spec: str) -> str:
        return str.__format__(self, format_spec)

    MU = (
        "mu_dynamic",
        JointSpec(unit="-", role=Role.CORE, key="friction.mu_dynamic", logarithmic=True, floor=0.008, advice=_PUSH),
    )
    TENSION = (
        "pretension_N",
        JointSpec(
            unit="N",
            role=Role.CORE,
            key="drive.pretension_N",
            logarithmic=True,
            floor=0.008,
            of_force=True,
            advice=_PUSH,
        ),
    )
    STIFFNESS = (
        "stiffness_N_per_m",
        JointSpec(
            unit="N/m",
            role=Role.CORE,
            key="tendon.stiffness_N_per_m",
            logarithmic=True,
            floor=0.006,
            of_force=True,
            advice=_PUSH,
        ),
    )
    BRISTLE = (
        "soft_bristle_stiffness_N_per_m",
        JointSpec(
            unit="N/m",
            role=Role.CORE,
            key="friction.soft_bristle_stiffness_N_per_m",
            logarithmic=True,
            factor=8.0,
            step=0.7,
            prior=1.0,
            floor=0.03,
            of_force=True,
            advice="add small reversals in free motion",
        ),
    )
    COULOMB = (
        "coulomb_N_m",
        JointSpec(
            unit="N m",
            role=Role.CORE,
            key="drive.coulomb_N_m",
            low=0.0,
            step=0.02,
            floor=0.04,
            of_force=True,
            advice="add small reversals in free motion",
        ),
    )
    GEAR_SLIP = (
        "gear_slip_rad",
        JointSpec(
            unit="rad",
            role=Role.CORE,
            logarithmic=True,
            start=GEAR_SLIP_RAD,
            factor=5.0,
            step=0.5,
            prior=0.7,
            floor=0.3,
            advice="it has little effect: not needed",
        ),
    )
    GRAVITY = (
        "gravity_N_m",
        JointSpec(
            unit="N m",
            role=Role.CORE,
            key="joint.gravity_N_m",
            step=0.02,
            floor=0.012,
            floor_of_friction=0.008,
            of_force=True,
            advice=_STROKE,
        ),
    )
    STOP_HIGH = (
        "stop_high_rad",
        JointSpec(unit="rad", role=Role.STOP, key="joint.stop_high_rad", step=0.05, floor=1e-3),
    )
    STOP_LOW = (
        "stop_low_rad",
        JointSpec(unit="rad", role=Role.STOP, key="joint.stop_low_rad", step=0.05, floor=1e-3),
    )
    STOP_STIFFNESS = (
        "stop_stiffness_N_m_per_rad",
        JointSpec(
            unit="N m/rad",
            role=Role.STOP,
            key="joint.stop_stiffness_N_m_per_rad",
            logarithmic=True,
            factor=4.0,
            step=0.7,
            prior=0.5,
            floor=0.5,
            of_force=True,
            advice="it gives way less than the tendons: not needed",
        ),
    )
    OFFSET = (
        "torque_offset_N_m",
        JointSpec(unit="N m", role=Role.EXTRA, step=0.01, of_force=True, effect="offset of the torque"),
    )
    EFFICIENCY = (
        "gear_efficiency",
        JointSpec(
            unit="-",
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
        JointSpec(
            unit="N m",
            role=Role.EXTRA,
            key="joint.coulomb_N_m",
            low=0.0,
            step=0.01,
            of_force=True,
            effect="dry friction of the joint",
        ),
    )
    ADHESION = (
        "adhesion_N",
        JointSpec(
            unit="N",
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
        JointSpec(
            unit="rad", role=Role.EXTRA, key="drive.backlash_rad", low=0.0, step=5e-3, effect="backlash of the gear"
        ),
    )
    SECOND_SIDE = (
        "second_side_softer",
        JointSpec(
            unit="-",
            role=Role.EXTRA,
            logarithmic=True,
            start=1.0,
            step=0.3,
            effect="a softer second tendon, as behind a spring",
        ),
    )
    RELAXING = (
        "relaxing_share",
        JointSpec(
            unit="-",
            role=Role.EXTRA,
            low=0.0,
            high=20.0,
            step=0.2,
            floor=0.02,
            effect="stress relaxation of the tendons",
            advice="add a push against a stop that is held for some relaxation times",
        ),
    )
    RELAXATION_TIME = (
        "relaxation_time_s",
        JointSpec(
            unit="s",
            role=Role.PARTNER,
            key="tendon.relaxation_time_s",
            logarithmic=True,
            step=0.5,
            prior=1.5,
            floor=0.05,
            advice="add a push against a stop that is held for some relaxation times",
        ),
    )

    def of(self, mechanism: Mechanism) -> float:
        """The mechanism's value; a start where it has none."""
        if self is JointNumber.RELAXING:
            tendon = mechanism.tendons[0].tendon
            return tendon.relaxing_stiffness_N_per_m / tendon.stiffness_N_per_m
        if not self.spec.key:
            return self.spec.start
        table, _, key = self.spec.key.partition(".")
        first = mechanism.tendons[0]
        holder: object = {
            "friction": first.friction,
            "tendon": first.tendon,
            "drive": mechanism.drive,
            "joint": mechanism.joint,
        }[table]
        value = getattr(holder, key)
        return self.spec.start if value is None else float(value)

    def unknown(self, start: float) -> Unknown:
        """Bounds and step of its search."""
        spec = self.spec
        if not spec.logarithmic:
            at = min(max(start, spec.low), spec.high)
            return Unknown(name=self, start=at, low=spec.low, high=spec.high, scale=spec.step)
        safe = max(start, 1e-9)
        return Unknown(
            name=self, start=safe, low=safe / spec.factor, high=safe * spec.factor, scale=spec.step, logarithmic=True
        )

    def floor(self, value: float) -> float:
        """Standard error of the method itself."""
        share = self.spec.logarithmic or self.spec.of_force
        return self.spec.floor * (abs(value) if share else 1.0)


NUMBERS = tuple(JointNumber)
EXTRAS = tuple(n for n in NUMBERS if n.spec.role is Role.EXTRA)
PARTNERS = {JointNumber.RELAXING: (JointNumber.RELAXATION_TIME,)}
"""Numbers that mean something beside another one only."""

Values = Mapping[JointNumber, float]


_FACTORS = {JointNumber.MU: "mu", JointNumber.STIFFNESS: "stiffness", JointNumber.BRISTLE: "bristle_stiffness"}
"""Numbers that tendons share up to a factor."""


def key_in(mechanism: Mechanism, number: JointNumber) -> str:
    """Dotted key of a number in the scenario; empty where it has none."""
    table, _, key = number.spec.key.partition(".")
    return f"joints.{mechanism.joint.name}.{key}" if table == "joint" else number.spec.key


def put_into(mechanism: Mechanism, values: Values) -> Mechanism:
    """The mechanism with values put in; tendons that differ keep their ratio to the first."""
    n, numbers = JointNumber, dict[str, float]()
    for number, value in values.items():
        if number in _FACTORS:
            numbers[_FACTORS[number]] = value / number.of(mechanism)
        elif number is n.ADHESION:
            numbers |= {f"tendons.{t.name}.friction.adhesion_N": value for t in mechanism.tendons}
        elif number.spec.key and number is not n.RELAXATION_TIME:
            numbers[key_in(mechanism, number)] = value
    changed = _relaxing(with_numbers(mechanism, numbers), values)
    if (softer := values.get(n.SECOND_SIDE, 1.0)) == 1.0:
        return changed
    first, second = changed.tendons
    return replace(changed, tendons=(first, replace(second, tendon=second.tendon.scaled(1 / softer))))


def _relaxing(mechanism: Mechanism, values: Values) -> Mechanism:
    """The mechanism with the relaxation of all tendons that the values hold, a share of their stiffness."""
    share, time_s = values.get(JointNumber.RELAXING), values.get(JointNumber.RELAXATION_TIME)
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
            f"{file}: identification of a joint is for a loop; the motors of a pair feel both ends of one tendon that "
            "passes the joint: describe that in a scenario of one tendon, with the bends of both, and give one motor's "
            "tension as input_tension_N, the other's as output_tension_N, from a log in which one motor holds its "
            "tension and the other moves the joint slowly"
        )
    if not JointNumber.MU.of(mechanism) > 0:
        raise ParameterError(f"{file} [friction]: mu_dynamic must be > 0 to begin with; 0.15 is a usual value")
