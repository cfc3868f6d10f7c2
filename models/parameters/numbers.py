"""Numbers of a transmission by the dotted keys of the scenario file, and the same transmission with others.

A key is `table.name` ("load.stiffness_N_per_m"), `actuator.motor.name`, or `path.sections.SECTION.name`. Three more
stand for a factor on several numbers at once, 1 as they are: `mu` (all friction coefficients, of sections too),
`stiffness` (all stiffnesses of the tendon) and `bristle_stiffness` (of all levels).
"""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from types import UnionType
from typing import Any, get_args, get_type_hints

from tendonff.models.errors import ParameterError
from tendonff.models.parameters.transmission import Actuator, Transmission
from tendonff.models.path import COEFFICIENTS, Section

FACTORS = ("mu", "stiffness", "bristle_stiffness")
"""Keys that are factors [-]."""

_TABLES = ("path", "tendon", "friction", "actuator", "load")
_STATIC_OF = {"mu_dynamic": "mu_static", "mu_dynamic_release": "mu_static_release"}


def keys_of(transmission: Transmission) -> list[str]:
    """Every key of a transmission; a number that is not set, such as the drive's dry friction, has a key too."""
    keys = list(FACTORS)
    for table in _TABLES:
        keys += [f"{table}.{name}" for name in _numbers(getattr(transmission, table))]
    if transmission.actuator.motor is not None:
        keys += [f"actuator.motor.{name}" for name in _numbers(transmission.actuator.motor)]
    if transmission.path.sections:
        keys.remove("path.total_angle_rad")  # the sections add up to it
    for section in transmission.path.sections:
        keys += [f"path.sections.{section.name}.{name}" for name in _numbers(section)]
    return keys


def number_of(transmission: Transmission, key: str) -> float | None:
    """The number of a key, 1 for a factor, None where it is not set; KeyError where there is no such key."""
    if key not in keys_of(transmission):
        raise KeyError(key)
    if key in FACTORS:
        return 1.0
    place, name = key.rsplit(".", 1)
    value = getattr(_record(transmission, place), name)
    return None if value is None else float(value)


def is_whole(transmission: Transmission, key: str) -> bool:
    """Whether the number of a key is a whole one."""
    if key in FACTORS:
        return False
    place, name = key.rsplit(".", 1)
    return get_type_hints(type(_record(transmission, place)))[name] is int


def with_numbers(transmission: Transmission, values: Mapping[str, float]) -> Transmission:
    """The transmission with other numbers, by their keys.

    A static coefficient of friction keeps its ratio to the dynamic one, and what the actuator has of its motor follows
    the motor, unless they are given too. Factors act last.

    Raises
    ------
    KeyError
        If there is no such key.
    ParameterError
        If a number is out of its bounds.
    """
    changes: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        number_of(transmission, key)
        if key not in FACTORS:
            place, name = key.rsplit(".", 1)
            changes.setdefault(place, {})[name] = round(value) if is_whole(transmission, key) else value
    changed = transmission
    # Inner tables first: what follows from a motor must not override the actuator's own keys.
    for place, given in sorted(changes.items(), key=lambda item: -item[0].count(".")):
        changed = _replaced(changed, place, _with_followers(_record(transmission, place), given))
    for key in FACTORS:
        if key in values:
            changed = _scaled(changed, key, values[key])
    return changed


def _numbers(record: object) -> list[str]:
    """Names of a record's fields that are numbers."""
    return [
        name
        for name, hint in get_type_hints(type(record)).items()
        if {int, float} & set(get_args(hint) if isinstance(hint, UnionType) else (hint,))
    ]


def _record(transmission: Transmission, place: str) -> Any:
    table, _, inner = place.partition(".")
    record = getattr(transmission, table)
    if inner == "motor":
        return record.motor
    return next(s for s in record.sections if f"sections.{s.name}" == inner) if inner else record


def _replaced(transmission: Transmission, place: str, given: Mapping[str, float]) -> Transmission:
    table, _, inner = place.partition(".")
    record = getattr(transmission, table)
    if inner == "motor":
        return replace(transmission, actuator=_with_motor(record, given))
    if inner:
        sections = tuple(replace(s, **given) if f"sections.{s.name}" == inner else s for s in record.sections)
        total = math.fsum(section.angle_rad for section in sections)
        return replace(transmission, path=replace(record, sections=sections, total_angle_rad=total))
    return replace(transmission, **{table: replace(record, **given)})


def _with_motor(actuator: Actuator, given: Mapping[str, float]) -> Actuator:
    motor = actuator.motor
    if motor is None:
        raise ParameterError("the actuator has no motor; add [actuator.motor]")
    turned = replace(motor, **given)
    return replace(actuator, motor=turned, **turned.at_the_drum)  # type: ignore[arg-type]


def _with_followers(record: Any, given: Mapping[str, float]) -> dict[str, float]:
    """The numbers with the static coefficients that follow from dynamic ones."""
    followed = dict(given)
    for dynamic, static in _STATIC_OF.items():
        old, its = getattr(record, dynamic, None), getattr(record, static, None)
        if dynamic in given and static not in given and its is not None and old is not None:
            # Equal coefficients stay equal to the last bit: a rounding error is no Stribeck effect.
            followed[static] = given[dynamic] if old in (its, 0) else its * (given[dynamic] / old)
    return followed


def _scaled(transmission: Transmission, key: str, factor: float) -> Transmission:
    """The transmission with one of `FACTORS`."""
    friction = transmission.friction
    if key == "stiffness":
        return replace(transmission, tendon=transmission.tendon.scaled(factor))
    if key == "bristle_stiffness":
        names = ("bristle_stiffness_N_per_m", "soft_bristle_stiffness_N_per_m")
        scaled = {name: getattr(friction, name) * factor for name in names}
        return replace(transmission, friction=replace(friction, **scaled))
    sections = tuple(_with_coefficients(section, factor) for section in transmission.path.sections)
    return replace(
        transmission,
        friction=_with_coefficients(friction, factor),
        path=replace(transmission.path, sections=sections),
    )


def _with_coefficients(record: Any, factor: float) -> Any:
    names = (*COEFFICIENTS, "bearing_exponent") if isinstance(record, Section) else COEFFICIENTS
    given = {f.name: getattr(record, f.name) for f in fields(record) if f.name in names}
    return replace(record, **{name: value * factor for name, value in given.items() if value is not None})


def without_friction(transmission: Transmission) -> Transmission:
    """The transmission with a path that does not rub, mu = 0 and adhesion 0; drive and load keep their friction."""
    bare = _scaled(transmission, "mu", 0.0)
    return replace(bare, friction=replace(bare.friction, adhesion_N=0.0))
