"""Scenario files: the one reader, and the writer that it reads back.

A scenario is a TOML file (schema 1) with the tables [path], [tendon], [friction], [actuator], [load], [reference] and
[run], and the optional tables [robust], [optimal], [experiment], [measurement], [stream] and [adaptation].
"""

import hashlib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from tendonff.compensator.files.reading import InputError, read_text, suggestion
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.experiment import Experiment
from tendonff.compensator.scenario.goal import Goal
from tendonff.compensator.scenario.joints import KINDS as JOINT_KINDS
from tendonff.compensator.scenario.joints import Joint, read_joints
from tendonff.compensator.scenario.kind import Kind, in_short
from tendonff.compensator.scenario.knobs import Knob
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.reference import CsvReference, ReferenceSpec, SineReference, WaypointReference
from tendonff.compensator.scenario.settings import REMOVED_OPTIMAL, Adaptation, Compare, Feedback, Run, Stream
from tendonff.compensator.scenario.tables import (
    ROPE_KEYS,
    check_names,
    expand,
    missing_keys,
    read_kind,
    read_table,
    show,
    toml_table,
    toml_value,
)
from tendonff.compensator.scenario.toml import toml_of
from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Actuator, Friction, Load, Tendon, Transmission
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.parameters.numbers import keys_of, number_of, with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.models.path import Section
from tendonff.ocp.tracking.options import TrackOptions

SCHEMA = 1

_KINDS: dict[str, type[ReferenceSpec]] = {"sine": SineReference, "waypoints": WaypointReference, "csv": CsvReference}
_TABLES: dict[str, type] = {
    "path": TendonPath,
    "tendon": Tendon,
    "friction": Friction,
    "actuator": Actuator,
    "load": Load,
    "run": Run,
}
_OPTIONAL: dict[str, type] = {
    "robust": Uncertainty,
    "optimal": TrackOptions,
    "experiment": Experiment,
    "measurement": Measurement,
}
_ON_REQUEST: dict[str, type] = {
    "adaptation": Adaptation,
    "compare": Compare,
    "feedback": Feedback,
    "stream": Stream,
}  # tables whose absence means that there is none of it

_HELD_BY_JOINT = {"mass_kg": 1e-3, "stiffness_N_per_m": 1e3, "damping_N_s_per_m": 0.0}
"""Numbers of a load without effect where a joint moves it."""

_REQUIRED_TABLES = ("path", "tendon", "friction", "actuator", "load", "reference", "run")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Content of a scenario file: one field for each table, except that the five of the transmission are one.

    Parameters
    ----------
    name : str
        What it is, in words.
    reference : ReferenceSpec
        The desired tension at the far end.
    adaptation : Adaptation or None
        Self-tuning on the controller; None for none.
    compare : Compare or None
        A force of the user's own for `compare`; None for none.
    feedback : Feedback or None
        Feedback beside the feedforward; None for none.
    joints : dict of str to Joint
        What the joints of a moving path do, by name.
    source : Path
        The file it was read from, which a CSV reference is relative to.
    bases : tuple of Path
        Files from which it has what it leaves out.
    transmission : Transmission
        Path, tendon, friction, actuator and load.
    run : Run
        Step and fidelity level.
    robust : Uncertainty
        What is not known exactly, and by how much.
    optimal : TrackOptions
        Options of the optimal profile.
    experiment : Experiment
        The two-motor test.
    measurement : Measurement
        How measured files are read.
    stream : Stream or None
        Limits of a live reference, whose filters `design` draws; None: those of exported C are the usual ones.
    """

    kind: ClassVar[Kind] = Kind.TENSION
    drive_table: ClassVar[str] = "actuator"  # where its drives stand in the file
    name: str
    transmission: Transmission
    reference: ReferenceSpec
    run: Run
    robust: Uncertainty = field(default_factory=Uncertainty)
    optimal: TrackOptions = field(default_factory=TrackOptions)
    experiment: Experiment = field(default_factory=Experiment)
    measurement: Measurement = field(default_factory=Measurement)
    stream: Stream | None = None
    adaptation: Adaptation | None = None
    feedback: Feedback | None = None
    compare: Compare | None = None
    joints: dict[str, Joint] = field(default_factory=dict)
    source: Path = Path("scenario.toml")
    bases: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return in_short(self)

    @property
    def goal(self) -> Goal:
        """Goal: the tension at the far end, or the load's position."""
        return Goal(quantity=self.reference.output, unit=self.reference.unit, names=("output",))

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """Numbers that the interactive page turns, as far as the scenario has them."""
        system, degree = self.transmission, math.radians(1.0)
        mu, angle = system.friction.mu_dynamic, system.path.total_angle_rad / degree
        every, scale = ("mu", 1 / mu) if mu > 0 else ("friction.mu_dynamic", 1.0)
        soft = "soft_" if self.run.level.soft_bristle else ""
        numbers = (
            (f"friction.{soft}bristle_stiffness_N_per_m", "bristle stiffness [N/m]", 1.5),
            ("tendon.relaxation_time_s", "relaxation time [s]", 1.5),
            ("actuator.force_rate_max_N_per_s", "rate limit of the force [N/s]", 3.0),
            ("load.stiffness_N_per_m", "load stiffness [N/m]", 1.0),
            ("load.mass_kg", "load mass [kg]", 1.0),
        )
        wrap = Knob(
            key="path.total_angle_rad",
            title="wrap angle [deg]",
            value=angle,
            start=0.0,
            end=max(360.0, 1.5 * angle),
            step=5.0,
            shown="0",
            scale=degree,
        )
        friction = Knob(
            key=every,
            title="friction coefficient mu [-]",
            value=mu,
            start=0.0,
            end=max(0.5, 2 * mu),
            step=0.005,
            scale=scale,
        )
        known = keys_of(system)
        more = [Knob.decades(k, t, number_of(system, k) or 0.0, d, is_set=k.startswith("act")) for k, t, d in numbers]
        return (friction, *(knob for knob in (wrap, *more) if knob.key in known and knob.value > 0))

    def with_system(self, system: Any, changed: Mapping[str, float]) -> "Scenario":  # noqa: ARG002  all is written out
        """The scenario with another transmission, in which these numbers differ."""
        return replace(self, transmission=system)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Its bases, and the user's own force if there is one; reports name the reference's file apart."""
        force = () if self.compare is None else (self.source.parent / self.compare.force,)
        return (*self.bases, *force)

    @property
    def is_complete(self) -> bool:
        """Its text states every default."""
        return True

    @property
    def system(self) -> Transmission:
        """Everything physical about it."""
        return self.transmission

    def to_toml(self) -> str:
        """Text that reads back as the same scenario."""
        return scenario_to_toml(self)

    def saved(self) -> str:
        """Text of a file with its numbers as they were changed."""
        return scenario_to_toml(self)

    def text_in(self, folder: str | os.PathLike[str]) -> str:
        """Its text for a file in a folder, from which the files that it names are found."""
        return scenario_to_toml(self, folder=folder)

    def digest(self) -> str:
        """Sixteen hexadecimal digits that change when a value, or the contents of its CSV reference, change."""
        return scenario_hash(self)

    def reference_file(self) -> Path | None:
        """The file of a CSV reference, resolved; None for the other kinds."""
        if isinstance(self.reference, CsvReference):
            return self.source.parent / self.reference.file
        return None


def parse_scenario(text: str, source: str | os.PathLike[str] = "scenario.toml") -> Scenario:
    """Read a scenario from its text; messages name the source, and a CSV reference is relative to its folder."""
    source = Path(source)
    file = source.name
    bases: list[Path] = []
    raw: Mapping[str, object] = with_base(toml_of(text, file), source, bases)
    _check_schema(raw, file)
    _check_names(raw, file)
    _check_removed(raw.get("optimal"), file)
    name = raw.get("name", source.stem)
    if not isinstance(name, str):
        raise InputError(f'{file}: name must be text in quotes ("..."), got {show(name)}')
    sections, path = path_keys(raw.get("path", {}), file)
    raw_tendon = raw.get("tendon")
    spread, robust = spread_keys(raw.get("robust", {}), file)
    expanded = {"path": path, "load": _load_keys(raw.get("load", {}), file), "robust": robust}
    raw = _complete({**raw, **{key: value for key, value in expanded.items() if key in raw}}, file)

    def table(cls: type, key: str) -> object:
        return read_table(cls, raw.get(key, {}), file=file, table=key)

    parts = {key: table(cls, key) for key, cls in (_TABLES | _OPTIONAL).items()}
    if sections:
        parts["path"] = replace(parts["path"], sections=sections)  # type: ignore[type-var]
    run = parts.pop("run")
    optional = {key: parts.pop(key) for key in _OPTIONAL}
    optional |= {key: table(cls, key) for key, cls in _ON_REQUEST.items() if key in raw}
    if isinstance(feedback := optional.get("feedback"), Feedback):
        feedback.require_tension(file)
    try:
        transmission = Transmission(**parts)  # type: ignore[arg-type]
        for section in sections:
            section.check_coefficients(transmission.friction.mu_dynamic, transmission.friction.release_dynamic)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    optional["robust"] = with_spread(optional["robust"], spread, transmission, file)  # type: ignore[arg-type]
    _check_length(raw_tendon, sections, file)
    joints = read_joints(raw.get("joints", {}), file)
    for joint in (*(section.joint for section in sections), transmission.load.joint):
        if joint is not None and joint not in joints:
            given = ", ".join(joints) or "none"
            raise InputError(
                f'{file}: the joint "{joint}" is named but not given (given: {given}); add [joints.{joint}]'
            )
    return Scenario(
        name=name,
        transmission=transmission,
        reference=read_kind(_KINDS, raw["reference"], file=file, table="reference"),
        run=run,  # type: ignore[arg-type]
        source=source,
        bases=tuple(bases),
        joints=joints,
        **optional,  # type: ignore[arg-type]
    )


def path_keys(raw: object, file: str) -> tuple[tuple[Section, ...], object]:
    """The sections of [path], and its other keys with the total angle that they add up to."""
    if not isinstance(raw, Mapping) or "sections" not in raw:
        return (), raw
    if "total_angle_rad" in raw:
        raise InputError(
            f"{file} [path]: give total_angle_rad or [[path.sections]], not both; the sections add up to it"
        )
    sections = _sections(raw["sections"], file)
    others = {key: value for key, value in raw.items() if key != "sections"}
    return sections, {**others, "total_angle_rad": math.fsum(section.angle_rad for section in sections)}


def spread_keys(raw: object, file: str) -> tuple[tuple[Spread, ...], object]:
    """The intervals of [robust.spread], and the other keys of [robust]."""
    if not isinstance(raw, Mapping) or "spread" not in raw:
        return (), raw
    given = raw["spread"]
    if not isinstance(given, Mapping):
        raise InputError(f"{file} [robust]: spread must be a table, got {show(given)}; write [robust.spread]")
    found = []
    for name, value in given.items():
        if isinstance(value, Mapping):
            raise InputError(
                f'{file} [robust.spread]: write the dotted key in quotes: "{name}.{next(iter(value), "")}"'
            )
        keys = tuple(key.strip() for key in name.split(","))
        ends = value if isinstance(value, list) else [value]
        if any(isinstance(end, bool) or not isinstance(end, int | float) for end in ends) or len(ends) > 2:
            raise InputError(
                f'{file} [robust.spread]: "{name}" must be a relative half-width or [low, high], got {show(value)}'
            )
        numbers = {"half_width": float(ends[0])} if not isinstance(value, list) else {}
        if isinstance(value, list):
            numbers = dict(zip(("low", "high"), map(float, ends), strict=False))
        try:
            found.append(Spread(keys=keys, **numbers))
        except ParameterError as error:
            raise InputError(f"{file} [robust.spread]: {error}") from None
    return tuple(found), {key: value for key, value in raw.items() if key != "spread"}


def with_spread(robust: Uncertainty, spread: tuple[Spread, ...], system: object, file: str) -> Uncertainty:
    """[robust] with its intervals, each tried at both ends; InputError where one has no meaning."""
    known = keys_of(system)
    for key in (key for one in spread for key in one.keys):
        if key not in known:
            raise InputError(f'{file} [robust.spread]: unknown key "{key}"{suggestion(key, known)}')
    try:
        robust = replace(robust, spread=spread)
        robust.check_correlation()
        if robust.other_law is not None:
            robust.other_law.of(system)
        for one in robust.spreads:
            one.check(system)
            for place in (-1.0, 1.0):
                with_numbers(system, one.values(system, place))
    except ParameterError as error:
        raise InputError(f"{file} [robust.spread]: {error}") from None
    return robust


def _sections(raw: object, file: str) -> tuple[Section, ...]:
    if not isinstance(raw, list) or not raw:
        raise InputError(f"{file} [path]: sections must be tables, got {show(raw)}; write [[path.sections]]")
    for k, item in enumerate(raw, start=1):
        if isinstance(item, Mapping) and isinstance(item.get("joint"), list):
            raise InputError(
                f"{file} [path.sections {k}]: joint must be one name, got {show(item['joint'])}; a section that "
                "two joints move must be cut into two"
            )
    sections = tuple(read_table(Section, item, file=file, table=f"path.sections {k}") for k, item in enumerate(raw, 1))
    names = [section.name for section in sections]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f'{file} [path]: two sections are named "{twice[0]}"; each needs a name of its own')
    return sections


def _check_length(tendon: object, sections: tuple[Section, ...], file: str) -> None:
    """Refuse a length of the tendon that is not that of the path it lies on."""
    lengths = [section.length_m for section in sections if section.length_m is not None]
    own = tendon.get("length_m") if isinstance(tendon, Mapping) else None
    if own is None or not sections or len(lengths) < len(sections):
        return
    if not math.isclose(own, total := math.fsum(lengths), rel_tol=0.01):
        raise InputError(
            f"{file}: two sources for one quantity: [tendon] length_m = {own:g}, and {total:g} from length_m of the "
            "sections of [path]; correct one of them, or leave out those of the sections"
        )


def _load_keys(raw: object, file: str) -> object:
    """[load] without its kind; a joint needs neither mass nor spring."""
    if not isinstance(raw, Mapping):
        return raw
    kind, keys = raw.get("kind", "spring"), {key: value for key, value in raw.items() if key != "kind"}
    if kind not in ("spring", "joint"):
        raise InputError(f'{file} [load]: kind must be "spring" or "joint", got {show(kind)}')
    if (kind == "joint") != ("joint" in keys):
        raise InputError(f'{file} [load]: kind = "joint" and the key joint belong together; give both or none')
    return {**_HELD_BY_JOINT, **keys} if kind == "joint" else keys


def _check_removed(optimal: object, file: str) -> None:
    """Refuse keys of [optimal] that are no more, with what to do instead."""
    for key in optimal if isinstance(optimal, Mapping) else ():
        if key in REMOVED_OPTIMAL:
            raise InputError(f'{file} [optimal]: key "{key}" was removed in 0.3.0: {REMOVED_OPTIMAL[key]}')


def _check_schema(raw: Mapping[str, object], file: str) -> None:
    schema = raw.get("schema")
    if schema is None:
        raise InputError(f'{file}: key "schema" is missing; write schema = {SCHEMA} in the first line')
    if isinstance(schema, bool) or schema != SCHEMA:
        raise InputError(f"{file}: schema must be {SCHEMA}, got {show(schema)}; this version reads no other")


def _check_names(raw: Mapping[str, object], file: str) -> None:
    known = ["schema", "name", *_REQUIRED_TABLES, "joints", *_OPTIONAL, *_ON_REQUEST]
    for key, value in raw.items():
        if key in known:
            continue
        if isinstance(value, Mapping):
            near = suggestion(key, [*_REQUIRED_TABLES, "joints", *_OPTIONAL, *_ON_REQUEST]).replace('"', "")
            raise InputError(f"{file}: unknown table [{key}]{near}")
        raise InputError(f'{file}: unknown key "{key}"{suggestion(key, known)}')


def _complete(raw: Mapping[str, object], file: str) -> dict[str, object]:
    """The tables with what follows from their keys; all keys that are missing then are named in one message."""
    complete: dict[str, object] = dict(raw)
    lacking: dict[str, list[str]] = {}
    for key, cls in _TABLES.items():
        given = raw.get(key, {})
        check_names(cls, given, file=file, table=key, extra_keys=ROPE_KEYS if key == "tendon" else ())
        expanded = expand(key, given, file=file)  # type: ignore[arg-type]
        if missing := missing_keys(cls, expanded):
            # static friction follows from the dynamic coefficient
            lacking[key] = ["mu_dynamic"] if "mu_dynamic" in missing else missing
        if key in raw:
            complete[key] = expanded
    reference = raw.get("reference")
    if isinstance(reference, Mapping) and (kind := _KINDS.get(str(reference.get("kind")))) is not None:
        if missing := missing_keys(kind, reference):
            lacking["reference"] = missing
    elif reference is None:
        lacking["reference"] = ['kind ("sine", "waypoints" or "csv") and the keys of that kind']
    if sum(map(len, lacking.values())) > 1 or reference is None:
        listed = "; ".join(f"[{key}] {', '.join(names)}" for key, names in lacking.items())
        stiffness = "stiffness_N_per_m" in lacking.get("tendon", ())
        rope = "; elastic_modulus_Pa, length_m and diameter_m may stand for stiffness_N_per_m" if stiffness else ""
        raise InputError(f'{file}: missing: {listed}{rope}; "tendonff new" writes a file that explains every key')
    return complete


def scenario_to_toml(scenario: Scenario, *, folder: str | os.PathLike[str] | None = None) -> str:
    """Text of a scenario file that reads back as the same scenario; writes every key that is set.

    The file of a CSV reference is named so that it is found from the folder that the text will be stored in; default:
    where the scenario came from.
    """
    reference = scenario.reference
    kind = next(kind for kind, cls in _KINDS.items() if isinstance(reference, cls))
    if scenario.compare is not None and folder is not None:
        force = relative_to_folder(scenario.source.parent / scenario.compare.force, folder)
        scenario = replace(scenario, compare=replace(scenario.compare, force=force))
    if isinstance(reference, CsvReference) and folder is not None:
        reference = replace(reference, file=relative_to_folder(scenario.source.parent / reference.file, folder))
    transmission = scenario.transmission
    tables: dict[str, object] = {key: getattr(transmission, key) for key in _TABLES if key != "run"}
    tables["reference"] = reference
    own = {key: getattr(scenario, key) for key in ("run", *_OPTIONAL, *_ON_REQUEST)}
    tables |= {key: value for key, value in own.items() if key != "optimal" or value != TrackOptions()}  # an old hash
    parts = [f"schema = {SCHEMA}\nname = {toml_value(scenario.name)}\n"]
    for table, value in tables.items():
        if value is None:
            continue
        lines = f'kind = "{kind}"\n' if table == "reference" else ""
        if table == "load" and transmission.load.joint is not None:
            lines = 'kind = "joint"\n'
        if table == "path" and transmission.path.sections:
            plain = replace(transmission.path, sections=())
            lines += toml_table(plain, table).replace(f"total_angle_rad = {toml_value(plain.total_angle_rad)}\n", "")
            sections = "".join(f"\n[[path.sections]]\n{toml_table(part)}" for part in transmission.path.sections)
            parts.append(f"\n[{table}]\n{lines}{sections}")
            continue
        if isinstance(value, Uncertainty):
            lines += toml_table(replace(value, spread=()), table) + _spread_toml(value.spread)
        else:
            motor = transmission.actuator.motor if table == "actuator" else None
            lines += toml_table(value, table, without=() if motor is None else tuple(motor.at_the_drum))
        if lines:
            parts.append(f"\n[{table}]\n{lines}")
    for name, joint in scenario.joints.items():
        known = next(kind for kind, cls in JOINT_KINDS.items() if isinstance(joint, cls))
        parts.append(f'\n[joints.{name}]\nkind = "{known}"\n{toml_table(joint)}')
    return "".join(parts)


def _spread_toml(spread: tuple[Spread, ...]) -> str:
    """The table [robust.spread], where there is one."""
    rows = []
    for one in spread:
        width = one.half_width if one.half_width is not None else (one.low, one.high)
        rows.append(f"{toml_value(one.name)} = {toml_value(width)}\n")
    return "\n[robust.spread]\n" + "".join(rows) if rows else ""


def relative_to_folder(file: Path, folder: str | os.PathLike[str]) -> str:
    """Name of a file by which it is found from a folder."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return file.absolute().as_posix()


def scenario_hash(scenario: Scenario) -> str:
    """Sixteen hexadecimal digits that change when the scenario, or the contents of its CSV reference, change.

    The name of the file it was read from and its comments do not matter.
    """
    digest = hashlib.sha256(scenario_to_toml(scenario).encode())
    if (file := scenario.reference_file()) is not None:
        digest.update(read_text(file).encode())
    for path in scenario.inputs:
        digest.update(read_text(path).encode())
    return digest.hexdigest()[:16]
