"""Measured files as they are: columns found, units made SI, rows that cannot be used taken out and reported."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from tendonff.compensator.files.quantities import (
    FORCE_UNITS,
    LENGTH_UNITS,
    TIME_UNITS,
    TIME_WORDS,
    Quantity,
    guess,
    unit_of,
    with_unit,
)
from tendonff.compensator.files.reading import InputError, nearest_column, suggestion
from tendonff.compensator.files.tables import Table, read_table
from tendonff.compensator.identification.measured import LEAST_ROWS, Array, Mask
from tendonff.compensator.identification.measured.conditions import condition_of
from tendonff.compensator.identification.measured.preparation import slack_rows, switched_on_s
from tendonff.compensator.identification.measured.units import Conversion, conversion
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.path import JointMotion

OUT_OF_ORDER_ROWS = 5
"""A clock that is back on its way after so many rows had rows out of order; one that stays behind has jumped."""

_USUAL = {
    key: Quantity(name=name, words=words, units=units, option=f"--{key.replace('_', '-')}-column")
    for key, name, words, units in (
        ("time", "time_s", TIME_WORDS, TIME_UNITS),
        ("input", "input_tension_N", ("input_tension", "input_force", "input"), FORCE_UNITS),
        ("output", "output_tension_N", ("output_tension", "output_force", "output"), FORCE_UNITS),
        ("actuator_force", "actuator_force_N", ("actuator_force",), FORCE_UNITS),
        ("input_position", "input_position_m", ("input_position",), LENGTH_UNITS),
        ("output_position", "output_position_m", ("output_position",), LENGTH_UNITS),
    )
}
"""Default names of the columns, and accepted alternatives."""

_OF_A_SIMULATION = {
    "actuator_force": "force_N",
    "input_position": "actuator_position_m",
    "output_position": "load_position_m",
}

LEAST_RISING = 0.5
"""A clock that rises in fewer of the rows is none."""


class MissingColumnError(InputError):
    """A file without a column that is needed.

    Parameters
    ----------
    text : str
        The message.
    key : str
        Channel of the column.
    present : tuple of str
        Columns of the file.
    """

    def __init__(self, text: str, *, key: str, present: tuple[str, ...]) -> None:
        super().__init__(text)
        self.key, self.present = key, present


class DataIssue(StrEnum):
    """Kinds of data issues."""

    LONG = "rows with more cells than the header"
    MISSING = "missing values"
    DUPLICATE = "repeated time stamps"
    OUT_OF_ORDER = "time stamps out of order"
    CLOCK_JUMP = "clock jumping back"
    GAP = "gaps"
    SPIKE = "spikes"
    NEGATIVE = "negative readings"
    BIAS = "cell with an offset"
    SHORT = "short pieces"
    SKIPPED = "rows left out at the start"
    ONSET = "load switched on at the start"
    OFFSET = "zero of the cells"
    UNITS = "units"
    DATES = "time stamps are dates"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Data issue in a file, and its treatment.

    Attributes
    ----------
    issue : DataIssue
        Kind of the issue.
    count : int
        Rows or places concerned.
    times_s : tuple of float
        The first few of them [s].
    text : str
        In words, with what was done.
    """

    issue: DataIssue
    count: int
    times_s: tuple[float, ...]
    text: str


class Findings(list[Finding]):
    """Findings in a file so far."""

    def note(
        self, issue: DataIssue, action: str, times_s: Sequence[float] | Array = (), count: int | None = None
    ) -> None:
        """Add what was done about an issue, with its count (default: the number of times) and first times [s] in the
        text.
        """
        number = len(times_s) if count is None else count
        first = tuple(float(t) for t in times_s[:5])
        where = ", ".join(f"{t:.4g}" for t in first)
        at = f" (at t = {where}{' ...' if len(times_s) > len(first) else ''} s)" if first else ""
        self.append(Finding(issue=issue, count=number, times_s=first, text=f"{issue}: {number}{at}; {action}"))


@dataclass(frozen=True, slots=True, kw_only=True)
class RawMeasurement:
    """Usable rows of one file in SI units, in the order of time."""

    name: str  # file name
    # time_s, input_N, output_N: shape (n,); time rises strictly; `output_N` is NaN where the output tension was not
    # measured
    time_s: Array
    input_N: Array
    output_N: Array
    # input_m, output_m, actuator_N: shape (n,); positions and the actuator's force, where the file has them
    input_m: Array | None
    output_m: Array | None
    actuator_N: Array | None
    motion: JointMotion | None  # measured joint angles, where the path has joints
    breaks: tuple[int, ...]  # first rows after a clock that jumped back
    unread: tuple[str, ...]  # columns of the file that have no use
    started_s: float | None  # seconds from 1970 to its first row, where its time stamps are dates
    findings: tuple[Finding, ...]

    @property
    def has_output(self) -> bool:
        """The output tension was measured."""
        return bool(np.isfinite(self.output_N).all())


def _columns(
    path: Path, names: Mapping[str, str], how: Measurement, findings: Findings
) -> tuple[dict[str, Array], tuple[str, ...], float | None]:
    """The wanted columns in SI units, names of the other columns, and the date it began."""
    table = read_table(path, tuple(names.values()), how.columns or ())
    started: float | None = None
    found: dict[str, Array] = {}
    names, factors = _guessed(table, names, findings)
    conversions = {key: Conversion(factor=factor) for key, factor in factors.items()}
    for key, name in names.items():
        if name in table.repeated:
            raise InputError(
                f'{path.name}: column "{name}" appears more than once; keep one, or give each its own name'
            )
        if name not in table.columns:
            _check_missing(path, table, names, key)
            continue
        if key == "time":
            found[key], started = table.seconds(name)
            if started is not None:
                findings.note(DataIssue.DATES, "read as seconds since the first one", count=1)
        else:
            found[key] = table.numbers(name)
        _, unit, is_stated = unit_of(table.dialect, name)
        if (is_stated or how.drum_radius_m is not None) and (own := conversion(key, unit, how)) is not None:
            conversions[key] = own
    shown = ", ".join(
        f"{names[key]}{f' [{table.units[names[key]]}]' if names[key] in table.units else ''} x {own.factor:g}"
        for key, own in conversions.items()
        if names[key] in table.units or (key not in factors and (own.factor != 1 or own.is_rate))
    )
    if table.units or shown:
        place = "below the header; " if table.units else ""
        findings.note(DataIssue.UNITS, f"{place}{shown or 'none of them known'} (--scale overrides)", count=1)
    if table.long_rows:
        findings.note(DataIssue.LONG, "rows left out", count=table.long_rows)
    conversions |= {
        key: Conversion(factor=scale) for key in _USUAL if (scale := getattr(how, f"{key}_scale") or 1.0) != 1
    }
    if "time" in conversions:
        found["time"] = conversions.pop("time").of(found["time"], found["time"])
    found |= {key: own.of(found[key], found["time"]) for key, own in conversions.items() if key in found}
    return found, tuple(name for name in table.columns if name not in names.values()), started


def _check_missing(path: Path, table: Table, names: Mapping[str, str], key: str) -> None:
    """Refuse a file without a column that is needed."""
    present = (*table.columns, *table.offered)
    near = nearest_column(names[key], present)
    missing = f'{path.name}: column "{names[key]}" is missing{near}'
    if key in ("time", "input") or (key == "output" and not _proximal(table, names)):
        way_out = f" (choose one with --{key}-column, and its unit with --scale)"
    elif key.startswith("joint"):
        way_out = "; the path moves with this joint: log its angle, or where it is at rest give --condition"
    else:
        return
    raise MissingColumnError(missing + way_out, key=key, present=present)


def _along(table: Table) -> list[str]:
    """Columns of tensions along the tendon, as `simulate` writes them, from the actuator to the far end."""
    names = (re.fullmatch(r"tension_(\d+)_N", name) for name in table.columns)
    found = {int(name[1]): name[0] for name in names if name is not None}
    return [found[k] for k in sorted(found)] if 1 in found and len(found) > 1 else []


def _guessed(table: Table, names: Mapping[str, str], findings: Findings) -> tuple[dict[str, str], dict[str, float]]:
    """Columns for those that the file has by another name and with a unit, and what the units are in SI."""
    dialect = table.dialect
    names = {key: name if name in table.columns else with_unit(table.columns, name) for key, name in names.items()}
    taken, factors, texts = dict(names), dict[str, float](), []
    for key, usual in _USUAL.items():
        if (
            names[key] == usual.name
            and usual.name not in table.columns
            and (other := guess(dialect, usual)) is not None
        ):
            taken[key], factors[key], text = other
            texts.append(text)
    if not {taken["input"], taken["output"]} & set(table.columns) and (along := _along(table)):
        taken |= {"input": along[0], "output": along[-1]} | _OF_A_SIMULATION
        texts.append(f'columns of a simulation, input "{along[0]}", output "{along[-1]}"')
    if texts and not table.units:
        findings.note(DataIssue.UNITS, f"{', '.join(texts)} (--scale overrides)", count=1)
    return taken, factors


def _proximal(table: Table, names: Mapping[str, str]) -> bool:
    """No output tension was measured, and no column of it was requested: the near end is predicted from itself."""
    return names["output"] == Measurement().output_column and names["input_position"] in table.columns


def _zeroed(name: str, data: dict[str, Array], how: Measurement, findings: Findings) -> dict[str, Array]:
    """Tensions less the offsets (as given, over a slack time as given, or where slack is seen), over the gains."""
    ends = [key for key in ("input", "output") if key in data]
    given: dict[str, float | None] = {"input": how.input_offset_N, "output": how.output_offset_N}
    offsets: dict[str, float] = {key: value for key in ends if (value := given[key]) is not None}
    rows, why = None, "as given"
    if how.tare_s is not None:
        rows = rows_within(data["time"], how.tare_s, "--tare", name)
        why = "their median from {:g} to {:g} s".format(*how.tare_s)
    elif not offsets and len(ends) == 2 and (rows := slack_rows(data["input"], data["output"])) is not None:
        low = f"both cells stay near zero in {rows.sum()} samples"
        why = f"{low}, read as a slack tendon; --offset 0 keeps the readings"
    if rows is not None:
        offsets = {key: float(np.median(data[key][rows])) for key in ends} | offsets
    if any(offsets.values()):
        shown = ", ".join(f"{key} {value:.4g} N" for key, value in offsets.items())
        findings.note(DataIssue.OFFSET, f"subtracted: {shown} ({why})", count=1)
    gains = {"input": how.input_gain or 1.0, "output": how.output_gain or 1.0}
    return {key: (values - offsets.get(key, 0.0)) / gains.get(key, 1.0) for key, values in data.items()}


def rows_within(time_s: Array, span_s: tuple[float, float], key: str, file: str) -> Mask:
    """Rows within a time that counts from the first row [s]; InputError where `key` gives too few."""
    since = time_s - time_s[np.isfinite(time_s)][0]
    rows: Mask = (since >= span_s[0]) & (since <= span_s[1])
    if rows.sum() < LEAST_ROWS:
        raise InputError(
            f"{file}: {rows.sum()} samples between {span_s[0]:g} and {span_s[1]:g} s, {LEAST_ROWS} are needed; give "
            f"{key} a longer time within the file"
        )
    return rows


def require_channels(how: Measurement, known: Iterable[str]) -> None:
    """Refuse columns that were named for channels which a log does not have."""
    if unknown := next((channel for channel in how.named_columns if channel not in known), None):
        raise InputError(f'channels: unknown channel "{unknown}"{suggestion(unknown, tuple(known))}')


def read_measurement(path: Path, how: Measurement, joints: Sequence[str] = ()) -> RawMeasurement:
    """Read one measured file, tolerant of data issues but never silent about them.

    The angles of joints of the path are read from the columns NAME_rad, or are conditions of the file. InputError if
    columns are missing or fewer than ten rows are usable.
    """
    path = Path(path)
    columns = {key: getattr(how, f"{key}_column") or usual.name for key, usual in _USUAL.items()}
    standing = condition_of(path.name, joints, {}, how)
    moving = [name for name in joints if name not in standing]
    columns |= {f"joint {name}": f"{name}_rad" for name in moving}
    usual = {q.name: key for key, q in _USUAL.items()} | {f"{name}_rad": f"joint {name}" for name in moving}
    require_channels(how, usual)
    columns |= {usual[channel]: name for channel, name in how.named_columns.items()}
    for key, name in columns.items():
        if twin := next((k for k, n in columns.items() if n == name and k != key), None):
            raise InputError(f'"{name}" is named as the column of {key} and of {twin}; each needs its own')
    findings = Findings()
    data, unread, started = _columns(path, columns, how, findings)
    bad: Mask = np.asarray(~np.isfinite(np.stack(list(data.values()))).all(axis=0))
    if bad.any():
        timed = bad & np.isfinite(data["time"])
        findings.note(DataIssue.MISSING, "rows left out", data["time"][timed], int(bad.sum()))
        data = {key: values[~bad] for key, values in data.items()}
    if how.skip_s and len(data["time"]):
        early = data["time"] < data["time"][0] + how.skip_s
        findings.note(DataIssue.SKIPPED, f"the first {how.skip_s:g} s, as asked", count=int(early.sum()))
        data = {key: values[~early] for key, values in data.items()}
    if len(data["time"]) > 2 and (rising := float(np.mean(np.diff(data["time"]) > 0))) < LEAST_RISING:
        raise InputError(
            f"{path.name}: {how.time_column} rises in {100 * rising:.0f} % of the rows only; name the column that "
            "holds time, or sort the file by it"
        )
    keep, time, breaks = _mend_clock(data["time"], findings)
    if keep.sum() < LEAST_ROWS:
        raise InputError(
            f"{path.name} has {int(keep.sum())} usable rows of {len(bad)}; at least {LEAST_ROWS} are needed"
            + (f" ({'; '.join(f.text for f in findings)})" if findings else "")
        )
    kept = _zeroed(path.name, {key: np.ascontiguousarray(values[keep]) for key, values in data.items()}, how, findings)
    if "output" in kept and how.skip_s is None and (length := switched_on_s(time, kept["input"], kept["output"])) > 0:
        late = int(np.searchsorted(time, time[0] + length))
        action = (
            f"the output jumps within a row and rings while the input hardly moves; the first {length:.2g} s are left "
            "out (--skip 0 keeps them)"
        )
        findings.note(DataIssue.ONSET, action, count=late)
        kept, time = {key: values[late:] for key, values in kept.items()}, time[late:]
        breaks = tuple(k - late for k in breaks if k > late)
    for key in ("input", "output"):
        if key in kept and float(np.ptp(kept[key])) == 0:
            raise InputError(
                f"{path.name}: {columns[key]} is {kept[key][0]:g} N in all {len(kept[key])} usable rows; nothing can "
                "be identified from a tension that never moves: drive the tendon, or check the column"
            )
    motion = None
    if joints:
        kept |= {f"joint {name}": np.full(len(time), angle) for name, angle in standing.items()}
        angles = np.column_stack([kept[f"joint {name}"] for name in joints])
        motion = JointMotion(names=tuple(joints), time_s=time, angle_rad=angles)
    return RawMeasurement(
        name=path.name,
        time_s=time,
        input_N=kept["input"],
        output_N=kept.get("output", np.full(len(time), np.nan)),
        input_m=kept.get("input_position"),
        output_m=kept.get("output_position"),
        actuator_N=kept.get("actuator_force"),
        motion=motion,
        breaks=breaks,
        unread=unread,
        started_s=started,
        findings=tuple(findings),
    )


def _mend_clock(time: Array, findings: Findings) -> tuple[Mask, Array, tuple[int, ...]]:
    """Rows to keep, their times in strictly rising order, and first kept rows after a jump back."""
    if len(time) < 2:
        return np.ones(len(time), dtype=bool), time.copy(), ()
    step = np.diff(time)
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 1.0
    mended = time.copy()
    breaks, jump_times = [], []
    for k in (np.flatnonzero(step < 0) + 1).tolist():
        ahead = mended[k : k + OUT_OF_ORDER_ROWS + 1]
        if np.any(ahead > mended[k - 1]):
            continue  # a few rows out of order: dropped below
        jump_times.append(float(mended[k - 1]))
        breaks.append(k)
        mended[k:] += mended[:k].max() + usual - mended[k]
    if breaks:
        findings.note(DataIssue.CLOCK_JUMP, "a new piece starts there, its history is not known", jump_times)
    highest = np.maximum.accumulate(mended)
    late = np.append(False, mended[1:] <= highest[:-1])
    repeated = np.append(False, mended[1:] == highest[:-1])
    if repeated.any():
        findings.note(DataIssue.DUPLICATE, "the first row of each was kept", time[repeated])
    if (disordered := late & ~repeated).any():
        findings.note(DataIssue.OUT_OF_ORDER, "rows left out", time[disordered])
    index = np.cumsum(~late) - 1
    return ~late, mended[~late], tuple(int(index[k]) for k in breaks)
