"""`fitted.toml` of a joint: the scenario with what was identified put in."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from tendonff.compensator.identification.answer.result import Estimate
from tendonff.compensator.identification.joint.parameters import JointNumber, key_in
from tendonff.compensator.joint.observer_table import ObserverTable
from tendonff.compensator.joint.scenario.base import with_base
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.scenario.scenario import relative_to_folder
from tendonff.compensator.scenario.tables import toml_value
from tendonff.models.joint.parameters import JointTendon, Mechanism
from tendonff.models.parameters.numbers import FACTORS, keys_of

_PARTS = ("path", "tendon", "friction")
WITH_SPREAD = (JointNumber.MU, JointNumber.TENSION, JointNumber.STIFFNESS, JointNumber.GRAVITY)
"""Numbers whose intervals a design is judged with."""


def fitted_text(scenario: JointScenario, mechanism: Mechanism, estimates: Sequence[Estimate]) -> str:
    """Text of the scenario with a mechanism's numbers, and its intervals as [robust.spread]."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, fitted"
    name, joint = mechanism.joint.name, _keys(mechanism.joint)
    raw["joints"][name] = {"kind": "driven", **{key: value for key, value in joint.items() if key != "name"}}
    raw["drive"] = _keys(mechanism.drive)
    first = mechanism.tendons[0]
    for part in _PARTS:
        raw[part] = _part(first, part)
    for row, tendon in zip(raw["tendons"], mechanism.tendons, strict=True):
        for part in _PARTS:
            row.pop(part, None)
            if getattr(tendon, part) != getattr(first, part):
                row[part] = _part(tendon, part)
    if spread := _spread(mechanism, estimates):
        robust = {key: value for key, value in raw.get("robust", {}).items() if key not in FACTORS}
        raw["robust"] = {**robust, "spread": {**robust.get("spread", {}), **spread}}
    raw["run"]["level"] = "presliding"
    return to_toml(raw)


def observer_text(scenario: JointScenario, table: ObserverTable) -> str:
    """Text of the scenario with fitted laws of an observer."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, observed"
    raw["observer"] = _keys(table)
    return to_toml(raw)


def _spread(mechanism: Mechanism, estimates: Sequence[Estimate]) -> dict[str, float]:
    """Relative half-widths of the intervals of numbers that the scenario has, by their keys."""
    known, found = keys_of(mechanism), {}
    for number in WITH_SPREAD:
        one = next((e for e in estimates if e.name == number and e.interval is not None), None)
        key = key_in(mechanism, number)
        if one is not None and one.interval is not None and one.value and key in known:
            half = (one.interval[1] - one.interval[0]) / 2 / abs(one.value)
            found[key] = round(min(max(half, 1e-4), 0.99), 4)
    return found


def moved_files(text: str, source: Path, folder: Path) -> str:
    """The text with the files that it names found from another folder."""
    raw = tomllib.loads(text)

    def moved(table: object) -> None:
        if isinstance(table, dict):
            for key, value in table.items():
                if key in ("file", "lengths", "base") and isinstance(value, str):
                    table[key] = relative_to_folder(source.parent / value, folder)
                else:
                    moved(value)
        elif isinstance(table, list):
            for each in table:
                moved(each)

    moved(raw)
    return to_toml(raw)


def _keys(instance: Any) -> dict[str, object]:
    pairs = ((field.name, getattr(instance, field.name)) for field in fields(instance))
    return {key: value for key, value in pairs if value not in (None, ())}


def _part(tendon: JointTendon, part: str) -> dict[str, object]:
    found = _keys(getattr(tendon, part))
    if part == "path" and tendon.path.sections:
        found["sections"] = [_keys(section) for section in tendon.path.sections]
        del found["total_angle_rad"]
    return found


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
