"""Folders of the YARP data dumper: `data.log` beside `info.log`, of one port or, in folders below, of several.

A row is the number of the packet, one or two time stamps [s], and what the port sent: numbers, `data[k]`, or the lists
of a control board's state (`stateExt:o`), which have names. Columns of several ports are PORT.FIELD on the clock of the
first.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Array, Table, joined
from tendonff.compensator.files.text import InputError, require_moderate, user_text

_STATE = (
    ("jointPosition", "deg"),
    ("jointVelocity", "deg/s"),
    ("jointAcceleration", "deg/s^2"),
    ("motorPosition", "deg"),
    ("motorVelocity", "deg/s"),
    ("motorAcceleration", "deg/s^2"),
    ("torque", "Nm"),
    ("pwmDutycycle", "%"),
    ("current", "A"),
    ("controlMode", ""),
    ("interactionMode", ""),
    ("temperature", "degC"),
)
"""Lists of a control board's state in their order, each of which a flag follows that says whether it is valid."""

_LIST = re.compile(r"\(([^()]*)\)\s+([01])\b")
_WORDS = re.compile(r"\[\w*\]|\"[^\"]*\"")  # a mode, or a text


def _read(path: Path, expected: Sequence[str]) -> Table:
    found = sorted(path.rglob("data.log"))
    ports = {"" if len(found) == 1 else f"{file.parent.relative_to(path).as_posix()}.": file for file in found}
    require_moderate(path, sum(file.stat().st_size for file in found))
    channels: dict[str, tuple[NDArray[np.int64], Array]] = {}
    units: dict[str, str] = {}
    for prefix, file in ports.items():
        time, columns = _port(file)
        channels |= {f"{prefix}{name}": (time, values) for name, (_, values) in columns.items()}
        units |= {f"{prefix}{name}": unit for name, (unit, _) in columns.items() if unit}
    if len(ports) > 1:  # the clock of the first column that was asked for
        first = next((name for name in expected if name in channels), next(iter(channels)))
        channels = {first: channels.pop(first), **channels}
    begin = min(time[0] for time, _ in channels.values())
    return Table(columns=joined({name: ((time - begin) / 1e9, x) for name, (time, x) in channels.items()}), units=units)


def _port(file: Path) -> tuple[NDArray[np.int64], dict[str, tuple[str, Array]]]:
    """Times [ns], as seconds since 1970 would cost seven digits, and for each column its unit and its numbers."""
    stamps = 2 if _is_stamped_twice(file.with_name("info.log")) else 1
    with user_text(file) as stream:
        rows = [line.split(maxsplit=1 + stamps) for line in stream if line[:1].isdigit()]
    rows = [row for row in rows if len(row) == 2 + stamps]
    if not rows:
        raise InputError(f"{file.parent.name}/{file.name}: no row of numbers; only bottles and vectors can be read")
    stamps_s = [row[1].partition(".") for row in rows]
    time = np.array([int(whole) * 10**9 + round(float(f"0.{part or 0}") * 1e9) for whole, _, part in stamps_s])
    names, units, first = _fields(rows[0][-1], file)
    values = [_numbers(row[-1]) for row in rows]
    if any(len(row) != len(first) for row in values):
        raise InputError(f"{file.parent.name}/{file.name}: rows of different lengths; dump one port into a folder")
    table = np.array(values)
    return time, {name: (unit, column) for name, unit, column in zip(names, units, table.T, strict=True) if name}


def _is_stamped_twice(info: Path) -> bool:
    if not info.is_file():
        return False
    with user_text(info) as stream:
        return "tx+rx" in stream.read()


def _numbers(text: str) -> list[float]:
    return [float(x) for x in _WORDS.sub("nan", text).replace("(", " ").replace(")", " ").split()]


def _fields(text: str, file: Path) -> tuple[list[str], list[str], list[float]]:
    """Name and unit of each number of a row, and the numbers; no name for those of lists that are not valid."""
    numbers, lists = _numbers(text), _LIST.findall(text)
    if not lists:
        return [f"data[{k}]" for k in range(len(numbers))], [""] * len(numbers), numbers
    names, units = list[str](), list[str]()
    for (name, unit), (content, valid) in zip(_STATE, lists, strict=False):
        count = len(_numbers(content))
        names += [f"{name}[{k}]" if valid == "1" else "" for k in range(count)] + [""]
        units += [unit] * count + [""]
    if len(names) != len(numbers):
        raise InputError(f"{file.parent.name}/{file.name}: lists of another kind; dump stateExt:o or a vector")
    return names, units, numbers


YARP = Reader(name="YARP data dumper (folder)", suffixes=(), read=_read, folder="**/data.log")
