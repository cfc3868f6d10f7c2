"""Numbers of a mechanism with several motors that identification looks for, by their place in the scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import number_of, with_numbers
from tendonff.ocp.fits.least_squares import Unknown

START = "start"
"""First part of the keys of tensions at the start of a log, which are found beside the numbers."""

BRISTLES = "bristle_stiffness"
"""Factor on the bristles of all tendons: rigs show them by their sum."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number to find.

    Parameters
    ----------
    key : str
        Dotted key of the scenario, or START.LOG.TENDON.
    unit : str
    start : float
        Where its search begins.
    step : float
        Usual step of the search; of the logarithm for the logarithmic ones.
    logarithmic : bool
        Searched by its logarithm, within a factor of 30 either way.
    prior : float
        Standard deviation of the logarithm that is known before, 0 for none.
    floor : float
        Standard error of the method itself, as a share of the value.
    of_force : bool
        A force or torque: known as well as the torque constants.
    advice : str
        Move that identifies it.
    """

    key: str
    unit: str
    start: float
    step: float
    logarithmic: bool = True
    prior: float = 0.0
    floor: float = 0.01
    of_force: bool = False
    advice: str = ""

    @property
    def is_nuisance(self) -> bool:
        """It belongs to a log, not to the mechanism."""
        return self.key.startswith(f"{START}.")

    @property
    def unknown(self) -> Unknown:
        """Bounds and step of its search."""
        if not self.logarithmic:
            low = 0.0 if self.key.endswith("coulomb_N_m") else -np.inf
            return Unknown(name=self.key, start=self.start, low=low, high=np.inf, scale=self.step)
        return Unknown(
            name=self.key,
            start=self.start,
            low=self.start / _FACTOR,
            high=self.start * _FACTOR,
            scale=self.step,
            logarithmic=True,
        )


_FACTOR = 30.0
_STROKES = "strokes of this tendon's joints over their range, both ways"
_LEVELS = "the same motion at a higher level of tension, and the angles of the joints (joint_NAME_rad)"
_LEAST_MU = 0.02


def numbers_of(finger: Finger, logs: Sequence[str], tension_N: Mapping[tuple[str, str], float]) -> tuple[Number, ...]:
    """Numbers to find, in the order of the report; those of the logs last.

    `tension_N` holds by log and tendon about what a tendon that is alone on its motor has at the start.
    """
    found = []
    for tendon in finger.tendons:
        place = f"tendons.{tendon.name}"
        mu = max(tendon.friction.mu_dynamic, _LEAST_MU)
        found.append(
            Number(key=f"{place}.friction.mu_dynamic", unit="-", start=mu, step=0.2, prior=0.7, advice=_STROKES)
        )
    for tendon in finger.tendons:
        key = f"tendons.{tendon.name}.tendon.stiffness_N_per_m"
        stiffness = tendon.tendon.stiffness_N_per_m
        found.append(Number(key=key, unit="N/m", start=stiffness, step=0.2, prior=0.7, of_force=True, advice=_LEVELS))
    for motor in finger.motors:
        place = f"motors.{motor.name}.drive"
        if len(motor.winds) > 1:
            at = motor.drive.pretension_N or 1.0
            found.append(
                Number(key=f"{place}.pretension_N", unit="N", start=at, step=0.2, of_force=True, advice=_STROKES)
            )
        if (scale := sum(tension_N.get((log, name), 0.0) for log in logs for name in motor.winds)) == 0:
            scale = (motor.drive.pretension_N or 1.0) * len(logs)
        step = 0.02 * scale / len(logs) * abs(motor.winding_m[0])
        found.append(
            Number(
                key=f"{place}.coulomb_N_m",
                unit="N m",
                start=max(motor.drive.coulomb_N_m, step),
                step=step,
                logarithmic=False,
                of_force=True,
                floor=0.04,
                advice="small reversals of this motor",
            )
        )
    found.append(
        Number(key=BRISTLES, unit="-", start=1.0, step=0.7, prior=1.0, floor=0.03, advice="add small reversals")
    )
    for joint in finger.joints:
        if joint.gravity_N_m:
            key = f"joints.{joint.name}.gravity_N_m"
            step = 0.1 * abs(joint.gravity_N_m)
            start = joint.gravity_N_m
            found.append(
                Number(key=key, unit="N m", start=start, step=step, logarithmic=False, of_force=True, advice=_STROKES)
            )
    for (log, name), tension in tension_N.items():
        found.append(Number(key=f"{START}.{log}.{name}", unit="N", start=max(tension, 0.1), step=0.2))
    return tuple(found)


def put_into(finger: Finger, values: Mapping[str, float]) -> Finger:
    """The mechanism with numbers by their keys; those of logs are left out."""
    return with_numbers(finger, {key: value for key, value in values.items() if not key.startswith(f"{START}.")})


def scenarios_own(finger: Finger, key: str) -> float | None:
    """Value of a key before the fit."""
    return number_of(finger, key)
