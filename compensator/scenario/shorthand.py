"""What users have instead of what the model needs: resolved before a table becomes a dataclass.

The tendon's modulus and section stand for its stiffness, its density for its mass, the motor for the actuator's mass
and force; a value without effect need not be given. A key that is given beside what it could follow from counts.
"""

import dataclasses
from collections.abc import Mapping

from tendonff.compensator.scenario.tables import read_table
from tendonff.models.parameters.drive import Motor, Rope

_ROPE = tuple(field.name for field in dataclasses.fields(Rope))
NO_STRIBECK_VELOCITY_M_PER_S = 0.01
"""Stands in where mu_static = mu_dynamic, so that it has no effect."""
NO_RELAXATION_TIME_S = 1.0
"""Stands in where nothing relaxes, so that it has no effect."""


def expand(table: str, raw: Mapping[str, object], *, file: str) -> dict[str, object]:
    """The keys of a table, as they were written, with what follows from them; InputError where those are wrong."""
    keys = dict(raw)
    match table:
        case "tendon":
            _expand_tendon(keys, file)
        case "friction":
            _expand_friction(keys)
        case "actuator":
            motor = keys.get("motor")
            if isinstance(motor, Mapping):
                drive = read_table(Motor, motor, file=file, table="actuator.motor")
                keys.setdefault("mass_kg", drive.mass_kg)
                keys.setdefault("force_max_N", drive.force_max_N)
                keys.setdefault("speed_max_m_per_s", drive.speed_max_m_per_s)
    return keys


def further_keys(table: str) -> tuple[str, ...]:
    """Keys of a table that `expand` resolves and that its dataclass does not know."""
    return _ROPE if table == "tendon" else ()


def _expand_tendon(keys: dict[str, object], file: str) -> None:
    given = {name: keys.pop(name) for name in _ROPE if name in keys}
    if given:
        rope = read_table(Rope, given, file=file, table="tendon")
        keys.setdefault("stiffness_N_per_m", rope.stiffness_N_per_m)
        if rope.mass_kg is not None:
            keys.setdefault("mass_kg", rope.mass_kg)
    if keys.get("relaxing_stiffness_N_per_m") == 0:
        keys.setdefault("relaxation_time_s", NO_RELAXATION_TIME_S)


def _expand_friction(keys: dict[str, object]) -> None:
    dynamic, release = keys.get("mu_dynamic"), keys.get("mu_dynamic_release")
    steady = keys.get("mu_static") == dynamic and keys.get("mu_static_release", release) == release
    if dynamic is not None and steady:
        keys.setdefault("stribeck_velocity_m_per_s", NO_STRIBECK_VELOCITY_M_PER_S)
