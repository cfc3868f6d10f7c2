"""MDF4, as vehicle loggers write it: channels with clocks of their own.

Damaged files end asammdf's compiled parts, and with them the process: it runs in one of its own, for a bounded time.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from tendonff.compensator.files import text
from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, joined
from tendonff.compensator.files.text import InputError, require_moderate

LONGEST_S = 60.0
"""Time in which a file must be read [s]."""

_CHILD = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
from tendonff.compensator.files.formats.mdf import write_channels
write_channels(sys.argv[2], sys.argv[3], json.loads(sys.argv[4]), int(sys.argv[5]))
"""


def write_channels(source: str, target: str, expected: Sequence[str], most_bytes: int) -> None:
    """Write what a file offers, and the channels that are looked for, as an .npz: the child's part."""
    from asammdf import MDF

    with MDF(Path(source)) as file:
        masters = {(group, file.masters_db.get(group)) for group in range(len(file.groups))}
        offered = [name for name, places in file.channels_db.items() if not all(place in masters for place in places)]
        places = {name: file.channels_db[name][0] for name in expected if name in offered}
        size = 16 * sum(file.groups[group].channel_group.cycles_nr for group, _ in places.values())
        places = places if size <= most_bytes else {}
        signals = [file.get(name, *place) for name, place in places.items()]
    told = {"bytes": size, "offered": offered, "names": list(places), "units": [str(s.unit or "") for s in signals]}
    arrays = {f"time_{k}": s.timestamps for k, s in enumerate(signals)}
    arrays |= {f"value_{k}": np.asarray(s.samples, dtype=np.float64) for k, s in enumerate(signals)}
    np.savez(target, told=np.array(json.dumps(told)), **arrays)


def _read(path: Path, expected: Sequence[str]) -> Table:
    if find_spec("asammdf") is None:
        raise ImportError("asammdf")
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch) / "channels.npz"
        given = json.dumps(sys.path), str(path.resolve()), str(target), json.dumps(list(expected)), str(text.MOST_BYTES)
        try:
            done = subprocess.run(
                [sys.executable, "-c", _CHILD, *given], capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(
                f"{path.name} is not read within {LONGEST_S:.0f} s; export the part that is needed as CSV"
            ) from None
        if done.returncode < 0:
            raise InputError(f"{path.name} is damaged: it ends asammdf itself; export it anew, or as CSV")
        if done.returncode != 0:
            raise ValueError((done.stderr.strip().splitlines() or ["no reason given"])[-1])
        with np.load(target) as found:
            told = json.loads(str(found["told"]))
            require_moderate(path, told["bytes"])
            channels = {name: (found[f"time_{k}"], found[f"value_{k}"]) for k, name in enumerate(told["names"])}
    units = {name: unit for name, unit in zip(told["names"], told["units"], strict=True) if unit}
    return Table(columns=joined(channels) if channels else {}, units=units, offered=tuple(told["offered"]))


MDF4 = Reader(
    name="MDF4 (.mf4)", suffixes=(".mf4", ".mdf"), read=_read, package="asammdf", extra="logs", magic=(b"MDF ",)
)
