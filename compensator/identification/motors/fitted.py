"""`fitted.toml` of a joint: the scenario with what was identified put in."""

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from tendonff.compensator.compensators.motors.joint import assumed
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD
from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.motors.numbers import key_in
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.driven.common import part_keys
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.tables import set_keys, to_toml
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import FACTORS, keys_of

_PARTS = ("path", "tendon", "friction")
WITH_SPREAD = (Parameter.MU, Parameter.TENSION, Parameter.STIFFNESS, Parameter.GRAVITY)
"""Numbers whose intervals a design is judged with."""
_BOTH = (Parameter.TENSION, Parameter.STIFFNESS)
_FACTORS = {Parameter.MU: "mu", Parameter.STIFFNESS: "stiffness"}
"""Keys of [robust] that stand for a number where the tendons differ in it."""


def fitted_text(
    scenario: JointScenario | FingerScenario, mechanism: Mechanism | Finger, estimates: Sequence[Estimate]
) -> str:
    """Text of the scenario with a mechanism's numbers, and its intervals as [robust]."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, fitted"
    raw["run"]["level"] = "presliding"
    if isinstance(mechanism, Mechanism):
        _put_one(raw, mechanism, estimates)
    else:
        _put_several(raw, scenario, mechanism, estimates)
    return to_toml(raw)


def _put_one(raw: dict[str, Any], mechanism: Mechanism, estimates: Sequence[Estimate]) -> None:
    """Put in a joint whose tendons have their numbers alike."""
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


def _put_several(
    raw: dict[str, Any], scenario: JointScenario | FingerScenario, finger: Finger, estimates: Sequence[Estimate]
) -> None:
    """Put in joints whose tendons and motors have numbers of their own."""
    for row, tendon in zip(raw["tendons"], finger.tendons, strict=True):
        row["name"] = tendon.name
        for part in ("tendon", "friction"):
            row[part] = set_keys(getattr(tendon, part))
    for joint in finger.joints:
        own = {"gravity_N_m": joint.gravity_N_m, "stiffness_N_m_per_rad": joint.stiffness_N_m_per_rad}
        raw["joints"][joint.name] |= {key: value for key, value in own.items() if value}
    scenario.put_motors(raw, finger.motors)
    raw["robust"] = _widest(finger, {e.name: e for e in estimates}, raw.get("robust", {}))


def _widest(finger: Finger, known: Mapping[str, Estimate], stated: Mapping[str, Any]) -> dict[str, Any]:
    """[robust] with the widest interval of friction and of stiffness; what is not identified has the assumed width."""

    def width(key: str) -> float:
        found = _half_width(known[key])
        return ASSUMED_SPREAD if found is None else found

    def widest(key: str) -> float:
        return max(width(f"tendons.{tendon.name}.{key}") for tendon in finger.tendons)

    keys = Parameter.MU.spec.key, Parameter.STIFFNESS.spec.key
    factors = _FACTORS.values()
    spread = {k: v for k, v in stated.get("spread", {}).items() if k not in factors and not k.endswith(keys)}
    for motor in finger.motors:
        if len(motor.winds) > 1:
            key = f"motors.{motor.name}.drive.pretension_N"
            spread[key] = width(key)
    found = {k: v for k, v in stated.items() if k != "spread"}
    found |= {"mu": widest(Parameter.MU.spec.key), "stiffness": widest(Parameter.STIFFNESS.spec.key)}
    return {**found, "spread": spread} if spread else found


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

    def place(number: Parameter, half_width: float) -> None:
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
    widths = {Parameter.MU: loose.mu, Parameter.STIFFNESS: loose.stiffness}
    if loose.spread:
        widths[Parameter.TENSION] = ASSUMED_SPREAD
    kept = [n for n in widths if not {key_in(mechanism, n), _FACTORS.get(n, "")} & covered]
    fitted = [n for n in kept if (one := by_name.get(n)) is not None and one.fitted]
    together = ", ".join(key_in(mechanism, n) for n in _BOTH)
    if Parameter.MU not in fitted and set(_BOTH) <= set(fitted) and key_in(mechanism, Parameter.STIFFNESS) in known:
        spread[together] = widths[Parameter.TENSION]
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
