"""ROS 2 bags: a folder, .db3 or .mcap. Columns are TOPIC.FIELD, elements FIELD[k], those of a JointState FIELD[joint].

Topics have clocks of their own: the stamp of the message's header, or else the time at which it was recorded. Messages
of the topics that were asked for are read one at a time, of others none.
"""

import re
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, joined, resolved
from tendonff.compensator.files.text import require_moderate

_PART = re.compile(r"([^.\[\]]+)(?:\[([^\]]+)\])?")
_ELEMENT = re.compile(r"\[[^\]]+\]")
_NUMBERS = frozenset(("float64", "float32", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))))
_BYTES = 8  # of a number


def _getter(path: str) -> Callable[[Any], float]:
    """Access to a field of a message."""
    parts = [match.groups() for match in _PART.finditer(path)]

    def get(message: Any) -> float:
        for name, index in parts:
            owner, message = message, getattr(message, name)
            if index is not None:
                names = getattr(owner, "name", None)
                message = message[int(index) if index.isdigit() else list(names or ()).index(index)]
        return float(message)

    return get


def _fields(store: Any, kind: str, prefix: str = "") -> list[str]:
    """Numbers of a message by the definition of its type; arrays as FIELD[]."""
    found = []
    for name, (node, of) in store.fielddefs[kind][1]:
        if node == 1 and of[0] in _NUMBERS:
            found.append(f"{prefix}{name}")
        elif node == 2 and of in store.fielddefs:
            found += _fields(store, of, f"{prefix}{name}.")
        elif node in (3, 4) and of[0][0] == 1 and of[0][1][0] in _NUMBERS:
            found.append(f"{prefix}{name}[]")
    return found


def _read(path: Path, expected: Sequence[str]) -> Table:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        by_topic = {connection.topic: connection for connection in bag.connections}
        offered = tuple(
            f"{topic}.{field}"
            for topic, connection in by_topic.items()
            for field in _fields(bag.typestore, connection.msgtype)
        )
        scalars = [name for name in offered if not name.endswith("[]")]
        wanted: dict[str, tuple[str, str]] = {}
        for name in expected:
            topic = max((t for t in by_topic if name.startswith(f"{t}.")), key=len, default="")
            if topic and _ELEMENT.sub("[]", name) in offered:
                wanted[name] = topic, name.removeprefix(f"{topic}.")
            elif name in (short := resolved([name], scalars)):
                topic = max((t for t in by_topic if short[name].startswith(f"{t}.")), key=len)
                wanted[name] = topic, short[name].removeprefix(f"{topic}.")
        getters = {name: _getter(field) for name, (_, field) in wanted.items()}
        topics = {topic for topic, _ in wanted.values()}
        clocks: dict[str, array[int]] = {topic: array("q") for topic in topics}
        values: dict[str, array[float]] = {name: array("d") for name in wanted}
        of_topic = {topic: [name for name in wanted if wanted[name][0] == topic] for topic in topics}
        held = 0
        for connection, stamp_ns, raw in bag.messages([by_topic[topic] for topic in topics]) if topics else ():
            message = bag.deserialize(raw, connection.msgtype)
            header = getattr(message, "header", None)
            own = 0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec
            clocks[connection.topic].append(own or stamp_ns)
            for name in of_topic[connection.topic]:
                values[name].append(getters[name](message))
                held += _BYTES
            require_moderate(path, held)
    if not values:
        return Table(columns={}, units={}, offered=offered)
    begin = min(clock[0] for clock in clocks.values() if len(clock))
    # Differences of whole nanoseconds: seconds since 1970 would cost seven digits.
    seconds = {topic: (np.asarray(clock) - begin) / 1e9 for topic, clock in clocks.items()}
    channels = {name: (seconds[wanted[name][0]], np.asarray(column)) for name, column in values.items()}
    return Table(columns=joined(channels), units={}, offered=offered)


ROSBAG = Reader(
    name="ROS 2 bag (folder, .db3, .mcap)",
    suffixes=(".db3", ".mcap"),
    read=_read,
    package="rosbags",
    extra="logs",
    magic=(b"SQLite format 3\x00", b"\x89MCAP0\r\n"),
    folder="metadata.yaml",
)
