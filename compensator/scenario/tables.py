"""From a TOML table to a frozen dataclass, with messages for people.

The dataclass is the single source: its fields are the keys, their annotations the types, its docstring their meaning,
and its `__post_init__` the bounds. Nothing is repeated here.
"""

import dataclasses
import functools
import json
import operator
import re
from collections.abc import Mapping
from difflib import get_close_matches
from enum import StrEnum
from inspect import cleandoc
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter, ValidationError

from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.models.parameters import Actuator
from tendonff.models.parameters.drive import Motor, Rope

T = TypeVar("T")

ROPE_KEYS = tuple(field.name for field in dataclasses.fields(Rope))  # of [tendon], which `expand` resolves
NO_STRIBECK_VELOCITY_M_PER_S = 0.01  # stands in where mu_static = mu_dynamic, so that it has no effect
NO_RELAXATION_TIME_S = 1.0  # stands in where nothing relaxes, so that it has no effect


def read_table(cls: type[T], raw: object, *, file: str, table: str, extra_keys: tuple[str, ...] = ()) -> T:
    """Build the frozen dataclass `cls` from what tomllib read; `extra_keys`, such as `kind`, were read already.

    InputError `file [table]: message` for an unknown key, a missing one, a wrong type or a value out of bounds.
    """
    check_names(cls, raw, file=file, table=table, extra_keys=extra_keys)
    keys = {key: value for key, value in dict(raw).items() if key not in extra_keys}  # type: ignore[call-overload]
    for name, part in _tables_within(cls).items():
        if name in keys:  # for a message that names the inner table
            read_table(part, keys[name], file=file, table=f"{table}.{name}")
    try:
        # JSON has lists and text where Python has tuples and enums, as TOML has; else text is no number, true is not 1.
        # A date, which JSON has not, becomes what no key may be.
        return TypeAdapter(cls).validate_json(json.dumps(keys, default=lambda _: {}), strict=True)
    except ValidationError as error:
        raise InputError(f"{file} [{table}]: {_explain(cls, keys, error)}") from None


def read_kind(kinds: Mapping[str, type[T]], raw: object, *, file: str, table: str) -> T:
    """Build the dataclass that the key `kind` of a table names; InputError as `read_table`."""
    if isinstance(raw, Mapping):
        kind, known = raw.get("kind"), ", ".join(f'"{kind}"' for kind in kinds)
        if kind is None:
            raise InputError(f'{file} [{table}]: key "kind" is missing; it is one of {known}')
        if not isinstance(kind, str) or kind not in kinds:
            raise InputError(f"{file} [{table}]: kind must be one of {known}, got {show(kind)}")
        return read_table(kinds[kind], raw, file=file, table=table, extra_keys=("kind",))
    raise InputError(f"{file}: {table} must be a table, got {show(raw)}; write [{table}] on a line of its own")


def check_names(cls: type, raw: object, *, file: str, table: str, extra_keys: tuple[str, ...] = ()) -> None:
    """Refuse what is no table, and keys known neither to the dataclass nor as `extra_keys`."""
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: {table} must be a table, got {show(raw)}; write [{table}] on a line of its own")
    known = [*(field.name for field in dataclasses.fields(cls)), *extra_keys]
    for key in raw:
        if key not in known:
            raise InputError(f'{file} [{table}]: unknown key "{key}"{suggestion(key, known)}')


def missing_keys(cls: type, raw: Mapping[str, object]) -> list[str]:
    """Keys without a default that a table lacks."""
    return [
        field.name
        for field in dataclasses.fields(cls)
        if field.name not in raw
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    ]


def _tables_within(cls: type) -> dict[str, type]:
    """Fields that are tables of their own, by name."""
    found: dict[str, type] = {}
    for name, hint in get_type_hints(cls).items():
        parts = get_args(hint) if get_origin(hint) in (UnionType, Union) else (hint,)
        for part in parts:
            if dataclasses.is_dataclass(part) and isinstance(part, type):
                found[name] = part
    return found


def show(value: object) -> str:
    """A value as the user wrote it, with the name of its type."""
    if isinstance(value, str):
        return f'"{value[:40]}" (text)'
    if isinstance(value, bool):
        return f"{str(value).lower()} (true/false)"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        return "a list"
    return str(value)[:40]


def toml_value(value: object) -> str:
    """A scalar or a tuple of scalars as TOML; floats read back as the same double."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):  # a StrEnum too
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        return f"[{', '.join(toml_value(item) for item in value)}]"
    if isinstance(value, int | float):
        return repr(value)
    raise TypeError(f"{type(value).__name__} cannot be written to a scenario file")


def toml_table(instance: object, name: str = "", *, without: tuple[str, ...] = ()) -> str:
    """All keys of a dataclass that are set, one per line, and then the tables within it, as "name.key".

    Keys `without` are left out: they follow from others.
    """
    pairs = [(field.name, getattr(instance, field.name)) for field in dataclasses.fields(instance)]  # type: ignore[arg-type]
    given = [(key, value) for key, value in pairs if value not in (None, ()) and key not in without]
    inner = [(f"{name}.{key}", value) for key, value in given if dataclasses.is_dataclass(value)]
    lines = [f"{key} = {toml_value(value)}\n" for key, value in given if not dataclasses.is_dataclass(value)]
    return "".join(lines) + "".join(f"\n[{table}]\n{toml_table(value, table)}" for table, value in inner)


def set_keys(record: Any) -> dict[str, object]:
    """Keys and values of a record of the scenario that say something."""
    pairs = ((field.name, getattr(record, field.name)) for field in dataclasses.fields(record))
    return {key: value for key, value in pairs if value not in (None, ())}


def to_toml(raw: Mapping[str, object]) -> str:
    """Plain tables as TOML: scalars and lists first, then tables and rows of tables."""
    return "".join(_lines(raw, "")).lstrip("\n")


def _lines(table: Mapping[str, object], name: str) -> list[str]:
    lines, later = [], []
    for key, value in table.items():
        path = f"{name}.{key}" if name else key
        if isinstance(value, Mapping):
            later += [f"\n[{path}]\n", *_lines(value, path)]
        elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
            for each in value:
                later += [f"\n[[{path}]]\n", *_lines(each, path)]
        else:
            lines.append(f"{_bare(key)} = {toml_value(_tuples(value))}\n")
    return lines + later


def _bare(key: str) -> str:
    """A key as TOML writes it."""
    return key if key.replace("-", "_").isidentifier() else toml_value(key)


def _tuples(value: object) -> object:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def descriptions(cls: type) -> dict[str, str]:
    """Meaning of each field: the `Parameters` section of the numpydoc docstring."""
    found: dict[str, str] = {}
    section = cleandoc(cls.__doc__ or "").partition("Parameters\n----------\n")[2]
    for names, text in re.findall(r"^(\w[\w, ]*?)(?: : .*)?\n((?:[ ]+.*(?:\n|$))+)", section, flags=re.MULTILINE):
        for name in names.split(","):
            found[name.strip()] = " ".join(text.split()).rstrip(".")
    return found


def _explain(cls: type, keys: Mapping[str, object], error: ValidationError) -> str:
    """The first thing that is wrong with the keys, in words: a missing key before a wrong type, that before a bound."""
    problems = error.errors(include_url=False)
    missing = [str(problem["loc"][0]) for problem in problems if problem["type"] == "missing"]
    if missing:
        what = descriptions(cls).get(missing[0])
        others = f"; also missing: {', '.join(missing[1:])}" if missing[1:] else ""
        return f'key "{missing[0]}" is missing{f" ({what})" if what else ""}{others}'
    problem = problems[0]
    if problem["type"] == "value_error":  # what the dataclass itself refuses
        return str(problem["ctx"]["error"])
    name, *items = problem["loc"]
    key = f"{name}{''.join(f'[{k}]' for k in items)}"
    value: Any = functools.reduce(operator.getitem, problem["loc"], keys)  # type: ignore[arg-type]
    annotation = get_type_hints(cls)[str(name)]
    return f"{key} must be {_wanted(annotation, item=bool(items))}, got {show(value)}{_meant(annotation, value)}"


def _meant(annotation: Any, value: object) -> str:
    """The member of an enum that a wrong text comes close to, or where an interval goes; else empty."""
    is_interval = (isinstance(value, list) and len(value) == 2) or (isinstance(value, str) and " to " in value)
    if _wanted(annotation, item=False) == "a number" and is_interval:
        return "; an interval goes into [robust.spread], as its dotted key = [low, high]"
    parts = [annotation, *get_args(annotation)]
    members = [str(m) for part in parts if isinstance(part, type) and issubclass(part, StrEnum) for m in part]
    near = get_close_matches(value, members, n=1) if isinstance(value, str) else []
    return f', did you mean "{near[0]}"?' if near else ""


def _wanted(annotation: Any, *, item: bool) -> str:
    """A type in words."""
    if get_origin(annotation) in (UnionType, Union):
        return _wanted(next(part for part in get_args(annotation) if part is not NoneType), item=item)
    if get_origin(annotation) is tuple:
        inner = _wanted(get_args(annotation)[0], item=False)
        return inner if item else f"a list, each {inner}"
    if isinstance(annotation, type) and issubclass(annotation, StrEnum):
        return " or ".join(f'"{member}"' for member in annotation)
    words = {float: "a number", int: "a whole number", str: 'text in quotes ("...")', bool: "true or false"}
    return words.get(annotation, str(annotation))


def expand(table: str, raw: Mapping[str, object], *, file: str) -> dict[str, object]:
    """The keys of a table, as they were written, with what follows from them; InputError where those are wrong.

    What users have instead of what the model needs: the tendon's modulus and section stand for its stiffness, its
    density for its mass, the motor for the actuator's mass, force and speed; a value without effect need not be given.
    A key that is given beside what it follows from is refused: of two sources one would be ignored.
    """
    keys = dict(raw)
    match table:
        case "tendon":
            _expand_tendon(keys, file)
        case "friction":
            _expand_friction(keys)
        case "actuator":
            motor = keys.get("motor")
            if isinstance(motor, Mapping):
                own, outer = ({each.name for each in dataclasses.fields(kind)} for kind in (Motor, Actuator))
                for key in motor:
                    if key in outer - own:
                        raise InputError(f"{file} [actuator.motor]: {key} belongs to [actuator], one table above")
                drive = read_table(Motor, motor, file=file, table="actuator.motor")
                for key, value in drive.at_the_drum.items():
                    _follow(keys, key, value, "[actuator.motor]", where=f"{file} [{table}]")
    return keys


def _expand_tendon(keys: dict[str, object], file: str) -> None:
    given = {name: keys.pop(name) for name in ROPE_KEYS if name in keys}
    if given:
        rope = read_table(Rope, given, file=file, table="tendon")
        area = "diameter_m" if rope.cross_section_m2 is None else "cross_section_m2"
        where = f"{file} [tendon]"
        _follow(
            keys, "stiffness_N_per_m", rope.stiffness_N_per_m, f"elastic_modulus_Pa, length_m and {area}", where=where
        )
        if rope.mass_kg is not None:
            _follow(keys, "mass_kg", rope.mass_kg, f"density_kg_per_m3, length_m and {area}", where=where)
    if keys.get("relaxing_stiffness_N_per_m") == 0:
        keys.setdefault("relaxation_time_s", NO_RELAXATION_TIME_S)


def _follow(keys: dict[str, object], key: str, value: float, source: str, *, where: str) -> None:
    """Set a key that follows from others; InputError where it is given too."""
    if key in keys:
        raise InputError(
            f"{where}: two sources for one quantity: {key} = {show(keys[key])}, and {value:.6g} from {source}; "
            "leave one of them out"
        )
    keys[key] = value


def _expand_friction(keys: dict[str, object]) -> None:
    if "mu_dynamic" not in keys:
        return
    dynamic, release = keys["mu_dynamic"], keys.get("mu_dynamic_release", keys["mu_dynamic"])
    static = keys.setdefault("mu_static", dynamic)
    if not (_weakens(dynamic, static) or _weakens(release, keys.get("mu_static_release"))):
        keys.setdefault("stribeck_velocity_m_per_s", NO_STRIBECK_VELOCITY_M_PER_S)


def _weakens(dynamic: object, static: object) -> bool:
    """Whether friction weakens with speed; what is no coefficient is for the table's own check to refuse."""
    return isinstance(dynamic, int | float) and isinstance(static, int | float) and static > dynamic >= 0
