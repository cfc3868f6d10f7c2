"""Common parts of the files of one driven joint and of several: [[tendons]], [robust], and how they are written."""

import hashlib
import json
import math
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, read_csv, read_text, suggestion
from tendonff.compensator.files.text import require_named
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.joints import Joint
from tendonff.compensator.scenario.kind import in_short
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.scenario import SCHEMA, path_keys, relative_to_folder, spread_keys, with_spread
from tendonff.compensator.scenario.settings import Run
from tendonff.compensator.scenario.tables import (
    ROPE_KEYS,
    check_names,
    expand,
    read_table,
    set_keys,
    show,
    to_toml,
)
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Arm, JointTendon, LengthTable, Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters import Friction, Tendon
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.parameters.uncertainty import Uncertainty

PARTS: dict[str, type] = {"path": TendonPath, "tendon": Tendon, "friction": Friction}
"""Tables of a tendon, given for all or for one."""
_FILES = ("file", "lengths", "paths", "torques", "base")
"""Keys that name a file."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DrivenScenario:
    """Content of a scenario file of driven joints; see `JointScenario` and `FingerScenario`."""

    compare: ClassVar[None] = None  # no command of the user's own is compared
    drive_table: ClassVar[str] = "drive"  # where its drives stand in the file
    name: str
    mechanism: Mechanism | Finger
    run: Run
    robust: Uncertainty
    joints: dict[str, Joint]
    source: Path
    text: str
    inputs: tuple[Path, ...] = field(default=())
    changed: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        return in_short(self)

    @property
    def measurement(self) -> Measurement:
        """Format of measured files by default."""
        return Measurement()

    @property
    def is_complete(self) -> bool:
        """Its text leaves out what has a default."""
        return False

    def with_system(self, system: Any, changed: Mapping[str, float]) -> Self:
        """The scenario with another mechanism, in which these numbers differ."""
        return replace(self, mechanism=system, changed={**self.changed, **changed})

    def to_toml(self) -> str:
        """The text of the file, and as comments what was changed since."""
        return self.text + "".join(f"\n# changed: {key} = {value:.9g}" for key, value in self.changed.items())

    def saved(self) -> str:
        """Text of a file with its numbers as they were changed, and without comments."""
        raw: dict[str, Any] = with_base(tomllib.loads(self.text), self.source, [])
        bent = any("path" in key.split(".") for key in self.changed)
        parts = ("path", "tendon", "friction") if bent else ("tendon", "friction")
        for row, tendon in zip(raw["tendons"], self.mechanism.tendons, strict=True):
            row |= {"name": tendon.name, **{part: part_keys(tendon, part) for part in parts}}
        for key, value in self.changed.items():
            *tables, name = key.split(".")
            if tables and tables[0] not in ("tendons", *PARTS):
                self._table(raw, tables)[name] = value
        for name, joint in self.joints.items():
            raw["joints"][name] |= set_keys(joint)
        return to_toml(raw)

    def _table(self, raw: dict[str, Any], place: Sequence[str]) -> dict[str, Any]:
        """The table at a place of the mechanism; a motor's has the keys of its drive."""
        if place[0] == "motors":
            names = [motor.name for motor in getattr(self.mechanism, "motors", ())]
            row: dict[str, Any] = raw["motors"][names.index(place[1])] if "motors" in raw else {}
            return row
        for table in place:
            raw = raw.setdefault(table, {})
        return raw

    def text_in(self, folder: str | os.PathLike[str]) -> str:
        """Its text for a file in a folder, from which the files that it names are found."""
        raw = tomllib.loads(self.text)

        def moved(table: object) -> None:
            if isinstance(table, dict):
                for key, value in table.items():
                    if key in _FILES and isinstance(value, str):
                        table[key] = relative_to_folder(self.source.parent / value, folder)
                    else:
                        moved(value)
            elif isinstance(table, list):
                for each in table:
                    moved(each)

        moved(raw)
        return to_toml(raw)

    def digest(self) -> str:
        """Sixteen hexadecimal digits that change when a value, or the contents of a file that it names, change."""
        read = {**tomllib.loads(self.text), **({"changed": self.changed} if self.changed else {})}
        found = hashlib.sha256(json.dumps(read, sort_keys=True, default=str).encode())
        for path in self.inputs:
            found.update(read_text(path).encode())
        return found.hexdigest()[:16]


def check_schema(raw: Mapping[str, object], file: str) -> None:
    """Refuse a file of another schema."""
    schema = raw.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise InputError(
            f"{file}: schema must be {SCHEMA}, got {show(schema)}; write schema = {SCHEMA} in the first line"
        )


def read_name(raw: Mapping[str, object], source: Path) -> str:
    """Name of the scenario, by default that of its file."""
    name = raw.get("name", source.stem)
    if not isinstance(name, str):
        raise InputError(f'{source.name}: name must be text in quotes ("..."), got {show(name)}')
    return name


def read_robust(raw: Mapping[str, object], mechanism: Mechanism | Finger, file: str) -> Uncertainty:
    """[robust] with its spreads."""
    spread, robust = spread_keys(raw.get("robust", {}), file)
    return with_spread(read_table(Uncertainty, robust, file=file, table="robust"), spread, mechanism, file)


def read_tendons(
    raw: Mapping[str, object],
    file: str,
    keys: Sequence[str],
    arms: Callable[[Mapping[str, object], str], tuple[Arm, ...]],
    path: Callable[[Mapping[str, object], object, str], object | None] = lambda row, content, at: None,  # noqa: ARG005
    unnamed: str = "tendon_",
) -> tuple[JointTendon, ...]:
    """[[tendons]], each with the parts that it states itself or shares.

    `keys` are those of a row, `arms` its moment arms, `path` its path where that is no table alone; a tendon without a
    name has its number after `unnamed`.
    """
    rows = raw["tendons"]
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{file}: tendons must be tables, got {show(rows)}; write [[tendons]]")
    found = []
    for k, row in enumerate(rows, start=1):
        where = f"tendons {k}"
        if not isinstance(row, Mapping):
            raise InputError(f"{file} [{where}]: must be a table, got {show(row)}; write [[tendons]]")
        for key in row:
            if key not in keys:
                raise InputError(f'{file} [{where}]: unknown key "{key}"{suggestion(key, list(keys))}')
        name = row.get("name", f"{unnamed}{k}")
        if not isinstance(name, str) or not name.isidentifier():
            raise InputError(f"{file} [{where}]: name must be letters, digits and underscores, got {show(name)}")
        parts: dict[str, object] = {}
        for key in PARTS:
            if key not in row and key not in raw:
                raise InputError(
                    f"{file} [{where}]: [{key}] is missing; give it for all tendons, or in [tendons.{key}]"
                )
            at, content = f"{where}.{key}" if key in row else key, row.get(key, raw.get(key))
            special = path(row, content, at) if key == "path" else None
            parts[key] = tendon_part(key, content, file, at) if special is None else special
        try:
            found.append(JointTendon(name=name, arms=arms(row, where), **parts))  # type: ignore[arg-type]
        except ParameterError as error:
            raise InputError(f"{file} [{where}]: {error}") from None
    return tuple(found)


def tendon_part(key: str, raw: object, file: str, table: str) -> object:
    """[path], [tendon] or [friction], of all tendons or of one."""
    sections: tuple[object, ...] = ()
    if key == "path":
        sections, raw = path_keys(raw, file)
    check_names(PARTS[key], raw, file=file, table=table, extra_keys=ROPE_KEYS if key == "tendon" else ())
    keys = dict(expand(key, raw, file=file))  # type: ignore[arg-type]
    if sections:
        built = read_table(TendonPath, keys, file=file, table=table)
        return TendonPath(
            total_angle_rad=built.total_angle_rad,
            segments=built.segments,
            radius_m=built.radius_m,
            sections=sections,  # type: ignore[arg-type]
        )
    return read_table(PARTS[key], keys, file=file, table=table)


def part_keys(tendon: JointTendon, part: str) -> dict[str, object]:
    """Table [path], [tendon] or [friction] of a tendon as a file says it."""
    found = set_keys(getattr(tendon, part))
    if part == "path" and tendon.path.sections:
        found["sections"] = [set_keys(section) for section in tendon.path.sections]
        del found["total_angle_rad"]
    return found


def read_lengths(path: Path, inputs: list[Path], where: str) -> LengthTable:
    """Length of a tendon over the angle of its joint, from a file named in `where` that is added to the inputs."""
    require_named(path, f"{where}: lengths")
    table = read_csv(path, ("angle_rad", "length_m"), increasing="angle_rad")
    inputs.append(path)
    return LengthTable(angle_rad=table["angle_rad"], length_m=table["length_m"])


def instants(length_s: float, step_s: float, file: str) -> FloatArray:
    """Steps of a run over a reference [s]; InputError where there are less than two."""
    time = np.arange(math.ceil(length_s / step_s - 1e-9) + 1, dtype=np.float64) * step_s
    if len(time) < 3:
        raise InputError(f"{file}: the reference lasts {length_s:g} s, less than two steps of {step_s:g} s")
    return time
