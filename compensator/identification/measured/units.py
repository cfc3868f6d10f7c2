"""Units of columns in SI, and conversion of currents, torques, angles and speeds to tensions and positions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.files.quantities import (
    ANGLE_UNITS,
    CURRENT_UNITS,
    FORCE_UNITS,
    LENGTH_UNITS,
    SPEED_UNITS,
    TIME_UNITS,
    TORQUE_UNITS,
)
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.scenario.measurement import Measurement

AT_THE_DRIVE = ("input", "actuator_force", "input_position")
"""Columns that a gear lies before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """From a column's numbers to SI.

    Parameters
    ----------
    factor : float
    is_rate : bool
        The column is the rate of the quantity.
    """

    factor: float
    is_rate: bool = False

    def of(self, values: Array, time_s: Array) -> Array:
        """The quantity of a column read at some times."""
        if not self.is_rate:
            return self.factor * values
        steps = np.diff(time_s, prepend=time_s[:1]) * (values + np.concatenate([values[:1], values[:-1]])) / 2
        return np.asarray(self.factor * np.cumsum(np.nan_to_num(steps)))


def conversion(key: str, unit: str, how: Measurement) -> Conversion | None:
    """Factor from a unit to SI for a column; None where it is not known, or needs a radius that is not given."""
    if key == "time" or key.startswith("joint"):
        return _plain(TIME_UNITS if key == "time" else ANGLE_UNITS, unit)
    gear = (how.gear_ratio or 1.0) if key in AT_THE_DRIVE else 1.0
    radius, constant = how.drum_radius_m, how.torque_constant_N_m_per_A
    if key.endswith("position"):
        if radius is not None and unit in ANGLE_UNITS:
            return Conversion(factor=ANGLE_UNITS[unit] * radius / gear)
        if radius is not None and unit in SPEED_UNITS:
            return Conversion(factor=SPEED_UNITS[unit] * radius / gear, is_rate=True)
        return _plain(LENGTH_UNITS, unit)
    if radius is not None and unit in TORQUE_UNITS:
        return Conversion(factor=TORQUE_UNITS[unit] * gear / radius)
    if radius is not None and constant is not None and unit in CURRENT_UNITS:
        return Conversion(factor=CURRENT_UNITS[unit] * constant * gear / radius)
    return _plain(FORCE_UNITS, unit)


def _plain(known: Mapping[str, float], unit: str) -> Conversion | None:
    return Conversion(factor=known[unit]) if unit in known else None
