"""Lag and delay of a drive from a log of its command and what it did, for tendons and joints alike.

The log holds `time_s` and a pair of columns in one unit: `command_N`, `force_N`; `command_m`, `position_m`; or
`command_rad`, `motor_rad`. Nothing of the tendon is needed: the drive may run without it.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError, read_csv
from tendonff.compensator.files.tables import table_dialect
from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.measured.smoothing import even_times
from tendonff.models.errors import ParameterError
from tendonff.ocp.fits.servo import ServoFit, fit_servo, servo_chirp

PAIRS = (("command_N", "force_N"), ("command_m", "position_m"), ("command_rad", "motor_rad"))
"""Columns of the command and of the answer."""

KEYS = ("servo_time_s", "delay_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoIdentification:
    """Lag and delay of a drive.

    Attributes
    ----------
    fits : dict of str to ServoFit
        By file.
    table : str
        Of the scenario that takes the keys: "actuator" or "drive".
    """

    fits: dict[str, ServoFit]
    table: str

    @property
    def values(self) -> dict[str, tuple[float, float, float]]:
        """Value and 95 % interval of each key [s]: the mean over the files, and the hull of their intervals."""
        found = {}
        for key in KEYS:
            interval = key.removesuffix("_s") + "_interval_s"
            ends = [getattr(fit, interval) for fit in self.fits.values()]
            value = float(np.mean([getattr(fit, key) for fit in self.fits.values()]))
            found[key] = value, min(low for low, _ in ends), max(high for _, high in ends)
        return found

    @property
    def toml(self) -> str:
        """The keys for the scenario, with their intervals."""
        values = self.values
        lines = [f"[{self.table}]", *(f"{key} = {value:.4g}" for key, (value, _, _) in values.items())]
        lines += ["", "[robust.spread]"]
        lines += [f'"{self.table}.{key}" = [{low:.4g}, {high:.4g}]' for key, (_, low, high) in values.items()]
        return "\n".join(lines) + "\n"

    def write(self, folder: Path) -> None:
        """Write `drive.toml` and `fit.json`."""
        with atomic_directory(folder) as partial:
            write_text(partial / "drive.toml", self.toml)
            files = {name: asdict(fit) for name, fit in self.fits.items()}
            write_json(partial / "fit.json", {"schema": 1, "drive": files})

    @property
    def lines(self) -> list[str]:
        """The result for the terminal."""
        words = {"servo_time_s": "lag", "delay_s": "delay"}
        found = [
            f"{words[key]} {1e3 * value:.3g} ms (95 % interval {1e3 * low:.3g} to {1e3 * high:.3g} ms)"
            for key, (value, low, high) in self.values.items()
        ]
        worst = max(fit.residual for fit in self.fits.values())
        return [*found, f"a first-order lag and a delay leave {100 * worst:.2g} % of the answer unexplained"]


def is_servo_log(path: Path, header: Sequence[str] = ()) -> bool:
    """Whether a file is a log of a drive: it has a command and its answer.

    `header` names the columns of a file without a header, which is a log of the rig.
    """
    return not header and path.suffix.lower() == ".csv" and path.is_file() and _pair_of(path) is not None


def _pair_of(path: Path) -> tuple[str, str] | None:
    every = tuple(name for pair in PAIRS for name in pair)
    names = table_dialect(path, ("time_s", *every)).names
    return next((pair for pair in PAIRS if set(pair) <= set(names)), None)


def identify_servo(files: Sequence[Path], table: str) -> ServoIdentification:
    """Fit lag and delay to logs of a drive; InputError where a file is not one or does not tell them."""
    fits = {}
    for path in files:
        pair = _pair_of(path)
        if pair is None:
            raise InputError(f"{path.name}: no log of a drive; it needs time_s and one of {PAIRS}")
        data = read_csv(path, ("time_s", *pair))
        time, given, seen = (np.asarray(data[name], dtype=np.float64) for name in ("time_s", *pair))
        if len(time) < 2 or not np.all(np.diff(time) > 0):
            raise InputError(f"{path.name}: time_s must increase over at least two rows")
        step = float(np.median(np.diff(time)))
        even = even_times(time, step)
        try:
            fits[path.name] = fit_servo(np.interp(even, time, given), np.interp(even, time, seen), step)
        except ParameterError as error:
            raise InputError(f"{path.name}: {error}") from None
    return ServoIdentification(fits=fits, table=table)


def write_chirp(path: Path, column: str, size: float, middle: float, step_s: float) -> None:
    """Write a chirp of a drive alone: `time_s` and the command."""
    time, command = servo_chirp(size, step_s, middle=middle)
    write_csv(path, {"time_s": time, column: command})
