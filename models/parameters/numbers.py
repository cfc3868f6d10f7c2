"""Numbers of a system by the dotted keys of the scenario file, and the same system with others.

A system is a transmission, or the mechanism of a joint: records whose fields are numbers or further records. A key is
`table.name` ("load.stiffness_N_per_m"), `actuator.motor.name`, `path.sections.SECTION.name`, of a mechanism also
`joints.JOINT.name` and `tendons.TENDON.table.name`; its tables [path], [tendon] and [friction] are those that all
tendons have alike. Three more stand for a factor on several numbers at once, 1 as they are: `mu` (all friction
coefficients, of sections too), `stiffness` (all stiffnesses of the tendons) and `bristle_stiffness` (of all levels).
"""

import functools
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_type_hints

from tendonff.models.parameters.transmission import Transmission
from tendonff.models.path import COEFFICIENTS, Section

FACTORS = ("mu", "stiffness", "bristle_stiffness")
"""Keys that are factors [-]."""

S = TypeVar("S")
"""A system: Transmission or Mechanism."""

_NO_TABLE = ("motion", "lengths")  # records that are no tables of a scenario
_STATIC_OF = {"mu_dynamic": "mu_static", "mu_dynamic_release": "mu_static_release"}


def keys_of(system: object) -> list[str]:
    """Every key of a system; a number that is not set, such as the drive's dry friction, has a key too."""
    places = _places(system)
    return [*FACTORS, *(f"{place}.{name}" for place in places for name in _keys_at(places, place))]


def _keys_at(places: Mapping[str, Any], place: str) -> tuple[str, ...]:
    """Names of the numbers at one place."""
    if place not in places:
        return ()
    record = places[place]
    return tuple(name for name in _numbers(record.__class__) if name != "total_angle_rad" or _turns(record))


def _turns(path: Any) -> bool:
    """Whether the wrap angle of a path is one number: its sections, if it has any, then keep their shares of it."""
    return not path.sections or (path.total_angle_rad > 0 and not any(hasattr(s, "tables") for s in path.sections))


def number_of(system: object, key: str) -> float | None:
    """The number of a key, 1 for a factor, None where it is not set; KeyError where there is no such key."""
    if key not in keys_of(system):
        raise KeyError(key)
    if key in FACTORS:
        return 1.0
    place, name = key.rsplit(".", 1)
    value = getattr(_places(system)[place], name)
    return None if value is None else float(value)


def is_whole(system: object, key: str) -> bool:
    """Whether the number of a key is a whole one."""
    if key in FACTORS:
        return False
    place, name = key.rsplit(".", 1)
    return _hints(_places(system)[place].__class__)[name] is int


def with_numbers(system: S, values: Mapping[str, float]) -> S:
    """The system with other numbers, by their keys.

    A static coefficient of friction keeps its ratio to the dynamic one, sections their shares of the wrap angle, and
    what the actuator has of its motor follows the motor, unless they are given too; motors that wind one tendon keep
    the least tension of all. Factors act last.

    Raises
    ------
    KeyError
        If there is no such key.
    ParameterError
        If a number is out of its bounds.
    """
    if not values:
        return system
    changes: dict[str, dict[str, Any]] = {}
    changed, places = system, _places(system)
    for key, value in values.items():
        if key not in FACTORS:
            place, _, name = key.rpartition(".")
            if name not in _keys_at(places, place):
                raise KeyError(key)
            whole = _hints(places[place].__class__)[name] is int
            changes.setdefault(place, {})[name] = round(value) if whole else value
    # A motor before its actuator, whose own keys override what follows from it; else what all share before one's own.
    for place, given in sorted(changes.items(), key=lambda each: (each[0] != "actuator.motor", each[0].count("."))):
        changed = _replaced(changed, place, _with_followers(places[place], given))
    for key in FACTORS:
        if key in values:
            changed = _scaled(changed, key, values[key])
    return changed


@functools.cache
def _hints(kind: type) -> Mapping[str, Any]:
    """Types of a record's fields."""
    return get_type_hints(kind)


@functools.cache
def _numbers(kind: type) -> tuple[str, ...]:
    """Names of a record's fields that are numbers."""
    return tuple(
        name
        for name, hint in _hints(kind).items()
        if {int, float} & set(get_args(hint) if isinstance(hint, UnionType) else (hint,))
    )


def _inner(record: Any) -> dict[str, Any]:
    """Records inside a record, by their place in it: a field, or a field and the name of one of several."""
    found = dict[str, Any]()
    for field in _tables(record.__class__):
        value = getattr(record, field)
        if isinstance(value, tuple):
            found |= {f"{field}.{each.name}": each for each in value if hasattr(each, "name")}
        elif is_dataclass(value):
            found[field] = value
    return found


@functools.cache
def _tables(kind: type) -> tuple[str, ...]:
    """Fields of a record that may hold a record, or several: not those of numbers alone."""
    plain = {float, int, bool, str, NoneType}
    hints = {name: hint for name, hint in _hints(kind).items() if name in {f.name for f in fields(kind)}}
    return tuple(
        name
        for name, hint in hints.items()
        if name not in _NO_TABLE and not set(get_args(hint) if isinstance(hint, UnionType) else (hint,)) <= plain
    )


def _places(system: object, prefix: str = "") -> dict[str, Any]:
    """Every table of a system, by its place in the scenario file."""
    found: dict[str, Any] = {}
    for name, record in _inner(system).items():
        found |= {prefix + name: getattr(record, "arm", record)}  # a tendon's own keys are those of its arm
        found |= _places(record, f"{prefix}{name}.")
    tendons = getattr(system, "tendons", ())
    for table in ("path", "tendon", "friction"):
        alike = [getattr(each, table) for each in tendons]
        if alike and all(each == alike[0] for each in alike):
            found[table] = alike[0]
            found |= _places(alike[0], f"{table}.")
    return found


def _replaced(record: Any, place: str, given: Mapping[str, Any]) -> Any:
    """A record with other numbers at a place inside it; a motor, sections and tendons take along what follows."""
    if not place:
        if hasattr(record, "arm"):
            return replace(record, arms=(replace(record.arm, **given),))
        return replace(record, **given)
    inner, tendons = _inner(record), getattr(record, "tendons", ())
    if tendons and place.partition(".")[0] in ("path", "tendon", "friction"):
        return replace(record, tendons=tuple(_replaced(each, place, given) for each in tendons))
    name = next(name for name in inner if place == name or place.startswith(f"{name}."))
    changed = _replaced(inner[name], place[len(name) + 1 :], given)
    if name == "motor":
        return replace(record, motor=changed, **changed.at_the_drum)
    field, _, one = name.partition(".")
    if name == "sharing":
        return replace(record, sharing=changed, motors=tuple(_keeping(each, given) for each in record.motors))
    if not one:
        return replace(record, **{field: changed})
    several = tuple(changed if each.name == one else each for each in getattr(record, field))
    more = {"total_angle_rad": math.fsum(each.angle_rad for each in several)} if field == "sections" else {}
    return replace(record, **{field: several}, **more)


def _keeping(motor: Any, sharing: Mapping[str, Any]) -> Any:
    """A motor that keeps, if it winds one tendon, the least tension that all share."""
    if motor.drive.least_tension_N is None or "least_tension_N" not in sharing:
        return motor
    least = max(sharing["least_tension_N"], 1e-9)
    return replace(motor, drive=replace(motor.drive, least_tension_N=least))


def _with_followers(record: Any, given: Mapping[str, float]) -> dict[str, Any]:
    """The numbers with what follows from them: static coefficients from dynamic ones, sections from their sum."""
    followed: dict[str, Any] = dict(given)
    if "total_angle_rad" in given and record.sections:
        share = given["total_angle_rad"] / record.total_angle_rad
        followed["sections"] = tuple(replace(each, angle_rad=share * each.angle_rad) for each in record.sections)
        followed["total_angle_rad"] = math.fsum(each.angle_rad for each in followed["sections"])
    for dynamic, static in _STATIC_OF.items():
        old, its = getattr(record, dynamic, None), getattr(record, static, None)
        if dynamic in given and static not in given and its is not None and old is not None:
            # Equal coefficients stay equal to the last bit: a rounding error is no Stribeck effect.
            followed[static] = given[dynamic] if old in (its, 0) else its * (given[dynamic] / old)
    return followed


def _scaled(system: Any, key: str, factor: float) -> Any:
    """The system with one of `FACTORS`."""
    if hasattr(system, "tendons"):
        return replace(system, tendons=tuple(_scaled(each, key, factor) for each in system.tendons))
    friction = system.friction
    if key == "stiffness":
        return replace(system, tendon=system.tendon.scaled(factor))
    if key == "bristle_stiffness":
        names = ("bristle_stiffness_N_per_m", "soft_bristle_stiffness_N_per_m")
        scaled = {name: getattr(friction, name) * factor for name in names}
        return replace(system, friction=replace(friction, **scaled))
    sections = tuple(_with_coefficients(section, factor) for section in system.path.sections)
    return replace(
        system,
        friction=_with_coefficients(friction, factor),
        path=replace(system.path, sections=sections),
    )


def _with_coefficients(record: Any, factor: float) -> Any:
    names = (*COEFFICIENTS, "bearing_exponent") if isinstance(record, Section) else COEFFICIENTS
    given = {f.name: getattr(record, f.name) for f in fields(record) if f.name in names}
    return replace(record, **{name: value * factor for name, value in given.items() if value is not None})


def without_friction(transmission: Transmission) -> Transmission:
    """The transmission with a path that does not rub, mu = 0 and adhesion 0; drive and load keep their friction."""
    bare: Transmission = _scaled(transmission, "mu", 0.0)
    return replace(bare, friction=replace(bare.friction, adhesion_N=0.0))
