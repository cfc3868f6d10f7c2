"""`fitted.toml` of a joint: the scenario with what was identified put in."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tendonff.compensator.compensators.motors.joint import assumed
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD
from tendonff.compensator.identification.answer.result import Estimate
from tendonff.compensator.identification.joint.parameters import JointNumber, key_in
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.driven.common import part_keys
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.scenario import relative_to_folder
from tendonff.compensator.scenario.tables import set_keys, to_toml
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.parameters.numbers import FACTORS, keys_of

_PARTS = ("path", "tendon", "friction")
WITH_SPREAD = (JointNumber.MU, JointNumber.TENSION, JointNumber.STIFFNESS, JointNumber.GRAVITY)
"""Numbers whose intervals a design is judged with."""
_BOTH = (JointNumber.TENSION, JointNumber.STIFFNESS)
_FACTORS = {JointNumber.MU: "mu", JointNumber.STIFFNESS: "stiffness"}
"""Keys of [robust] that stand for a number where the tendons differ in it."""


def fitted_text(scenario: JointScenario, mechanism: Mechanism, estimates: Sequence[Estimate]) -> str:
    """Text of the scenario with a mechanism's numbers, and its intervals as [robust.spread]."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, fitted"
    name, joint = mechanism.joint.name, set_keys(mechanism.joint)
    raw["joints"][name] = {"kind": "driven", **{key: value for key, value in joint.items() if key != "name"}}
    raw["drive"] = set_keys(mechanism.drive)
    first = mechanism.tendons[0]
    for part in _PARTS:
        raw[part] = part_keys(first, part)
    for row, tendon in zip(raw["tendons"], mechanism.tendons, strict=True):
        for part in _PARTS:
            row.pop(part, None)
            if getattr(tendon, part) != getattr(first, part):
                row[part] = part_keys(tendon, part)
    if robust := _robust(mechanism, estimates, raw.get("robust", {})):
        raw["robust"] = robust
    raw["run"]["level"] = "presliding"
    return to_toml(raw)


def observer_text(scenario: JointScenario, table: ObserverTable) -> str:
    """Text of the scenario with fitted laws of an observer."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, observed"
    raw["observer"] = set_keys(table)
    return to_toml(raw)


def _robust(mechanism: Mechanism, estimates: Sequence[Estimate], stated: Mapping[str, Any]) -> dict[str, Any]:
    """[robust] with the interval of every identified number; empty where nothing is identified or stated.

    A number that is not identified has the width that the scenario states or, where it states none, the one that a
    design assumes: a number without a measurement is not known exactly. Pre-tension and stiffness that belong to a kept
    coefficient of friction are known by their ratio, so they vary together.
    """
    by_name = {each.name: each for each in estimates}
    identified = {n: width for n in WITH_SPREAD if (width := _half_width(by_name.get(n))) is not None}
    if not identified and not stated:
        return {}
    known, loose = keys_of(mechanism), assumed(mechanism)
    robust = {key: value for key, value in stated.items() if key != "spread"}
    spread = dict(stated.get("spread", {}))

    def place(number: JointNumber, half_width: float) -> None:
        key = key_in(mechanism, number)
        if key in known:
            spread[key] = half_width
        else:
            robust[_FACTORS[number]] = half_width

    for number, half_width in identified.items():
        key = key_in(mechanism, number)
        spread = {name: value for name, value in spread.items() if key not in map(str.strip, name.split(","))}
        robust.pop(_FACTORS.get(number, ""), None)
        place(number, half_width)
    covered = {key.strip() for name in spread for key in name.split(",")} | {k for k in FACTORS if robust.get(k)}
    widths = {JointNumber.MU: loose.mu, JointNumber.STIFFNESS: loose.stiffness}
    if loose.spread:
        widths[JointNumber.TENSION] = ASSUMED_SPREAD
    kept = [n for n in widths if not {key_in(mechanism, n), _FACTORS.get(n, "")} & covered]
    fitted = [n for n in kept if (one := by_name.get(n)) is not None and one.fitted]
    together = ", ".join(key_in(mechanism, n) for n in _BOTH)
    if JointNumber.MU not in fitted and set(_BOTH) <= set(fitted) and key_in(mechanism, JointNumber.STIFFNESS) in known:
        spread[together] = widths[JointNumber.TENSION]
        kept = [n for n in kept if n not in _BOTH]
    for number in kept:
        place(number, widths[number])
    return {**robust, "spread": spread} if spread else robust


def _half_width(estimate: Estimate | None) -> float | None:
    """Half of the interval over the value; None for a number that is not identified.

    Without the torque constant: where all forces are off alike, the joint stands where it did.
    """
    half = None if estimate is None else estimate.own_half_width
    return None if half is None else round(min(max(half, 1e-4), 0.99), 4)


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
