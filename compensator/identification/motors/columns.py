"""Columns of logs of motors: by the contract's names, with other units, or as controllers of hands name them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from tendonff.compensator.files.formats.table import Table
from tendonff.compensator.files.quantities import ANGLE_UNITS, CURRENT_UNITS, TIME_UNITS, TORQUE_UNITS
from tendonff.compensator.files.reading import nearest_column
from tendonff.compensator.files.text import InputError
from tendonff.compensator.identification.measured import Array

LONGEST_STEP_S = 0.05
"""A clock without a unit is in seconds if its rows follow each other faster: in ms they would at over 20 kHz."""

COUNTS = {"counts": 2 * np.pi / 4096, "pulse": 2 * np.pi / 4096}
"""Angle of a count of a servo of the trade, 12 bits a turn [rad]."""

SI = "SI"
"""Unit of a column that the user named and that states none."""

_TORQUES = TORQUE_UNITS | {"N_m": 1.0, "mN_m": 1e-3}
_NUMBER = re.compile(r"([\d.]+(?:[eE][-+]?\d+)?)\s*(\S+)")
_BRACKET = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A quantity of a log.

    Attributes
    ----------
    usual : tuple of str
        Its names in the contract, in SI units.
    stems : mapping of str to str
        Other names, small letters, without their unit, and the unit where a name states none; empty for none.
    units : mapping of str to float
        Known units, and what one of each is in SI.
    """

    usual: tuple[str, ...]
    stems: Mapping[str, str]
    units: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column found for a channel: its name, what one of its numbers is in SI, and a message where not plain."""

    name: str
    factor: float = 1.0
    note: str = ""

    def of(self, table: Table) -> Array:
        """The channel in SI units, shape (rows,)."""
        return self.factor * table.numbers(self.name)


TIME = Channel(usual=("time_s",), stems=dict.fromkeys(("time", "t", "timestamp", "elapsed"), "s"), units=TIME_UNITS)


def _stems(patterns: Mapping[str, str], names: Sequence[str]) -> dict[str, str]:
    return {p.format(n).strip("_").lower(): unit for n in names for p, unit in patterns.items()}


def motor_angle(usual: tuple[str, ...], names: Sequence[str]) -> Channel:
    """Angle of a motor that logs call by one of some names; an empty one for the only motor."""
    patterns = {"motor_{}": "", "{}_motor": "", "mcmd_{}": "rad", "present_position_{}": "counts"}
    return Channel(
        usual=usual, stems=_stems({**patterns, "{}_present_position": "counts"}, names), units=ANGLE_UNITS | COUNTS
    )


def motor_torque(usual: tuple[str, ...], names: Sequence[str]) -> Channel:
    """Torque of a motor."""
    return Channel(usual=usual, stems=_stems({"motor_torque_{}": "", "{}_torque": ""}, names), units=_TORQUES)


def motor_current(usual: tuple[str, ...], names: Sequence[str]) -> Channel:
    """Current of a motor; counts of it differ between servos."""
    patterns = {"motor_current_{}": "", "{}_current": "", "cur_{}": "mA", "present_current_{}": ""}
    return Channel(usual=usual, stems=_stems({**patterns, "{}_present_current": ""}, names), units=CURRENT_UNITS)


def joint_angle(usual: tuple[str, ...], names: Sequence[str]) -> Channel:
    """Angle of a joint."""
    return Channel(usual=usual, stems=_stems({"joint_{}": "", "{}": "", "meas_{}": "deg"}, names), units=ANGLE_UNITS)


def find(table: Table, channel: Channel, file: Path, named: Mapping[str, str] = MappingProxyType({})) -> Column | None:
    """Column of a channel; None for none. The user may have named it: `named` by its names in the contract.

    InputError if two could be meant, or a unit is missing or unknown.
    """
    for usual in channel.usual:
        if (name := named.get(usual)) is not None:
            if name not in table.columns:
                present = (*table.columns, *table.offered)
                raise InputError(f'{file.name}: column "{name}" is missing{nearest_column(name, present)}')
            return _in_unit(name, _stated(table, name, channel)[1] or SI, channel, file)
    for name in channel.usual:
        if name in table.columns:
            return Column(name=name)
    meant = [(name, unit) for name in table.columns if (unit := _unit(table, name, channel)) is not None]
    if not meant:
        return None
    if len(meant) > 1:
        listed = ", ".join(f'"{name}"' for name, _ in meant)
        raise InputError(f'{file.name}: {listed} could be meant by "{channel.usual[0]}"; rename the one that is')
    name, unit = meant[0]
    found = _in_unit(name, unit, channel, file)
    if unit == "counts" and (table.numbers(name) % 1 != 0).any():
        raise InputError(f'{file.name}: column "{name}" is not in counts; put its unit into the name: "{name} [deg]"')
    return found


def _in_unit(name: str, unit: str, channel: Channel, file: Path) -> Column:
    if unit == SI:
        return Column(name=name, note=f'column "{name}" read as {channel.usual[0]}')
    number, word = match.groups() if (match := _NUMBER.fullmatch(unit)) else ("1", unit)
    if word not in channel.units:
        known = next(iter(channel.units))
        raise InputError(
            f'{file.name}: column "{name}" has {f"the unit {unit}" if unit else "no unit"}; put it into the name, as '
            f'"{name} [{known}]", or of counts what one is, as "{name} [0.00269 {known}]"'
        )
    return Column(
        name=name,
        factor=float(number) * channel.units[word],
        note=f'column "{name}" read as {channel.usual[0]} in {unit}',
    )


def find_time(table: Table, file: Path) -> Column | None:
    """Column of the time; one without a unit counts in seconds where its rows follow each other fast enough."""
    found = find(table, TIME, file)
    if found is None or found.name in TIME.usual or _unit(table, found.name, TIME, implied=False):
        return found
    seconds, _ = table.seconds(found.name)
    if not 0 < (step := float(np.nanmedian(np.diff(seconds)))) <= LONGEST_STEP_S:
        raise InputError(
            f'{file.name}: column "{found.name}" steps by {step:.3g} and has no unit; put it into the name: '
            f'"{found.name} [ms]"'
        )
    return found


def _unit(table: Table, name: str, channel: Channel, *, implied: bool = True) -> str | None:
    """Unit of a column that is called as a channel may be: the stated one, else the usual one; None for others."""
    stem, unit = _stated(table, name, channel)
    if stem not in channel.stems:
        return None
    return unit or (channel.stems[stem] if implied else "")


def _stated(table: Table, name: str, channel: Channel) -> tuple[str, str]:
    """Stem of a column's name, and its unit from the line of units, from brackets or from the end of the name."""
    below = table.units.get(name, "").strip(" []()")
    bracket = _BRACKET.fullmatch(name.strip())
    if below or (bracket is not None and not bracket[2].isdigit()):
        return _plain(bracket[1] if bracket else name), below or (bracket[2] if bracket else "")
    ends = [u for u in channel.units if name.lower().endswith((f"_{u.lower()}", f" {u.lower()}"))]
    if ends and _plain(name) not in channel.stems:
        unit = max(ends, key=len)
        return _plain(name[: -len(unit) - 1]), unit
    return _plain(name), ""


def _plain(name: str) -> str:
    return name.strip().lower().replace(" ", "_")
