"""Estimates from a fitted mechanism: each number with its interval, and what follows from all of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from tendonff.compensator.identification.answer.estimate import Estimate, is_known, unit_of
from tendonff.compensator.identification.constants import TUNED, with_torque_constant
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.law import MechanismLaw
from tendonff.compensator.identification.motors.numbers import Number, Values
from tendonff.compensator.identification.parameters import ANGLE_OR_PUSH, Parameter, System
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.parameters.numbers import number_of
from tendonff.ocp.fits.least_squares import Solution

N = Parameter

DERIVED = ("mu_theta", "tension_over_stiffness_m", "lost_motion_rad", "drive_torque_N_m", "motor_friction_N_m")
"""Numbers that follow: a, T/k, half the lost motion of the joint, 2 a T at the motor, and all friction
of a free stroke there, that of the gear included.
"""

_ALONE = {
    False: ("mu_theta", "tension_over_stiffness_m", "drive_torque_N_m"),
    True: ("mu_theta", "tension_over_stiffness_m"),
}
"""Derived numbers that need mu theta or the share of the gear in the friction, by whether a stop was pushed."""

_OF_FORCE = ("drive_torque_N_m", "motor_friction_N_m")
"""Derived numbers that are torques of the motor."""

_BY_A_STOP = (N.MU, N.TENSION, N.STIFFNESS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A fitted law.

    Attributes
    ----------
    law : MechanismLaw
    solution : Solution
    covariance : ndarray, shape (k, k)
        Of the solution's values, with the floor of the method.
    tried : tuple of (Parameter, float, bool), optional
        Effects beside the core: gain of log-likelihood, and whether it was taken up.
    kept_because : str, optional
        Why mu theta is the scenario's; empty where it was free.
    not_identifiable : tuple of str, optional
        Numbers that were free, so that the others are right, but of which the moves tell nothing: they stay the
        scenario's.
    alternatives : tuple of Parameter, optional
        Effects that explain the logs about as well and widen an interval: the covariance reaches those values too.
    lacking : tuple of Parameter, optional
        Effects that would explain the logs better, and are not fitted: the covariance reaches the values with them.
    """

    law: MechanismLaw
    solution: Solution
    covariance: Array
    tried: tuple[tuple[Parameter, float, bool], ...] = ()
    kept_because: str = ""
    not_identifiable: tuple[str, ...] = ()
    alternatives: tuple[Parameter, ...] = ()
    lacking: tuple[Parameter, ...] = ()

    @property
    def pushed(self) -> bool:
        """A stop was pushed."""
        return N.STOP_LOW in self.names or N.STOP_HIGH in self.names

    @property
    def apart(self) -> bool:
        """Each tendon, motor and joint has numbers of its own: one that is not known stays the scenario's."""
        return not isinstance(self.law.mechanism, Mechanism)

    @property
    def identified(self) -> dict[str, float]:
        """Values that `fitted.toml` takes up, of a loop together."""
        return {k: v for k, v in {**self.law.fixed, **self.solution.values}.items() if k not in self.not_identifiable}

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers of the mechanism that were free."""
        return tuple(name for name in self.solution.values if not self.law.numbers[name].of_start)

    @property
    def by_torque(self) -> bool:
        """Forces are as good as torques of motors are known; else as their cells."""
        return not all(log.run.cells for log in self.law.logs)

    @property
    def reach(self) -> float:
        """Half-width of an interval in standard errors."""
        return float(student.ppf(0.975, max(self.solution.degrees, 1)))

    def error(self, name: str) -> float:
        """Standard error of a value."""
        k = list(self.solution.values).index(name)
        return float(np.sqrt(self.covariance[k, k]))


def derived(mechanism: Mechanism, start_rad: float) -> Array:
    """The numbers of `DERIVED` for a mechanism, shape (5,)."""
    law = GrossSliding.of(mechanism, start_rad)
    first = law.tendons[0]
    sheet = data_sheet(law, 0.0)
    exponent = abs(first.signed_exponent(1 if first.arm_m > 0 else -1))
    ratio = law.tension_N / first.stiffness_N_per_m
    held = np.array(sheet.drive_torque_N_m / mechanism.drive.gear_ratio)
    whole = float(mechanism.drive.torque_N_m(held, np.zeros(()), np.ones(())))
    return np.array([exponent, ratio, sheet.lost_motion_rad, float(held), whole])


def estimates_of(system: System, found: Found, *, described: bool) -> tuple[Estimate, ...]:
    """Estimates of all numbers and of what follows, before which the system was the scenario's."""
    values, numbers, rows = found.solution.values, found.law.numbers, []
    for name, number in numbers.items():
        if name in found.not_identifiable:
            rows.append(_kept(system, number, f"{found.kept_because}; {_advice(number)}"))
        elif name in values and not number.of_start:
            rows.append(_free(system, number, values[name], found, described=described))
        elif name in found.law.fixed:
            rows.append(_kept(system, number, f"{found.kept_because}; {number.advice}"))
    if isinstance(system, Mechanism):
        rows += _derived(found, described=described)
        if described:
            rows.append(_scale(system, found))
    return tuple(rows)


def correlation_of(found: Found) -> Array:
    """Correlation of the values of the mechanism, shape (k, k)."""
    own = [list(found.solution.values).index(name) for name in found.names]
    return np.asarray(replace(found.solution, covariance=found.covariance).correlation()[np.ix_(own, own)])


def _advice(number: Number) -> str:
    """Measurement that tells a number of which the moves tell nothing."""
    return number.advice if number.parameter is N.GEAR_SLIP else ANGLE_OR_PUSH


def _own(system: System, number: Number) -> float | None:
    """The scenario's value; None where it has none."""
    if number.name == number.parameter:
        return number.parameter.of(system) if number.parameter.spec.key else None
    return number_of(system, number.name)


def _free(system: System, number: Number, value: float, found: Found, *, described: bool) -> Estimate:
    error, own = found.error(number.name), _own(system, number)
    at_bound = number.name in found.solution.at_bound
    identifiable = described and not at_bound and is_known(error, number.size(value))
    by_stop = bool(found.kept_because) and number.parameter in (*_BY_A_STOP, N.BRISTLE, N.COULOMB)
    why = "fit of the whole mechanism"
    if by_stop:
        why = f"belongs to the scenario's mu_dynamic: {found.kept_because}; {number.advice}"
    elif at_bound:
        why = f"it ended at a bound of its search; {number.advice or 'longer files'}"
    elif not identifiable:
        size = f"{error:.2g} {unit_of(number.name)}".removesuffix(" -")
        why = f"its standard error is {size}; {number.advice or 'longer files'}"
    elif number.search.of_force and found.by_torque:
        why += ", as measured by the motor: its interval counts 10 % for the torque constant"
    whole, half = _reached(value, error, found, of_force=number.search.of_force)
    known = identifiable and not by_stop
    kept = found.apart and not known and own is not None
    return Estimate(
        name=number.name,
        value=own if kept and own is not None else value,
        standard_error=whole if np.isfinite(error) else None,
        interval=(value - half, value + half) if known else None,
        interval_as_measured=_interval(value, error, found) if known and number.search.of_force else None,
        identifiable=known,
        why=why,
        scenario=own,
        fitted=known if found.apart else described,
    )


def _kept(system: System, number: Number, why: str) -> Estimate:
    own = number.parameter.of(system)
    return Estimate(name=number.name, value=own, why=why, scenario=own)


def _reached(value: float, error: float, found: Found, *, of_force: bool) -> tuple[float, float]:
    """Standard error and half of the interval, of a force with the torque constant counted."""
    counted = of_force and found.by_torque
    return with_torque_constant(value, error, found.reach) if counted else (error, found.reach * error)


def _interval(value: float, error: float, found: Found) -> tuple[float, float]:
    return value - found.reach * error, value + found.reach * error


def _derived(found: Found, *, described: bool) -> list[Estimate]:
    """Estimates that follow from the numbers, with the errors that they share."""
    values, law = found.solution.values, found.law
    start = float(law.logs[0].run.start_rad[0])

    def at(law: MechanismLaw, given: Values) -> Array:
        mechanism = law.at(given)
        return derived(mechanism, start) if isinstance(mechanism, Mechanism) else np.zeros(len(DERIVED))

    middle = at(law, values)
    before = at(replace(law, fixed={}), {})
    slopes = np.zeros((len(middle), len(values)))
    for k, (name, value) in enumerate(values.items()):
        if name in (*_BY_A_STOP, N.ADHESION, N.SECOND_SIDE, N.COULOMB, N.EFFICIENCY):
            step = 1e-4 * (abs(value) or law.numbers[name].step)
            slopes[:, k] = (at(law, {**values, name: value + step}) - middle) / step
    known = np.isfinite(np.diag(found.covariance))
    variance = np.diag(slopes[:, known] @ found.covariance[np.ix_(known, known)] @ slopes[:, known].T)
    errors = np.where((slopes[:, ~known] != 0).any(axis=1), np.inf, np.sqrt(variance))
    rows = []
    bounded = any(n in found.solution.at_bound for n in _BY_A_STOP)
    for k, name in enumerate(DERIVED):
        error = float(errors[k])
        if found.not_identifiable and name != "motor_friction_N_m":
            why = f"{found.kept_because}; {ANGLE_OR_PUSH}"
            rows.append(Estimate(name=name, value=float(before[k]), why=why, scenario=float(before[k])))
            continue
        alone = bool(found.kept_because) and name in _ALONE[found.pushed]
        certain = not bounded or name == "motor_friction_N_m"
        identifiable = described and not alone and certain and error < TUNED.identifiable_share * abs(middle[k])
        why = "follows from the fit"
        if alone:
            why = f"{found.kept_because}; {N.MU.motors.advice}"
        elif not identifiable:
            why = "follows from numbers that are not identifiable"
        value = float(middle[k])
        whole, half = _reached(value, error, found, of_force=name in _OF_FORCE)
        rows.append(
            Estimate(
                name=name,
                value=value,
                standard_error=whole if identifiable else None,
                interval=(value - half, value + half) if identifiable else None,
                identifiable=identifiable,
                why=why,
                scenario=float(before[k]),
                fitted=described,
            )
        )
    return rows


def _scale(system: Mechanism, found: Found) -> Estimate:
    """Measured torque over true torque, if the scenario's gravity is right."""
    own, name, values = system.joint.gravity_N_m, "torque_scale", found.solution.values
    if own == 0 or N.GRAVITY not in values:
        why = "nothing of known torque moves; hang a known weight on the joint, and give gravity_N_m"
        return Estimate(name=name, value=1.0, why=why)
    value = values[N.GRAVITY] / own
    error = found.error(N.GRAVITY) / abs(own)
    identifiable = error < TUNED.identifiable_share
    return Estimate(
        name=name,
        value=value,
        standard_error=error if np.isfinite(error) else None,
        interval=_interval(value, error, found) if identifiable else None,
        identifiable=identifiable,
        why="measured gravity over the scenario's: torque constant over the true one, if gravity_N_m is right"
        if identifiable
        else "gravity is too weak beside the friction; hang a known weight on the joint",
        scenario=1.0,
    )
