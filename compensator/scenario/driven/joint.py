"""Scenario files of a driven joint: [joints.NAME] kind = "driven", [[tendons]] and [drive] instead of one tendon."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
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
)
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.driven.reference import KINDS, JointQuantity, JointReference
from tendonff.compensator.scenario.driven.settings import JointAdaptation
from tendonff.compensator.scenario.goal import Goal
from tendonff.compensator.scenario.joints import KINDS as MOVED
from tendonff.compensator.scenario.joints import Joint, read_joints
from tendonff.compensator.scenario.kind import Kind
from tendonff.compensator.scenario.knobs import FRICTION_AND_STIFFNESS, Knob
from tendonff.compensator.scenario.reference import Shape, along_waypoints
from tendonff.compensator.scenario.sampled.joint_motion import joint_angles
from tendonff.compensator.scenario.settings import Feedback, Run
from tendonff.compensator.scenario.tables import read_kind, read_table, show
from tendonff.compensator.scenario.toml import toml_of
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Arm, DrivenJoint, JointDrive, Mechanism
from tendonff.models.joint.parameters.finger import Motor
from tendonff.models.path import JointMotion

_TABLES = ("joints", "tendons", "drive", "reference", "run", "robust", "adaptation", "feedback", "observer", *PARTS)
_TENDON_KEYS = ("name", "moment_arm_m", "lengths", *PARTS)
_MOST_LAG_S = 0.05  # of a servo on the interactive page
_NOT_FOR_A_JOINT = {
    "actuator": "the motors stand in [drive]",
    "load": "the joint is the load",
    "stiffness": "a joint between linear tendons has no stiffness to choose: the torque and one tension decide all",
}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class JointScenario(DrivenScenario):
    """Everything that a scenario file of a driven joint says.

    Attributes
    ----------
    name : str
        What it is, in words.
    mechanism : Mechanism
    joints : dict of str to Joint
        What the other joints do that sections of the paths name.
    reference : JointReference
    motion : JointReference or None
        Of a wanted torque: how the joint moves.
    run : Run
    robust : Uncertainty
    observer : ObserverTable or None
        Laws of angle and torque from the motor, where `identify` has fitted them.
    adaptation : JointAdaptation or None
        Self-tuning, where the file has the table.
    feedback : Feedback or None
        Feedback beside the feedforward, where the file has the table.
    source : Path
        The file it was read from.
    text : str
        Its text.
    inputs : tuple of Path
        Files that it names.
    changed : dict of str to float
        Numbers that were changed since it was read, by key; factors for mu, stiffness and bristle_stiffness.
    """

    kind: ClassVar[Kind] = Kind.JOINT
    mechanism: Mechanism
    reference: JointReference
    motion: JointReference | None
    observer: ObserverTable | None = None
    adaptation: JointAdaptation | None = None
    feedback: Feedback | None = None

    @property
    def goal(self) -> Goal:
        """Wanted angle or torque."""
        angle = self.reference.quantity is JointQuantity.ANGLE
        quantity = "joint angle" if angle else "torque of the joint"
        return Goal(quantity=quantity, unit=self.reference.shown, names=(self.mechanism.joint.name,))

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """Numbers that the interactive page turns."""
        joint, drive = self.mechanism.joint, self.mechanism.drive
        lag, key = drive.servo.servo_time_s, f"joints.{joint.name}"
        decades = (
            ("inertia_kg_m2", "moving inertia [kg m2]"),
            ("damping_N_m_s_per_rad", "damping of the joint [N m s/rad]"),
        )
        return (
            *FRICTION_AND_STIFFNESS,
            Knob.tension("drive.least_tension_N", "least tension [N]", drive.least_tension_N)
            if drive.pretension_N is None
            else Knob.tension("drive.pretension_N", "pre-tension [N]", drive.pretension_N, 0.0),
            Knob.weight(joint.name, "torque of the weight [N m]", joint.gravity_N_m),
            Knob(
                key="drive.servo_time_s",
                title="lag of the servo [s]",
                value=lag,
                start=0.0,
                end=max(_MOST_LAG_S, 2 * lag),
                step=0.001,
            ),
            *(
                Knob.decades(f"{key}.{name}", title, value, 1.0)
                for name, title in decades
                if (value := getattr(joint, name))
            ),
        )

    def put_motors(self, raw: dict[str, Any], motors: Sequence[Motor]) -> None:
        """Put dry friction of motors, of which it states one, into the tables of its file."""
        raw["drive"]["coulomb_N_m"] = float(np.mean([m.drive.coulomb_N_m for m in motors]))

    def reference_file(self) -> Path | None:
        """The file of a CSV reference, resolved; None for the other kinds."""
        name = getattr(self.reference, "file", None)
        return None if name is None else self.source.parent / name

    def reference_start_rad(self) -> float:
        """Angle of the joint at which the reference starts."""
        spec = self.reference if self.motion is None else self.motion
        return float(spec.sample(np.zeros(1), self.source.parent)[0])

    @property
    def system(self) -> Mechanism:
        """Everything physical about it."""
        return self.mechanism


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledJoint:
    """Reference, sample by sample.

    Attributes
    ----------
    time_s, angle_rad, contact_N_m : ndarray, shape (rows,)
        Steps of the run, motion of the joint, and torque that it gives to what it touches.
    wanted : ndarray, shape (rows,)
        The one of both that is wanted.
    motion : JointMotion
        Of the driven joint and all others.
    lead : int
        Rows of the homing stroke, which come first.
    warnings : tuple of str
        Where the motion was taken back to a stop.
    """

    time_s: FloatArray
    angle_rad: FloatArray
    contact_N_m: FloatArray
    wanted: FloatArray
    motion: JointMotion
    lead: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def range(self) -> float:
        """Largest less smallest wanted value, after the homing stroke."""
        return float(np.ptp(self.wanted[self.lead :]))

    def others(self, joint: str) -> dict[str, FloatArray]:
        """Angles of the other joints by name, shape (rows,)."""
        columns = dict(zip(self.motion.names, self.motion.angle_rad.T, strict=True))
        return {name: column for name, column in columns.items() if name != joint}


def parse_joint_scenario(text: str, source: str | os.PathLike[str] = "scenario.toml") -> JointScenario:
    """Read one from its text; files that it names are relative to the source's folder."""
    source = Path(source)
    file = source.name
    raw: dict[str, object] = toml_of(text, file)
    inputs: list[Path] = []
    raw = with_base(raw, source, inputs)
    _check_tables(raw, file)
    driven, others = _split_joints(raw.get("joints"), file)
    tendons = read_tendons(raw, file, _TENDON_KEYS, lambda row, at: (_arm(row, driven.name, source, at, inputs),))
    drive = _drive(raw.get("drive"), file)
    try:
        mechanism = Mechanism(joints=(driven,), tendons=tendons, drive=drive)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    for section in (section for tendon in tendons for section in tendon.path.sections):
        if section.joint not in (None, driven.name, *others):
            raise InputError(
                f'{file}: the joint "{section.joint}" is named but not given; add [joints.{section.joint}]'
            )
    reference, motion = _reference(raw.get("reference"), file)
    scenario = JointScenario(
        name=read_name(raw, source),
        mechanism=mechanism,
        joints=others,
        reference=reference,
        motion=motion,
        run=read_table(Run, raw.get("run", {}), file=file, table="run"),
        robust=read_robust(raw, mechanism, file),
        adaptation=(
            read_table(JointAdaptation, raw["adaptation"], file=file, table="adaptation")
            if "adaptation" in raw
            else None
        ),
        feedback=read_table(Feedback, raw["feedback"], file=file, table="feedback") if "feedback" in raw else None,
        source=source,
        text=text,
        observer=read_table(ObserverTable, raw["observer"], file=file, table="observer") if "observer" in raw else None,
    )
    _check_gear(scenario)
    if scenario.feedback is not None:
        scenario.feedback.require_joint(file)
    named = [getattr(part, "file", None) for part in (reference, motion, *others.values())]
    return replace(scenario, inputs=(*inputs, *(source.parent / each for each in named if each)))


def on_level(scenario: JointScenario, level: Level | None) -> JointScenario:
    """The scenario on a fidelity level, if one is given."""
    return scenario if level is None else replace(scenario, run=replace(scenario.run, level=level))


def sample_joint(scenario: JointScenario) -> SampledJoint:
    """Reference at the steps of the run; InputError where it has no meaning."""
    folder, step, file = scenario.source.parent, scenario.run.step_s, scenario.source.name
    spec, joint = scenario.reference, scenario.mechanism.joint.name
    length = spec.length_s(folder)
    time = instants(length, step, file)
    wanted = spec.sample(time, folder)
    torque = spec.quantity is JointQuantity.TORQUE
    angle = scenario.motion.sample(time, folder) if torque and scenario.motion is not None else wanted
    if not np.ptp(wanted) > 0:
        raise InputError(f"{file} [reference]: it never changes, so there is nothing to design; let it move")
    kept, warnings = _within_stops(scenario, angle, time)
    try:
        scenario.mechanism.joint.accepted_rad(float(kept.min()), float(kept.max()))
    except ParameterError as error:
        raise InputError(f"{file} [joints.{joint}]: {error}") from None
    angle, wanted = kept, wanted if torque else kept
    contact = wanted if torque else np.zeros_like(wanted)
    if spec.periodic:
        for each in (wanted, angle):
            off = abs(float(each[-1] - each[0]))
            if off > 1e-3 * float(np.ptp(each)):
                raise InputError(
                    f"{file} [reference]: periodic = true, but it ends {off:.3g} from where it starts; give whole "
                    "periods and fade_in_s = 0"
                )
    stroke = _homing(scenario, float(angle[0]), torque)
    lead = len(stroke)
    if lead:
        angle = wanted = np.concatenate([stroke, angle])
        contact = np.zeros_like(angle)
        length += lead * step
        time = np.arange(len(angle), dtype=np.float64) * step
    columns = [
        joint_angles(other, name, np.maximum(time - lead * step, 0.0), folder, length - lead * step)
        for name, other in scenario.joints.items()
    ]
    motion = JointMotion(
        names=(joint, *scenario.joints),
        time_s=time,
        angle_rad=np.column_stack([angle, *columns]),
        period_s=float(time[-1]) if spec.periodic else None,
    )
    return SampledJoint(
        time_s=time, angle_rad=angle, contact_N_m=contact, wanted=wanted, motion=motion, lead=lead, warnings=warnings
    )


_BLEND_SHARE = 0.02  # of the range: way before a stop on which a motion that would cross it is slowed down


def _within_stops(
    scenario: JointScenario, angle_rad: FloatArray, time_s: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """A motion, shape (rows,), that no stop keeps the joint from, and where that is not the requested one.

    A parabola leads to the stop, so that the speed does not jump; the start, where the joint rests, stays.
    """
    joint, file = scenario.mechanism.joint, scenario.source.name
    table = "[reference]" if scenario.motion is None else "[reference.motion]"
    found, warnings = angle_rad, []
    for way, name, stop in ((1, "stop_high_rad", joint.stop_high_rad), (-1, "stop_low_rad", joint.stop_low_rad)):
        if stop is None:
            continue
        over = way * (angle_rad - stop)
        worst = int(np.argmax(over))
        if not over[worst] > 0:
            continue
        where = f"{angle_rad[worst]:.4g} rad at t = {time_s[worst]:.4g} s, beyond {name} = {stop:g} of the joint"
        if over[0] > 0:
            raise InputError(
                f"{file} {table}: it starts at {angle_rad[0]:.4g} rad and goes to {where}; start within the stops, or "
                f"correct {name}"
            )
        width = min(_BLEND_SHARE * float(np.ptp(angle_rad)), -float(over[0]))
        into = np.clip(over + width, 0.0, 2 * width)
        slowed = into**2 / (4 * width) if width > 0 else 0.0
        found = found - way * (slowed + np.maximum(over - width, 0.0))
        first = float(time_s[int(np.argmax(over > 0))])
        warnings.append(
            f"{file} {table}: it goes to {where}, from t = {first:.4g} s on in {100 * np.mean(over > 0):.2g} % of the "
            "samples: taken back to the stop, and errors are relative to that"
        )
    if warnings and not np.ptp(found) > 0:
        raise InputError(f"{'; '.join(warnings)}; nothing is left of it")
    return found, tuple(warnings)


def _homing(scenario: JointScenario, start_rad: float, torque: bool) -> FloatArray:
    """Angles of a stroke to both sides and back, up to a row before the reference starts; empty where none is asked."""
    size, step = scenario.mechanism.drive.homing_rad, scenario.run.step_s
    if size == 0:
        return np.empty(0)
    if scenario.reference.periodic or torque:
        raise InputError(
            f"{scenario.source.name} [drive]: homing_rad is for a reference of angle that does not repeat; a cycle "
            "forgets its start by itself, and where something else moves the joint that must home it"
        )
    quarter = max(0.3, 3 * size)  # slow enough for any drive that can follow a reference
    times = (0.0, quarter, 3 * quarter, 4 * quarter)
    stroke = along_waypoints(times, (0.0, size, -size, 0.0), Shape.SMOOTH, np.arange(0.0, times[-1] - step / 2, step))
    return start_rad + stroke


def _check_tables(raw: Mapping[str, object], file: str) -> None:
    check_schema(raw, file)
    for key in raw:
        if key in ("schema", "name", *_TABLES):
            continue
        if key in _NOT_FOR_A_JOINT:
            raise InputError(f"{file}: [{key}] does not belong to a driven joint; {_NOT_FOR_A_JOINT[key]}")
        near = suggestion(key, list(_TABLES)).replace('"', "")
        raise InputError(f"{file}: unknown table [{key}]{near}; a driven joint has [{'], ['.join(_TABLES)}]")
    missing = [key for key in ("joints", "tendons", "drive", "reference", "run") if key not in raw]
    if missing:
        raise InputError(
            f'{file}: missing: {", ".join(f"[{key}]" for key in missing)}; "tendonff new --for hand" writes a file '
            "that explains every key"
        )


def _split_joints(raw: object, file: str) -> tuple[DrivenJoint, dict[str, Joint]]:
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: joints must be a table of tables, got {show(raw)}; write [joints.NAME]")
    driven = {k: v for k, v in raw.items() if isinstance(v, Mapping) and v.get("kind") == "driven"}
    if len(driven) != 1:
        standing = {k: v for k, v in raw.items() if isinstance(v, Mapping) and v.get("kind") not in (*MOVED, "driven")}
        read_joints(standing, file)  # a misspelt kind comes first
        raise InputError(
            f'{file} [joints]: one joint must have kind = "driven", got {len(driven)}; describe each driven joint in a '
            "file of its own, with the motions of the others"
        )
    others = read_joints({k: v for k, v in raw.items() if k not in driven}, file)
    ((name, table),) = driven.items()
    keys = {**table, "name": name}
    return read_table(DrivenJoint, keys, file=file, table=f"joints.{name}", extra_keys=("kind",)), others


def _arm(row: Mapping[str, object], joint: str, source: Path, where: str, inputs: list[Path]) -> Arm:
    arm, lengths = row.get("moment_arm_m"), row.get("lengths")
    if arm is not None and (isinstance(arm, bool) or not isinstance(arm, int | float)):
        raise InputError(f"{source.name} [{where}]: moment_arm_m must be a number, got {show(arm)}")
    if lengths is None:
        return Arm(joint=joint, moment_arm_m=None if arm is None else float(arm))
    if not isinstance(lengths, str):
        raise InputError(f"{source.name} [{where}]: lengths must name a CSV file, got {show(lengths)}")
    known = read_lengths(source.parent / lengths, inputs, f"{source.name} [{where}]")
    return Arm(joint=joint, moment_arm_m=None if arm is None else float(arm), lengths=known)


def _drive(raw: object, file: str) -> JointDrive:
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: drive must be a table, got {show(raw)}; write [drive] on a line of its own")
    if "stiffness_N_m_per_rad" in raw or "wanted_stiffness_N_m_per_rad" in raw:
        raise InputError(
            f"{file} [drive]: a stiffness of the joint cannot be asked for; linear tendons have the same one at every "
            'tension. For no lost motion use kind = "pair"'
        )
    keys = dict(raw)
    radius = keys.get("drum_radius_m")
    if isinstance(radius, int | float) and not isinstance(radius, bool):
        keys["drum_radius_m"] = [radius]
    drive = read_table(JointDrive, keys, file=file, table="drive")
    if not drive.drum_radius_m:
        raise InputError(f"{file} [drive]: drum_radius_m must be a number or one for each tendon, got an empty list")
    return drive


def _check_gear(scenario: JointScenario) -> None:
    """Refuse what a motor whose gear gives way is not followed through."""
    if scenario.mechanism.drive.gear_stiffness_N_m_per_rad is None:
        return
    asked = {
        "[adaptation]": scenario.adaptation is not None,
        "[feedback]": scenario.feedback is not None,
        'quantity = "joint_torque"': scenario.reference.quantity is JointQuantity.TORQUE,
    }
    for name, given in asked.items():
        if given:
            raise InputError(
                f"{scenario.source.name} [drive]: gear_stiffness_N_m_per_rad is not taken into account with {name}; "
                "leave one of them out"
            )


def _reference(raw: object, file: str) -> tuple[JointReference, JointReference | None]:
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: reference must be a table, got {show(raw)}; write [reference] on a line of its own")
    motion = raw.get("motion")
    reference = read_kind(KINDS, {k: v for k, v in raw.items() if k != "motion"}, file=file, table="reference")
    torque = reference.quantity is JointQuantity.TORQUE
    if torque != (motion is not None):
        raise InputError(
            f'{file} [reference]: motion belongs to quantity = "joint_torque", and to it alone: how the joint moves '
            "while it gives that torque"
        )
    if motion is None:
        return reference, None
    moved = read_kind(KINDS, motion, file=file, table="reference.motion")
    if moved.quantity is JointQuantity.TORQUE:
        raise InputError(f"{file} [reference.motion]: a motion is an angle; leave quantity out")
    return reference, moved
