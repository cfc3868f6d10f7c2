"""MDF4, as vehicle loggers write it: channels with clocks of their own."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, joined
from tendonff.compensator.files.text import require_moderate


def _read(path: Path, expected: Sequence[str]) -> Table:
    from asammdf import MDF

    with MDF(path) as file:
        masters = {(group, file.masters_db.get(group)) for group in range(len(file.groups))}
        offered = tuple(
            name for name, places in file.channels_db.items() if not all(place in masters for place in places)
        )
        wanted = [name for name in expected if name in offered]
        places = {name: file.channels_db[name][0] for name in wanted}
        require_moderate(path, 16 * sum(file.groups[group].channel_group.cycles_nr for group, _ in places.values()))
        signals = {name: file.get(name, *place) for name, place in places.items()}
        channels = {name: (s.timestamps, np.asarray(s.samples, dtype=np.float64)) for name, s in signals.items()}
        units = {name: s.unit for name, s in signals.items() if s.unit}
    return Table(columns=joined(channels) if channels else {}, units=units, offered=offered)


MDF4 = Reader(
    name="MDF4 (.mf4)", suffixes=(".mf4", ".mdf"), read=_read, package="asammdf", extra="logs", magic=(b"MDF ",)
)
