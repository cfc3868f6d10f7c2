"""The numbers that identification looks for, in one list: fit, file, report and advice all read it.

An entry says where the number stands in the scenario, and how tensions at the ends of a tendon, or motors, tell it. A
number of the undivided tendon that a fit shall find as well needs nothing but its entry, if `ChainNumber` has it, and
one of a joint or drive nothing but its entry, if the scenario has its key. The tendons of a loop have a number alike,
which one torque tells; where several motors feel them, each tendon, motor and joint has its own.
"""

from dataclasses import dataclass
from enum import ReprEnum
from typing import Any, TypeAlias

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.searches import ByMotors, ByTensions, Role, Scale
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.transmission import LARGEST_EXPONENT
from tendonff.ocp.fits.chain import Reading
from tendonff.ocp.fits.entries import Entry
from tendonff.ocp.fits.mechanism import GEAR_SLIP_RAD
from tendonff.ocp.fits.static import StaticParameter
from tendonff.ocp.sensitivity import Parameter as ChainNumber

System: TypeAlias = Mechanism | Finger


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """Particulars of a number.

    Parameters
    ----------
    key : str
        Its place in the scenario, "table.key"; empty where it has none. The table joint is that of the driven joint.
    effect : str
        What a law gains with it, for names of laws.
    tensions : ByTensions, optional
        How tensions at the ends of a tendon tell it.
    motors : ByMotors, optional
        How motors tell it.
    """

    key: str = ""
    effect: str = ""
    tensions: ByTensions | None = None
    motors: ByMotors | None = None


_MU: dict[str, Any] = {"role": Role.CORE, "high": 20.0, "step": 0.2}
_BIAS: dict[str, Any] = {
    "role": Role.CONSTANT,
    "scale": Scale.TENSION,
    "low": -1.0,
    "high": 1.0,
    "step": 0.05,
    "size": 0.05,
    "floor": TUNED.adhesion_floor,
    "advice": "not separable from load-independent friction and the other cell's offset; read both cells with a slack "
    "tendon",
}
_POSITIVE: dict[str, Any] = {"scale": Scale.START, "high": 30.0}
_STOP: dict[str, Any] = {"role": Role.STOP, "step": 0.05, "floor": 1e-3}

_NO_RELAXATION = "the holds show no relaxation beyond the noise; use larger steps before longer holds"
_HELD_PUSH = "add a push against a stop that is held for some relaxation times"
_PUSH = "push slowly against a stop until a tendon is slack, and on as far again"
ANGLE_OR_PUSH = f"log the angle of the joint (joint_rad), or {_PUSH}"
"""Measurement that tells the lost motion of a loop."""

_STROKES = "add strokes over the whole range, both ways"
_REVERSALS = "add small reversals in free motion"


class Parameter(Entry[Spec], ReprEnum):
    """The list; values are names of estimates, in the order of the report."""

    MU = (
        "mu_dynamic",
        Spec(
            key="friction.mu_dynamic",
            tensions=ByTensions(**_MU, floor=0.0005, static=StaticParameter.PULL),
            motors=ByMotors(
                role=Role.CORE,
                shared="mu",
                **_POSITIVE,
                prior_apart=0.7,
                floor=0.008,
                advice=_PUSH,
                advice_apart="strokes of this tendon's joints over their range, both ways",
            ),
        ),
    )
    MU_RELEASE = (
        "mu_dynamic_release",
        Spec(
            key="friction.mu_dynamic_release",
            tensions=ByTensions(**_MU, floor=0.0008, static=StaticParameter.RELEASE),
        ),
    )
    # mu_static/mu_dynamic - 1 in both directions
    STATIC_EXCESS = (
        "static_excess",
        Spec(
            effect="Stribeck effect",
            tensions=ByTensions(
                role=Role.SPEED, scale=Scale.ABSOLUTE, high=3.0, step=0.1, nudge=0.02, size=0.2, may_vanish=True
            ),
        ),
    )
    STRIBECK_VELOCITY = (
        "stribeck_velocity_m_per_s",
        Spec(
            key="friction.stribeck_velocity_m_per_s",
            tensions=ByTensions(role=Role.KEPT, high=20.0, number=ChainNumber.STRIBECK_VELOCITY),
        ),
    )
    VISCOUS = (
        "viscous_N_s_per_m",
        Spec(
            key="friction.viscous_N_s_per_m",
            effect="viscous friction",
            tensions=ByTensions(
                role=Role.SPEED,
                scale=Scale.ABSOLUTE,
                high=1e6,
                step=1.0,
                number=ChainNumber.VISCOUS,
                may_vanish=True,
                advice="add faster strokes (10 times)",
            ),
        ),
    )
    BRISTLE = (
        "soft_bristle_stiffness_N_per_m",
        Spec(
            key="friction.soft_bristle_stiffness_N_per_m",
            tensions=ByTensions(
                role=Role.CORE,
                floor=0.0025,
                alike=3.0,
                number=ChainNumber.BRISTLE_STIFFNESS,
                static=StaticParameter.BRISTLE,
                advice="add small reversals that do not reach gross sliding",
            ),
            motors=ByMotors(
                role=Role.CORE,
                shared="bristle_stiffness",
                apart=False,
                scale=Scale.START,
                high=8.0,
                step=0.7,
                prior=1.0,
                floor=0.03,
                of_force=True,
                advice=_REVERSALS,
            ),
        ),
    )
    ADHESION = (
        "adhesion_N",
        Spec(
            key="friction.adhesion_N",
            effect="load-independent friction",
            tensions=ByTensions(
                role=Role.CONSTANT,
                scale=Scale.TENSION,
                high=20.0,
                step=0.05,
                nudge=0.05,
                size=0.05,
                floor=TUNED.adhesion_floor,
                number=ChainNumber.ADHESION,
                static=StaticParameter.ADHESION,
                may_vanish=True,
                advice="add strokes at low tension",
            ),
            motors=ByMotors(
                role=Role.EXTRA,
                low=0.0,
                step=1.0,
                of_force=True,
                advice="push until a tendon is slack at another pre-tension too",
            ),
        ),
    )
    LOAD_EXPONENT = (
        "load_exponent",
        Spec(
            key="friction.load_exponent",
            effect="load exponent",
            tensions=ByTensions(
                role=Role.LOAD,
                scale=Scale.ABSOLUTE,
                low=1e-4,
                high=LARGEST_EXPONENT,
                step=0.1,
                nudge=0.1,
                size=0.1,
                number=ChainNumber.LOAD_EXPONENT,
                may_vanish=True,
                advice="add strokes over a wider range of tensions",
            ),
        ),
    )
    STIFFNESS = (
        "stiffness_N_per_m",
        Spec(
            key="tendon.stiffness_N_per_m",
            tensions=ByTensions(
                role=Role.TENDON,
                step=0.2,
                floor=0.0005,
                number=ChainNumber.STIFFNESS,
                advice="the elongation does not follow the tension; check the positions' units, sign and zero drift",
            ),
            motors=ByMotors(
                role=Role.CORE,
                shared="stiffness",
                **_POSITIVE,
                prior_apart=0.7,
                floor=0.006,
                of_force=True,
                advice=_PUSH,
                advice_apart="the same motion at a higher level of tension, and the angles of the joints "
                "(joint_NAME_rad)",
            ),
        ),
    )
    RELAXING = (
        "relaxing_stiffness_N_per_m",
        Spec(
            key="tendon.relaxing_stiffness_N_per_m",
            tensions=ByTensions(
                role=Role.TENDON, floor=0.001, number=ChainNumber.RELAXING_STIFFNESS, advice=_NO_RELAXATION
            ),
        ),
    )
    RELAXING_SHARE = (
        "relaxing_share",
        Spec(
            effect="stress relaxation of the tendons",
            motors=ByMotors(role=Role.EXTRA, low=0.0, high=20.0, step=0.2, floor=0.02, advice=_HELD_PUSH),
        ),
    )
    RELAXATION_TIME = (
        "relaxation_time_s",
        Spec(
            key="tendon.relaxation_time_s",
            tensions=ByTensions(
                role=Role.TENDON, floor=0.0025, number=ChainNumber.RELAXATION_TIME, advice=_NO_RELAXATION
            ),
            motors=ByMotors(role=Role.PARTNER, **_POSITIVE, step=0.5, prior=1.5, floor=0.05, advice=_HELD_PUSH),
        ),
    )
    STIFFENING = (
        "stiffening",
        Spec(
            key="tendon.stiffening",
            effect="stiffness that grows with the tension",
            motors=ByMotors(
                role=Role.EXTRA,
                low=1e-3,
                high=0.95,
                step=0.1,
                floor=0.01,
                advice="the same motion at a higher level of tension",
            ),
        ),
    )
    SECOND_SIDE = (
        "second_side_softer",
        Spec(
            effect="a softer second tendon, as behind a spring",
            motors=ByMotors(role=Role.EXTRA, **_POSITIVE, start=1.0, step=0.3),
        ),
    )
    DAMPING = (
        "damping_N_s_per_m",
        Spec(
            key="tendon.damping_N_s_per_m",
            tensions=ByTensions(
                role=Role.KEPT,
                number=ChainNumber.DAMPING,
                advice="it acts on fast changes only; add excitation above 20 Hz",
            ),
        ),
    )
    TENSION = (
        "pretension_N",
        Spec(
            key="drive.pretension_N",
            motors=ByMotors(
                role=Role.CORE, **_POSITIVE, floor=0.008, of_force=True, advice=_PUSH, advice_apart=_STROKES
            ),
        ),
    )
    COULOMB = (
        "coulomb_N_m",
        Spec(
            key="drive.coulomb_N_m",
            motors=ByMotors(
                role=Role.CORE,
                low=0.0,
                step=0.02,
                floor=0.04,
                of_force=True,
                advice=_REVERSALS,
                advice_apart="small reversals of this motor",
            ),
        ),
    )
    GEAR_SLIP = (
        "gear_slip_rad",
        Spec(
            motors=ByMotors(
                role=Role.CORE,
                scale=Scale.START,
                start=GEAR_SLIP_RAD,
                high=5.0,
                step=0.5,
                prior=0.7,
                floor=0.3,
                advice="it has little effect: not needed",
            ),
        ),
    )
    EFFICIENCY = (
        "gear_efficiency",
        Spec(
            key="drive.gear_efficiency",
            effect="efficiency of the gear",
            motors=ByMotors(role=Role.EXTRA, low=0.3, high=1.0, step=0.05, start=1.0, floor=0.005),
        ),
    )
    BACKLASH = (
        "backlash_rad",
        Spec(
            key="drive.backlash_rad",
            effect="backlash of the gear",
            motors=ByMotors(role=Role.EXTRA, low=0.0, step=5e-3),
        ),
    )
    OFFSET = (
        "torque_offset_N_m",
        Spec(effect="offset of the torque", motors=ByMotors(role=Role.EXTRA, step=0.01, of_force=True)),
    )
    GRAVITY = (
        "gravity_N_m",
        Spec(
            key="joint.gravity_N_m",
            motors=ByMotors(
                role=Role.CORE, step=0.02, floor=0.012, floor_of_friction=0.008, of_force=True, advice=_STROKES
            ),
        ),
    )
    JOINT_STIFFNESS = (
        "joint_stiffness_N_m_per_rad",
        Spec(
            key="joint.stiffness_N_m_per_rad",
            motors=ByMotors(role=Role.CORE, low=0.0, step=0.02, floor=0.008, of_force=True, advice=_STROKES),
        ),
    )
    JOINT_COULOMB = (
        "joint_coulomb_N_m",
        Spec(
            key="joint.coulomb_N_m",
            effect="dry friction of the joint",
            motors=ByMotors(role=Role.EXTRA, low=0.0, step=0.01, of_force=True, cornered=True),
        ),
    )
    STOP_HIGH = "stop_high_rad", Spec(key="joint.stop_high_rad", motors=ByMotors(**_STOP))
    STOP_LOW = "stop_low_rad", Spec(key="joint.stop_low_rad", motors=ByMotors(**_STOP))
    STOP_STIFFNESS = (
        "stop_stiffness_N_m_per_rad",
        Spec(
            key="joint.stop_stiffness_N_m_per_rad",
            motors=ByMotors(
                role=Role.STOP,
                scale=Scale.START,
                high=4.0,
                step=0.7,
                prior=0.5,
                floor=0.5,
                of_force=True,
                advice="it gives way less than the tendons: not needed",
            ),
        ),
    )
    TENSION_AT_START = "start", Spec(motors=ByMotors(role=Role.START, **_POSITIVE))
    INPUT_GAIN = "input_gain", Spec(tensions=ByTensions(role=Role.CELL, number=Reading.INPUT_GAIN))
    OUTPUT_GAIN = "output_gain", Spec(tensions=ByTensions(role=Role.CELL, number=Reading.OUTPUT_GAIN))
    INPUT_BIAS = (
        "input_offset_N",
        Spec(
            effect="input offset",
            tensions=ByTensions(**_BIAS, number=Reading.INPUT, static=StaticParameter.INPUT_BIAS),
        ),
    )
    OUTPUT_BIAS = (
        "output_offset_N",
        Spec(
            effect="output offset",
            tensions=ByTensions(**_BIAS, number=Reading.OUTPUT, static=StaticParameter.OUTPUT_BIAS),
        ),
    )

    @property
    def tensions(self) -> ByTensions:
        """Search by tensions; LookupError where they do not tell it."""
        if self.spec.tensions is None:
            raise LookupError(f"tensions at the ends of a tendon do not tell {self}")
        return self.spec.tensions

    @property
    def motors(self) -> ByMotors:
        """Search by motors; LookupError where they do not tell it."""
        if self.spec.motors is None:
            raise LookupError(f"motors do not tell {self}")
        return self.spec.motors

    def of(self, mechanism: System) -> float:
        """The mechanism's value, of its first tendon; a start where it has none."""
        first = mechanism.tendons[0]
        if self is Parameter.RELAXING_SHARE:
            return first.tendon.relaxing_stiffness_N_per_m / first.tendon.stiffness_N_per_m
        table, _, key = self.spec.key.partition(".")
        if not key:
            return self.motors.start
        holder = mechanism.joints[0] if table == "joint" else getattr(first, table, None) or getattr(mechanism, table)
        value = getattr(holder, key)
        return self.motors.start if value is None else float(value)


BY_TENSIONS = tuple(p for p in Parameter if p.spec.tensions is not None)
MU, MU_RELEASE, STATIC_EXCESS = Parameter.MU, Parameter.MU_RELEASE, Parameter.STATIC_EXCESS
CORE, TENDON, CONSTANTS, SPEED_TERMS, CELL_GAINS = (
    tuple(p for p in BY_TENSIONS if p.tensions.role is role)
    for role in (Role.CORE, Role.TENDON, Role.CONSTANT, Role.SPEED, Role.CELL)
)
BIASES = tuple(p for p in BY_TENSIONS if p.tensions.signed)

BY_MOTORS = tuple(p for p in Parameter if p.spec.motors is not None and p.motors.role is not Role.START)
OF_TENDONS = (Parameter.STIFFENING, Parameter.RELAXING_SHARE, Parameter.ADHESION)
"""Effects that all tendons of several motors are tried with."""
EXTRAS = tuple(p for p in BY_MOTORS if p.motors.role is Role.EXTRA and p is not Parameter.STIFFENING)
"""Effects of a loop, whose tendons have one level of tension."""
PARTNERS = {Parameter.RELAXING_SHARE: (Parameter.RELAXATION_TIME,)}
"""Numbers that mean something beside another one only."""
