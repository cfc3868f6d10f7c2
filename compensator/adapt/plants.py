"""The plants that differ from the scenario, on which the self-tuning compensator is tried."""

from dataclasses import dataclass, replace
from enum import StrEnum

from tendonff.ocp.adaptation.tuning import Sensor

SHORT_S = 6.0
"""Least duration of a run [s]: shorter references go forwards and backwards until then."""

DRIFT_S = 60.0
"""Duration of the drift [s]."""


class Change(StrEnum):
    """How a plant's value differs over time."""

    CONSTANT = "constant"  # from the start
    STEP = "step"  # in the middle of the run, at once
    DRIFT = "drift"  # linearly over the whole run


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """One plant: factors on the scenario's values, and what is wrong with the start and the sensor."""

    name: str
    # mu, bristle, stiffness, load: factors on friction coefficients, bristle stiffness, k1 and k2, and k_l
    mu: float = 1.0
    bristle: float = 1.0
    stiffness: float = 1.0
    load: float = 1.0
    # mu_change, load_change: how the factors of mu and load come about
    mu_change: Change = Change.CONSTANT
    load_change: Change = Change.CONSTANT
    start: float = 1.0  # True tension at the start over the one that the controller is told
    offset: float = 0.0  # sensor offset as a share of the range that the measurement covers
    duration_s: float = SHORT_S  # least duration [s]

    @property
    def changes(self) -> bool:
        """Something changes in mid-run."""
        return {self.mu_change, self.load_change} != {Change.CONSTANT}


def friction_off(mu: float) -> Variation:
    """The plant with nothing but the factor `mu` on its friction coefficients."""
    return Variation(name=f"friction {100 * (mu - 1):+.0f} %".replace("-", "\N{MINUS SIGN}"), mu=mu)


def variations(sensor: Sensor) -> tuple[Variation, ...]:
    """The plants of the study, the scenario's own first.

    An offset means nothing for a position that is relative to the start, but drift of its zero does.
    """
    others = tuple(
        replace(one, name=f"{prefix}{one.name} {sign}20 %", mu=mu)
        for mu, prefix in ((1.0, ""), (1.2, "friction +20 %, "))
        for sign, factor in (("\N{MINUS SIGN}", 0.8), ("+", 1.2))
        for one in (
            Variation(name="bristles", bristle=factor),
            Variation(name="tendon", stiffness=factor),
            Variation(name="load", load=factor),
        )
    )
    return (
        Variation(name="as the scenario"),
        *map(friction_off, (0.6, 0.8, 0.9, 1.1, 1.2, 1.4)),
        *others,
        Variation(name="friction steps by +20 %", mu=1.2, mu_change=Change.STEP),
        Variation(name="friction drifts by +30 % in a minute", mu=1.3, mu_change=Change.DRIFT, duration_s=DRIFT_S),
        Variation(name="load steps by \N{MINUS SIGN}33 %", mu=1.2, load=2 / 3, load_change=Change.STEP),
        Variation(name="load steps by +33 %", mu=1.2, load=4 / 3, load_change=Change.STEP),
        Variation(name="start tension 5 % higher", mu=1.2, start=1.05),
        Variation(
            name="sensor offset 1 % of range" if sensor is Sensor.OUTPUT_TENSION else "zero off by 1 % of travel",
            mu=1.2,
            offset=0.01,
        ),
    )
