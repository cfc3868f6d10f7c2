"""Estimates from a fitted mechanism: each number with its interval, and what follows from all of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from tendonff.compensator.identification.answer.result import Estimate
from tendonff.compensator.identification.constants import TUNED, with_torque_constant
from tendonff.compensator.identification.joint.mechanism_law import MechanismLaw
from tendonff.compensator.identification.joint.parameters import ANGLE_OR_PUSH, NUMBERS, JointNumber
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.fits.least_squares import Solution

N = JointNumber

DERIVED = {
    "mu_theta": "-",
    "tension_over_stiffness_m": "m",
    "lost_motion_rad": "rad",
    "drive_torque_N_m": "N m",
    "motor_friction_N_m": "N m",
}
"""Numbers that follow, and their units: a, T/k, half the lost motion of the joint, 2 a T at the motor, and all friction
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
    tried : tuple of (JointNumber, float, bool)
        Effects beside the core: gain of log-likelihood, and whether it was taken up.
    kept_because : str
        Why mu theta is the scenario's; empty where it was free.
    not_identifiable : tuple of JointNumber
        Numbers that were free, so that the others are right, but of which the moves tell nothing: they stay the
        scenario's.
    alternatives : tuple of JointNumber
        Effects that explain the logs about as well and widen an interval: the covariance reaches those values too.
    """

    law: MechanismLaw
    solution: Solution
    covariance: Array
    tried: tuple[tuple[JointNumber, float, bool], ...]
    kept_because: str
    not_identifiable: tuple[JointNumber, ...] = ()
    alternatives: tuple[JointNumber, ...] = ()

    @property
    def pushed(self) -> bool:
        """A stop was pushed."""
        return N.STOP_LOW in self.names or N.STOP_HIGH in self.names

    @property
    def identified(self) -> dict[JointNumber, float]:
        """Values that `fitted.toml` takes up."""
        values = {N(name): value for name, value in self.solution.values.items()}
        return {k: v for k, v in {**self.law.fixed, **values}.items() if k not in self.not_identifiable}

    @property
    def names(self) -> tuple[JointNumber, ...]:
        """Numbers that were free."""
        return tuple(JointNumber(name) for name in self.solution.values)

    @property
    def reach(self) -> float:
        """Half-width of an interval in standard errors."""
        return float(student.ppf(0.975, max(self.solution.degrees, 1)))


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


def estimates_of(
    scenario: JointScenario, found: Found, *, described: bool
) -> tuple[tuple[Estimate, ...], tuple[str, ...], Array]:
    """Estimates of all numbers and of what follows, the names of the free ones, and their correlation."""
    values = {JointNumber(k): v for k, v in found.solution.values.items()}
    deviation = np.sqrt(np.diag(found.covariance))
    rows = []
    for number in NUMBERS:
        if number in found.not_identifiable:
            rows.append(_kept(scenario, number, f"{found.kept_because}; {_advice(number)}"))
        elif number in values:
            error = float(deviation[found.names.index(number)])
            rows.append(_free(scenario, number, values[number], error, found, described=described))
        elif number in found.law.fixed:
            rows.append(_kept(scenario, number, f"{found.kept_because}; {number.spec.advice}"))
    rows += _derived(found, values, described=described)
    if described:
        rows.append(_scale(scenario, values, found))
    safe = np.where(np.isfinite(deviation) & (deviation > 0), deviation, np.inf)
    correlation = np.where(np.isfinite(found.covariance), found.covariance, 0.0) / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    return tuple(rows), tuple(str(n) for n in found.names), correlation


def _advice(number: JointNumber) -> str:
    """Measurement that tells a number of which the moves tell nothing."""
    return number.spec.advice if number is N.GEAR_SLIP else ANGLE_OR_PUSH


def _own(scenario: JointScenario, number: JointNumber) -> float | None:
    return number.of(scenario.mechanism) if number.spec.key else None


def _free(
    scenario: JointScenario, number: JointNumber, value: float, error: float, found: Found, *, described: bool
) -> Estimate:
    size = abs(value) if number.spec.logarithmic or number.spec.of_force else max(abs(value), number.spec.step)
    at_bound = number in found.solution.at_bound
    identifiable = described and not at_bound and error < TUNED.identifiable_share * size
    by_stop = bool(found.kept_because) and number in (*_BY_A_STOP, N.BRISTLE, N.COULOMB)
    why = "fit of the whole mechanism"
    if by_stop:
        why = f"belongs to the scenario's mu_dynamic: {found.kept_because}; {number.spec.advice}"
    elif at_bound:
        why = f"it ended at a bound of its search; {number.spec.advice or 'longer files'}"
    elif not identifiable:
        why = f"its standard error is {error:.2g} {number.spec.unit}; {number.spec.advice or 'longer files'}"
    elif number.spec.of_force:
        why += ", as measured by the motor: its interval counts 10 % for the torque constant"
    whole, half = _reached(value, error, found, of_force=number.spec.of_force)
    known = identifiable and not by_stop
    return Estimate(
        name=str(number),
        value=value,
        standard_error=whole if np.isfinite(error) else None,
        interval=(value - half, value + half) if known else None,
        interval_as_measured=_interval(value, error, found) if known and number.spec.of_force else None,
        identifiable=identifiable and not by_stop,
        why=why,
        scenario=_own(scenario, number),
        fitted=described,
    )


def _kept(scenario: JointScenario, number: JointNumber, why: str) -> Estimate:
    own = number.of(scenario.mechanism)
    return Estimate(name=str(number), value=own, why=why, scenario=own)


def _reached(value: float, error: float, found: Found, *, of_force: bool) -> tuple[float, float]:
    """Standard error and half of the interval, of a force with the torque constant counted."""
    return with_torque_constant(value, error, found.reach) if of_force else (error, found.reach * error)


def _interval(value: float, error: float, found: Found) -> tuple[float, float]:
    return value - found.reach * error, value + found.reach * error


def _derived(found: Found, values: Mapping[JointNumber, float], *, described: bool) -> list[Estimate]:
    """Estimates that follow from the numbers, with the errors that they share."""
    start, law = found.law.logs[0].run.start_rad, found.law
    middle = derived(law.at(values), start)
    before = derived(replace(law, fixed={}).at({}), start)
    slopes = np.zeros((len(middle), len(values)))
    for k, (number, value) in enumerate(values.items()):
        if number in (*_BY_A_STOP, N.ADHESION, N.SECOND_SIDE, N.COULOMB, N.EFFICIENCY):
            step = 1e-4 * (abs(value) or number.spec.step)
            slopes[:, k] = (derived(law.at({**values, number: value + step}), start) - middle) / step
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
            why = f"{found.kept_because}; {N.MU.spec.advice}"
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


def _scale(scenario: JointScenario, values: Mapping[JointNumber, float], found: Found) -> Estimate:
    """Measured torque over true torque, if the scenario's gravity is right."""
    own, name = scenario.mechanism.joint.gravity_N_m, "torque_scale"
    if own == 0 or N.GRAVITY not in values:
        why = "nothing of known torque moves; hang a known weight on the joint, and give gravity_N_m"
        return Estimate(name=name, value=1.0, why=why)
    value = values[N.GRAVITY] / own
    error = float(np.sqrt(found.covariance[(k := found.names.index(N.GRAVITY)), k])) / abs(own)
    identifiable = error < TUNED.identifiable_share
    return Estimate(
        name=name,
        value=value,
        standard_error=error,
        interval=_interval(value, error, found) if identifiable else None,
        identifiable=identifiable,
        why="measured gravity over the scenario's: torque constant over the true one, if gravity_N_m is right"
        if identifiable
        else "gravity is too weak beside the friction; hang a known weight on the joint",
        scenario=1.0,
    )
