"""Scenario files of several driven joints: [joints.NAME], [[tendons]] that cross them, [[motors]] and [sharing]."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, read_csv, suggestion
from tendonff.compensator.files.text import require_named
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.driven.common import (
    PARTS,
    DrivenScenario,
    check_schema,
    instants,
    read_lengths,
    read_name,
    read_robust,
    read_tendons,
    tendon_part,
)
from tendonff.compensator.scenario.driven.paths import read_paths, tabulated, with_measures
from tendonff.compensator.scenario.driven.reference import JointQuantity, JointSine, JointWaypoints
from tendonff.compensator.scenario.goal import Goal
from tendonff.compensator.scenario.joints import Joint, read_joints
from tendonff.compensator.scenario.kind import Kind
from tendonff.compensator.scenario.knobs import FRICTION_AND_STIFFNESS, Knob
from tendonff.compensator.scenario.sampled.joint_motion import joint_angles
from tendonff.compensator.scenario.settings import Run
from tendonff.compensator.scenario.tables import read_table, show
from tendonff.compensator.scenario.toml import toml_of
from tendonff.compensator.scenario.unit import RADIAN
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Arm, DriveKind, DrivenJoint, JointDrive, JointTendon
from tendonff.models.joint.parameters.finger import Finger, Motor
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.path import JointMotion

_TABLES = (
    *("joints", "tendons", "motors", "drive", "sharing", "reference", "run", "robust"),
    *PARTS,
)
NO_FEEDBACK = (
    "its law corrects the motors of one joint, and here joints share motors; let an integral action at the encoders "
    "correct the reference angles"
)
"""Why several joints have no feedback, and the way out."""
_OF_TENDON = ("name", "moment_arms_m", "moment_arm_m", "joint", "lengths", "paths", *PARTS)
_REFERENCE = ("kind", "file", "duration_s", "fade_in_s", "times_s", "shape", "periodic", "quantity")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FingerScenario(DrivenScenario):
    """Content of a scenario file of several driven joints.

    Attributes
    ----------
    name : str
    mechanism : Finger
    joints : dict of str to Joint
        What joints do that sections name and no tendon drives.
    references : dict of str to (JointSine or JointWaypoints)
        By joint; empty where the reference is a file.
    wanted : int
        Number of joints with a reference: the first ones of the mechanism. The others follow from their balances, where
        there are fewer tendons than joints.
    file : str or None
        Of the reference: columns time_s and NAME_rad.
    periodic : bool
        The reference is one cycle of many.
    torques : dict of str to str
        Files of what the motion of a joint needs besides its own numbers: columns time_s and NAME_N_m.
    run : Run
    robust : Uncertainty
    source : Path
        The file it was read from.
    text : str
        Its text.
    inputs : tuple of Path
        Files that it names.
    changed : dict of str to float
        Numbers that were changed since it was read, by key; factors for mu, stiffness and bristle_stiffness.
    """

    kind: ClassVar[Kind] = Kind.FINGER
    mechanism: Finger
    references: dict[str, JointSine | JointWaypoints]
    wanted: int
    file: str | None
    periodic: bool
    torques: dict[str, str]

    @property
    def system(self) -> Finger:
        """Everything physical about it."""
        return self.mechanism

    @property
    def goal(self) -> Goal:
        """Wanted angles."""
        names = self.mechanism.names[: self.wanted]
        return Goal(quantity="joint angle", unit=RADIAN, names=names, is_named=True)

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """Numbers that the interactive page turns; the least tension only where motors share it."""
        finger = self.mechanism
        loops = {motor.name: motor.drive.pretension_N for motor in finger.motors if len(motor.winds) > 1}
        shared = Knob.tension("sharing.least_tension_N", "least tension [N]", finger.sharing.least_tension_N)
        return (
            *FRICTION_AND_STIFFNESS,
            *((shared,) if len(loops) < len(finger.motors) else ()),
            *(Knob.tension(f"motors.{m}.drive.pretension_N", f"pre-tension of {m} [N]", t) for m, t in loops.items()),
            *(Knob.weight(j.name, f"torque of the weight at {j.name} [N m]", j.gravity_N_m) for j in finger.joints),
        )

    def put_motors(self, raw: dict[str, Any], motors: Sequence[Motor]) -> None:
        """Put dry friction and pre-tension of motors into the tables of its file."""
        rows = raw.setdefault(
            "motors", [{"name": m.name, "drums_m": dict(zip(m.winds, m.radii_m, strict=True))} for m in motors]
        )
        for row, motor in zip(rows, motors, strict=True):
            row["coulomb_N_m"] = motor.drive.coulomb_N_m
            if len(motor.winds) > 1:
                row["pretension_N"] = motor.drive.pretension_N

    def reference_file(self) -> Path | None:
        """The file of a CSV reference, resolved; None for the other kinds."""
        return None if self.file is None else self.source.parent / self.file


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledFinger:
    """Reference of several joints, sample by sample.

    Attributes
    ----------
    time_s : ndarray, shape (rows,)
    angle_rad : ndarray, shape (rows, joints)
        Of the driven joints; of those without a reference, where their springs rest.
    effort_N_m : ndarray, shape (rows, joints)
        What their motion needs besides their own numbers.
    motion : JointMotion
        Of the driven joints, then of the others.
    """

    time_s: FloatArray
    angle_rad: FloatArray
    effort_N_m: FloatArray
    motion: JointMotion


def parse_finger_scenario(text: str, source: str | os.PathLike[str] = "scenario.toml") -> FingerScenario:
    """Read one from its text; files that it names are relative to the source's folder."""
    source = Path(source)
    file = source.name
    raw: dict[str, object] = toml_of(text, file)
    inputs: list[Path] = []
    raw = with_base(raw, source, inputs)
    _check_tables(raw, file)
    joints, torques, others = _joints(raw["joints"], file)
    references, csv, periodic = _reference(raw["reference"], tuple(joint.name for joint in joints), file)
    if csv is None:
        joints = tuple(sorted(joints, key=lambda joint: joint.name not in references))  # those that follow come last
    names = tuple(joint.name for joint in joints)
    sharing = _sharing(raw, file)
    tendons = read_tendons(
        raw,
        file,
        _OF_TENDON,
        lambda row, at: _arms(row, names, source, at, inputs),
        lambda row, content, at: _measured_path(row["paths"], content, source, at, inputs) if "paths" in row else None,
        unnamed="tendon",
    )
    motors = _motors(raw, tendons, sharing, file)
    try:
        mechanism = Finger(joints=joints, tendons=tendons, motors=motors, sharing=sharing)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    wanted = len(joints) if csv is not None else len(references)
    if wanted < len(joints) and wanted != len(tendons):
        missing = ", ".join(f"[reference.joints.{name}]" for name in names[wanted:])
        raise InputError(
            f"{file}: missing: {missing}; joints without a reference follow from their springs only where there are as "
            f"many tendons as wanted joints, got {len(tendons)} tendons"
        )
    named = [csv, *torques.values(), *(getattr(other, "file", None) for other in others.values())]
    return FingerScenario(
        name=read_name(raw, source),
        mechanism=mechanism,
        joints=others,
        references=references,
        wanted=wanted,
        file=csv,
        periodic=periodic,
        torques=torques,
        run=read_table(Run, raw["run"], file=file, table="run"),
        robust=read_robust(raw, mechanism, file),
        source=source,
        text=text,
        inputs=(*inputs, *(source.parent / each for each in named if each)),
    )


def sample_finger(scenario: FingerScenario) -> SampledFinger:
    """Reference at the steps of the run; InputError where it has no meaning."""
    folder, step, file = scenario.source.parent, scenario.run.step_s, scenario.source.name
    names = scenario.mechanism.names
    if scenario.file is not None:
        columns = tuple(f"{name}_rad" for name in names)
        require_named(folder / scenario.file, f"{file} [reference]: file")
        table = read_csv(folder / scenario.file, ("time_s", *columns), increasing="time_s", starts_at_zero=True)
        length = float(table["time_s"][-1])
        time = instants(length, step, file)
        from scipy.interpolate import PchipInterpolator  # a third of a second to import, for a smooth file alone

        found = [PchipInterpolator(table["time_s"], table[column])(np.minimum(time, length)) for column in columns]
    else:
        length = max(reference.length_s(folder) for reference in scenario.references.values())
        time = instants(length, step, file)
        found = [scenario.references[name].sample(time, folder) for name in names[: scenario.wanted]]
        still = [np.full(len(time), joint.rest_rad) for joint in scenario.mechanism.joints[scenario.wanted :]]
        found += still
    angle = np.column_stack(found)
    if not np.ptp(angle, axis=0).any():
        raise InputError(f"{file} [reference]: no joint ever moves, so there is nothing to design; let one move")
    if scenario.periodic and (off := float(np.abs(angle[-1] - angle[0]).max())) > 1e-3 * np.ptp(angle, axis=0).max():
        raise InputError(
            f"{file} [reference]: periodic = true, but a joint ends {off:.3g} rad from where it starts; give whole "
            "periods and fade_in_s = 0"
        )
    for joint, column in zip(scenario.mechanism.joints[: scenario.wanted], angle.T, strict=False):
        try:
            joint.accepted_rad(float(column.min()), float(column.max()))
        except ParameterError as error:
            raise InputError(f"{file} [joints.{joint.name}]: {error}") from None
    others = [joint_angles(other, name, time, folder, length) for name, other in scenario.joints.items()]
    motion = JointMotion(names=(*names, *scenario.joints), time_s=time, angle_rad=np.column_stack([angle, *others]))
    effort = np.zeros_like(angle)
    for name, torque_file in scenario.torques.items():
        column = f"{name}_N_m"
        require_named(folder / torque_file, f"{file} [joints.{name}]: torques")
        table = read_csv(folder / torque_file, ("time_s", column), increasing="time_s")
        effort[:, names.index(name)] = np.interp(time, table["time_s"], table[column])
    return SampledFinger(time_s=time, angle_rad=angle, effort_N_m=effort, motion=motion)


def _check_tables(raw: Mapping[str, object], file: str) -> None:
    check_schema(raw, file)
    if "feedback" in raw:
        raise InputError(f"{file} [feedback]: several joints have none: {NO_FEEDBACK}")
    for key in raw:
        if key not in ("schema", "name", *_TABLES):
            near = suggestion(key, list(_TABLES)).replace('"', "")
            raise InputError(f"{file}: unknown table [{key}]{near}")
    missing = [key for key in ("joints", "tendons", "reference", "run") if key not in raw]
    if "motors" not in raw and "drive" not in raw:
        missing.append("motors")
    if missing:
        listed = ", ".join(f"[{key}]" for key in missing)
        raise InputError(f'{file}: missing: {listed}; "tendonff new --for finger" writes a file with every key')


def _joints(raw: object, file: str) -> tuple[tuple[DrivenJoint, ...], dict[str, str], dict[str, Joint]]:
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: joints must be a table of tables, got {show(raw)}; write [joints.NAME]")
    driven = {k: v for k, v in raw.items() if isinstance(v, Mapping) and v.get("kind") == "driven"}
    torques = {}
    for name, table in driven.items():
        if "torques" in table:
            if not isinstance(table["torques"], str):
                raise InputError(f"{file} [joints.{name}]: torques must name a CSV file, got {show(table['torques'])}")
            torques[name] = table["torques"]
    joints = tuple(
        read_table(
            DrivenJoint, {**table, "name": name}, file=file, table=f"joints.{name}", extra_keys=("kind", "torques")
        )
        for name, table in driven.items()
    )
    return joints, torques, read_joints({k: v for k, v in raw.items() if k not in driven}, file)


def _sharing(raw: Mapping[str, object], file: str) -> Sharing:
    given = raw.get("sharing", {})
    drive = raw.get("drive", {})
    least = drive.get("least_tension_N") if isinstance(drive, Mapping) else None
    if isinstance(given, Mapping) and least is not None:
        given = {"least_tension_N": least, **given}
    return read_table(Sharing, given, file=file, table="sharing")


def _measured_path(named: object, raw: object, source: Path, where: str, inputs: list[Path]) -> TendonPath:
    """A path whose sections have their bends and lengths from a file of paths."""
    if not isinstance(named, str):
        raise InputError(f"{source.name} [{where}]: paths must name a CSV file, got {show(named)}")
    at = f"{source.name} [{where}]"
    inputs.append(file := source.parent / named)
    require_named(file, f"{at}: paths")
    known = read_paths(file)
    return tabulated(tendon_part("path", with_measures(raw, known, file, at), source.name, where), known, file)  # type: ignore[arg-type]


def _arms(
    row: Mapping[str, object], joints: Sequence[str], source: Path, where: str, inputs: list[Path]
) -> tuple[Arm, ...]:
    arms: list[Arm] = []
    given = row.get("moment_arms_m", {})
    if not isinstance(given, Mapping):
        raise InputError(f"{source.name} [{where}]: moment_arms_m must be a table, such as {{ mcp = 0.01 }}")
    for name, arm in given.items():
        if name not in joints:
            raise InputError(f'{source.name} [{where}]: no driven joint "{name}"{suggestion(name, list(joints))}')
        if isinstance(arm, bool) or not isinstance(arm, int | float):
            raise InputError(f"{source.name} [{where}]: the moment arm about {name} must be a number, got {show(arm)}")
        arms.append(Arm(joint=name, moment_arm_m=float(arm)))
    if "lengths" in row:
        joint, file = row.get("joint"), row["lengths"]
        if joint not in joints or not isinstance(file, str):
            raise InputError(f"{source.name} [{where}]: lengths names a CSV file, and joint the joint that it is for")
        known = read_lengths(source.parent / file, inputs, f"{source.name} [{where}]")
        arms.append(Arm(joint=str(joint), lengths=known))
    if "moment_arm_m" in row:
        raise InputError(
            f"{source.name} [{where}]: several joints are driven; write moment_arms_m = {{ {joints[0]} = ... }}"
        )
    return tuple(arms)


def _motors(
    raw: Mapping[str, object], tendons: Sequence[JointTendon], sharing: Sharing, file: str
) -> tuple[Motor, ...]:
    shared = raw.get("drive", {})
    if not isinstance(shared, Mapping):
        raise InputError(f"{file}: drive must be a table, got {show(shared)}; write [drive] on a line of its own")
    rows = raw.get("motors")
    if rows is None:  # a motor for each tendon, called like it
        radius = shared.get("drum_radius_m")
        radii = radius if isinstance(radius, list) else [radius] * len(tendons)
        if shared.get("kind", "pair") != "pair" or len(radii) != len(tendons):
            raise InputError(f"{file} [drive]: write [[motors]] with drums_m; [drive] alone is one motor a tendon")
        rows = [{"name": t.name, "drums_m": {t.name: r}} for t, r in zip(tendons, radii, strict=True)]
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{file}: motors must be tables, got {show(rows)}; write [[motors]]")
    common = {k: v for k, v in shared.items() if k not in ("kind", "drum_radius_m", "pretension_N", "least_tension_N")}
    return tuple(_motor(row, common, shared, sharing, file, f"motors {k}") for k, row in enumerate(rows, start=1))


def _motor(
    row: object, common: Mapping[str, object], shared: Mapping[str, object], sharing: Sharing, file: str, where: str
) -> Motor:
    if not isinstance(row, Mapping) or not isinstance(drums := row.get("drums_m"), Mapping) or not drums:
        raise InputError(f"{file} [{where}]: drums_m is missing, such as {{ flexor = 0.008, extensor = -0.008 }}")
    for tendon, radius in drums.items():
        if isinstance(radius, bool) or not isinstance(radius, int | float):
            raise InputError(f"{file} [{where}]: the drum of {tendon} must be a radius [m], got {show(radius)}")
    name = row.get("name", "_".join(drums))
    if not isinstance(name, str) or not name.isidentifier():
        raise InputError(f"{file} [{where}]: name must be letters, digits and underscores, got {show(name)}")
    own = {k: v for k, v in row.items() if k not in ("name", "drums_m")}
    keys = {**common, **own, "drum_radius_m": [abs(float(radius)) for radius in drums.values()]}
    if len(drums) > 1:
        keys |= {"kind": str(DriveKind.LOOP), "pretension_N": own.get("pretension_N", shared.get("pretension_N"))}
        if keys["pretension_N"] is None:
            raise InputError(f"{file} [{where}]: a motor with {len(drums)} tendons needs pretension_N")
    else:
        keys |= {"kind": str(DriveKind.PAIR), "least_tension_N": max(sharing.least_tension_N, 1e-9)}
    drive = read_table(JointDrive, keys, file=file, table=where)
    radii = tuple(float(radius) for radius in drums.values())
    try:
        return Motor(name=name, winds=tuple(drums), radii_m=radii, drive=drive)
    except ParameterError as error:
        raise InputError(f"{file} [{where}]: {error}") from None


def _check_reference(raw: Mapping[str, object], file: str) -> bool:
    """Refuse unknown keys of a reference; whether it is one cycle of many."""
    for key in raw:
        if key not in (*_REFERENCE, "joints"):
            raise InputError(f'{file} [reference]: unknown key "{key}"{suggestion(key, [*_REFERENCE, "joints"])}')
    if (quantity := raw.get("quantity", JointQuantity.ANGLE)) != JointQuantity.ANGLE:
        raise InputError(
            f'{file} [reference]: quantity must be "angle" where several joints are driven, got {show(quantity)}; '
            "the torques that they give to what they touch go into [joints.NAME] torques"
        )
    if not isinstance(periodic := raw.get("periodic", False), bool):
        raise InputError(f"{file} [reference]: periodic must be true or false, got {show(periodic)}")
    return periodic


def _reference(
    raw: object, joints: Sequence[str], file: str
) -> tuple[dict[str, JointSine | JointWaypoints], str | None, bool]:
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: reference must be a table, got {show(raw)}; write [reference] on a line of its own")
    periodic = _check_reference(raw, file)
    kind = raw.get("kind")
    if kind == "csv":
        if not isinstance(raw.get("file"), str):
            raise InputError(
                f"{file} [reference]: file must name a CSV with time_s and a column NAME_rad of each joint"
            )
        return {}, str(raw["file"]), periodic
    kinds: dict[object, type[JointSine | JointWaypoints]] = {"sine": JointSine, "waypoints": JointWaypoints}
    if kind not in kinds:
        raise InputError(f'{file} [reference]: kind must be one of "sine", "waypoints", "csv", got {show(kind)}')
    top = {key: value for key, value in raw.items() if key not in ("joints", "kind")}
    given = raw.get("joints", {})
    if not isinstance(given, Mapping):
        raise InputError(f"{file} [reference]: joints must be tables, got {show(given)}; write [reference.joints.NAME]")
    for name in given:
        if name not in joints:
            raise InputError(f'{file} [reference.joints]: no driven joint "{name}"{suggestion(name, list(joints))}')
    if not given:
        raise InputError(f"{file}: missing: [reference.joints.{joints[0]}]; give each joint its reference")
    found = {
        name: read_table(kinds[kind], {**top, **given[name]}, file=file, table=f"reference.joints.{name}")
        for name in joints
        if name in given
    }
    return found, None, periodic
