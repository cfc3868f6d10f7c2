"""Files of paths: wrap angles and lengths of a tendon's sections, constant or as tables over one to three joints.

Columns `section,quantity`, one `JOINT_rad` for each joint, `value`. A row is a node; cells of joints that a table does
not follow are empty, of a constant all. Quantity is `angle_rad` (below zero where the tendon is off its guide) or
`length_m`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
from tendonff.compensator.files.writing import csv_text, write_text
from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.path import TabulatedSection
from tendonff.models.path_table import PathTable

_END = "_rad"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """Bend and length of a section, constant or by joints.

    Attributes
    ----------
    angle_rad, length_m : float or PathTable
    """

    angle_rad: float | PathTable
    length_m: float | PathTable


QUANTITIES = ("angle_rad", "length_m")


def write_paths(file: Path, sections: Mapping[str, Measures]) -> None:
    """Write sections by name, each node of a table a row."""
    every = [value for own in sections.values() for value in (own.angle_rad, own.length_m)]
    joints = list(dict.fromkeys(joint for each in every if isinstance(each, PathTable) for joint in each.joints))
    rows: list[list[str | float]] = []
    for section, own in sections.items():
        for quantity in QUANTITIES:
            table = getattr(own, quantity)
            if not isinstance(table, PathTable):
                rows.append([section, quantity, *[""] * len(joints), float(table)])
                continue
            axes = [
                low + step * np.arange(count)
                for low, step, count in zip(table.low_rad, table.step_rad, table.nodes, strict=True)
            ]
            points = dict(zip(table.joints, (each.ravel() for each in np.meshgrid(*axes, indexing="ij")), strict=True))
            for k, value in enumerate(table.at(points)):
                angles = [float(points[joint][k]) if joint in points else "" for joint in joints]
                rows.append([section, quantity, *angles, float(value)])
    write_text(file, csv_text(("section", "quantity", *(f"{joint}{_END}" for joint in joints), "value"), rows))


def with_measures(raw: object, known: Mapping[str, Measures], file: Path, where: str) -> object:
    """A path's table with the numbers of the sections that a file has; InputError where it gives them too."""
    if not isinstance(raw, Mapping) or not isinstance(raw.get("sections"), list):
        raise InputError(f"{where}: paths needs the sections of {file.name} by name, in [[tendons.path.sections]]")
    rows = [row for row in raw["sections"] if isinstance(row, Mapping)]
    names = [row.get("name") for row in rows]
    for name in known:
        if name not in names:
            near = suggestion(name, [str(each) for each in names])
            raise InputError(
                f'{where}: the path has no section "{name}" of {file.name}{near}; write it where it belongs'
            )
    found = []
    for row in raw["sections"]:
        own = known.get(str(row.get("name"))) if isinstance(row, Mapping) else None
        if own is not None and (twice := [key for key in (*QUANTITIES, "joint") if key in row]):
            raise InputError(
                f'{where}: two sources for {twice[0]} of section "{row["name"]}": {file.name} has it; leave it out'
            )
        measures = {} if own is None else {"angle_rad": _peak(own.angle_rad), "length_m": _home(own.length_m)}
        found.append({**row, **measures} if measures else row)
    return {**raw, "sections": found}


def tabulated(path: TendonPath, known: Mapping[str, Measures], file: Path) -> TendonPath:
    """The path with the tables of a file for those of its sections that have one."""
    sections = []
    for section in path.sections:
        own = known.get(section.name)
        tables = {} if own is None else {key: getattr(own, key) for key in QUANTITIES}
        angle, length = (table if isinstance(table := tables.get(key), PathTable) else None for key in QUANTITIES)
        try:
            follows = angle is not None or length is not None
            sections.append(TabulatedSection.tabulated(section, angle, length) if follows else section)
        except ParameterError as error:
            raise InputError(f"{file.name}: {error}") from None
    total = float(sum(section.angle_rad for section in sections))
    return TendonPath(total_angle_rad=total, segments=path.segments, radius_m=path.radius_m, sections=tuple(sections))


def read_paths(file: Path) -> dict[str, Measures]:
    """Sections of a file by name; InputError where it is none."""
    import pandas as pd  # a third of a second to import, for such files alone

    try:
        frame = pd.read_csv(file, dtype={"section": str, "quantity": str})
    except (OSError, ValueError) as error:  # of pandas' own errors too
        raise InputError(f"{file.name}: no file of paths: {error}; write it with tendonff import") from None
    columns = [str(name) for name in frame.columns]
    middle = columns[2:-1]
    if columns[:2] != ["section", "quantity"] or columns[-1:] != ["value"] or not all(map(_is_angle, middle)):
        raise InputError(
            f"{file.name}: columns must be section, quantity, JOINT_rad of each joint, value, got {', '.join(columns)}"
        )
    found: dict[str, dict[str, float | PathTable]] = {}
    for (section, quantity), rows in frame.groupby(["section", "quantity"], sort=False):
        if quantity not in QUANTITIES:
            raise InputError(f"{file.name}: quantity must be {' or '.join(QUANTITIES)}, got {quantity}")
        own = [name for name in middle if not rows[name].isna().all()]
        try:
            values = rows["value"].to_numpy(np.float64)
            angles = [rows[name].to_numpy(np.float64) for name in own]
            table = _table([name.removesuffix(_END) for name in own], angles, values)
        except (ParameterError, ValueError) as error:
            raise InputError(f'{file.name}: {quantity} of "{section}": {error}') from None
        found.setdefault(str(section), {})[str(quantity)] = table
    for section, tables in found.items():
        if lacking := [key for key in QUANTITIES if key not in tables]:
            raise InputError(f'{file.name}: section "{section}" has no {lacking[0]}; give it a row')
    return {section: Measures(**tables) for section, tables in found.items()}


def _is_angle(column: str) -> bool:
    return column.endswith(_END)


def _table(joints: Sequence[str], angles: Sequence[FloatArray], values: FloatArray) -> float | PathTable:
    """A constant, or a table from rows in which the last joint runs quickest."""
    if not joints and len(values) == 1:
        return float(values[0])
    axes = [np.unique(each) for each in angles]
    points = [each.ravel() for each in np.meshgrid(*axes, indexing="ij")]
    if not joints or not all(np.array_equal(a, b) for a, b in zip(points, angles, strict=True)):
        raise ParameterError(
            f"needs a row for each node of a grid over {', '.join(joints) or 'no joint'}, the last joint running "
            f"quickest, got {len(values)} rows"
        )
    return PathTable.through(joints, axes, values.reshape([len(axis) for axis in axes]))


def _peak(angle: float | PathTable) -> float:
    return max(angle.peak, 0.0) if isinstance(angle, PathTable) else angle


def _home(length: float | PathTable) -> float:
    return length.home if isinstance(length, PathTable) else length
