"""Measured files of motors: read, cleaned, evenly sampled, smoothed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError, nearest_column
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record, clean
from tendonff.compensator.identification.measured.conditions import condition_of
from tendonff.compensator.identification.measured.doubts import answered, encoder_doubts, motor_doubts
from tendonff.compensator.identification.measured.reading import (
    DataIssue,
    Finding,
    Findings,
    MissingColumnError,
    read_measurement,
    require_channels,
    rows_within,
)
from tendonff.compensator.identification.measured.smoothing import even_times, noise_of, thinned
from tendonff.compensator.identification.motors.columns import (
    TIME,
    find,
    find_time,
    joint_angle,
    motor_angle,
    motor_current,
    motor_torque,
)
from tendonff.compensator.identification.motors.counts import reading_share, smooth_angle
from tendonff.compensator.identification.motors.felt import felt_channels, felt_columns
from tendonff.compensator.scenario.doubts import UnitDoubt
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.settings import Run
from tendonff.models.joint.parameters.finger import Finger
from tendonff.ocp.fits.mechanism import MotorRun

TORQUE, CURRENT, MOTOR, JOINT = "motor_torque_N_m", "motor_current_A", "motor_rad", "joint_rad"
"""Columns of a loop; those of several motors carry their names."""

SIMULATED_JOINT = "angle_rad"
"""The joint's angle as `simulate` writes it; read where there is no `joint_rad`."""

ROW_S = 0.01
"""Step of what is fitted: a log that is faster is thinned to it."""

STROKE_SHARE = 0.3
"""A stroke of this share of a motor's range wipes out what friction stored before."""

BACK_SHARE = 0.2
"""Share of that stroke which the motor of a loop goes back after it, before its rows count."""

NOISE_FLOOR = 2e-3
"""Noise of a torque that counts at least, as a share of its range."""

LONGEST_GAP_S = 0.2
"""Of several motors: where a joint turned back in a gap is not known."""

LOOP = "motor"
"""Name of the motor of a loop."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorsLog:
    """A measured file, after the low-pass.

    Attributes
    ----------
    name : str
    motors : tuple of str
    run : MotorRun
        Angles of the motors since the start.
    torque_N_m : ndarray, shape (rows, motors)
        Of each motor, as measured.
    joint_rad : ndarray, shape (rows, joints)
        NaN of a joint without an encoder.
    counted : ndarray of bool, shape (rows,)
        Rows after what friction stored before the first row is wiped out.
    motor_share, joint_share : ndarray, shape (rows, motors), (rows, joints)
        Share of a reading that each row of an angle has, by which its torque and the joint's angle count.
    noise_N_m : ndarray, shape (motors,)
        Standard deviation of the noise of each torque.
    findings : tuple of Finding
    started_s : float or None
        Seconds from 1970 to its first row.
    zero_rad : float
        Reading of the first motor's angle at the first row.
    joint_torque_N_m : ndarray or None, shape (rows,)
        At the joint, where it was measured.
    """

    name: str
    motors: tuple[str, ...]
    run: MotorRun
    torque_N_m: Array
    joint_rad: Array
    counted: Mask
    motor_share: Array
    joint_share: Array
    noise_N_m: Array
    findings: tuple[Finding, ...]
    started_s: float | None = None
    zero_rad: float = 0.0
    joint_torque_N_m: Array | None = None

    @property
    def time_s(self) -> Array:
        """Shape (rows,)."""
        return np.arange(len(self.torque_N_m), dtype=np.float64) * self.run.step_s

    @property
    def encoders(self) -> Mask:
        """Which joints have an encoder, shape (joints,)."""
        return np.array([bool(np.isfinite(angle).all()) for angle in self.joint_rad.T])

    @property
    def range_N_m(self) -> Array:
        """Range of each torque, shape (motors,)."""
        return np.asarray(np.maximum(np.ptp(self.torque_N_m, axis=0), 1e-300))

    def part(self, rows: slice, ratio: float) -> "MotorsLog":
        """Some of the rows of a loop, as a log of its own whose motor starts at zero.

        `ratio` is what the joint turns per radian of the motor: a run starts in the middle of the lost motion.
        """
        motor = self.run.motor_rad[rows]
        start = self.run.start_rad + ratio * float(motor[0, 0] - self.run.motor_rad[0, 0])
        run = MotorRun(motor_rad=motor - motor[0], step_s=self.run.step_s, start_rad=start)
        return replace(
            self,
            run=run,
            torque_N_m=self.torque_N_m[rows],
            joint_rad=self.joint_rad[rows],
            joint_torque_N_m=None if self.joint_torque_N_m is None else self.joint_torque_N_m[rows],
            counted=_counted(run.motor_rad),
            motor_share=self.motor_share[rows],
            joint_share=self.joint_share[rows],
        )


def how_to_read(scenario: JointScenario, given: Measurement) -> Measurement:
    """Format of files of a motor: `given` with the columns of the contract where it states none."""
    usual = Measurement()
    constant = given.torque_constant_N_m_per_A or scenario.mechanism.drive.torque_constant_N_m_per_A
    names = {"input_column": TORQUE, "input_position_column": MOTOR, "output_position_column": JOINT}
    changed = {key: name for key, name in names.items() if getattr(given, key) == getattr(usual, key)}
    of = {name: key for key, name in (names | {"time_column": usual.time_column}).items()}
    require_channels(given, of)
    changed |= {of[channel]: name for channel, name in given.named_columns.items()}
    return replace(given, **changed, channels=None, drum_radius_m=1.0, torque_constant_N_m_per_A=constant)  # type: ignore[arg-type]


def read_logs(scenario: JointScenario, files: Sequence[Path], given: Measurement) -> list[MotorsLog]:
    """Read measured files; InputError where one cannot be used."""
    how = how_to_read(scenario, given)
    start = scenario.reference_start_rad()
    return [_read(Path(file), how, start, scenario.mechanism.joint.name) for file in files]


def answered_logs(
    scenario: JointScenario, logs: Sequence[MotorsLog], confirm: Callable[[str], bool]
) -> tuple[str, ...]:
    """Units of logs that the user accepts although they look like others, as warnings; see `answered`."""
    mechanism, found = scenario.mechanism, list[UnitDoubt]()
    arm_m = max(abs(arm) for arm in mechanism.arms_at(scenario.reference_start_rad()))
    for log in logs:
        found += motor_doubts(log.name, log.run.motor_rad[:, 0], log.torque_N_m[:, 0], mechanism.drive, arm_m)
        found += encoder_doubts(log.name, mechanism.joint.name, log.joint_rad[:, 0])
    return answered(found, scenario.run, confirm, file=scenario.source.name)


def _read(file: Path, how: Measurement, start_rad: float, joint: str) -> MotorsLog:
    motor = (
        f'{file.name}: column "{how.input_position_column}" is missing: the motor angle says where the drum is (choose '
        "one with --input-position-column)"
    )
    how, notes = _trade(file, how, joint)
    try:
        raw = read_measurement(file, how)
    except MissingColumnError as error:
        if error.key == "output" and how.output_column == Measurement().output_column:  # needed without that angle
            raise InputError(motor) from None
        if error.key != "input" or how.input_column != TORQUE:
            raise
        raise InputError(_no_torque(file.name, error.present)) from None
    if raw.input_m is None:
        raise InputError(motor)
    raw = replace(raw, findings=(*notes, *raw.findings))
    record = clean(raw, how)
    piece = max(record.pieces, key=lambda p: len(p.time_s))
    return _log(piece, record, start_rad)


def _trade(file: Path, how: Measurement, joint: str) -> tuple[Measurement, tuple[Finding, ...]]:
    """Columns of a loop that are called otherwise, where the user named none, and what they were read as."""
    table, names = read_table(file, (TORQUE, CURRENT, MOTOR, JOINT, SIMULATED_JOINT), how.columns or ()), ("", joint)
    constant = how.torque_constant_N_m_per_A
    found = {
        "time": None if how.time_column != Measurement().time_column else find_time(table, file),
        "input_position": None
        if how.input_position_column != MOTOR
        else find(table, motor_angle((MOTOR,), names), file),
        "output_position": None
        if how.output_position_column != JOINT
        else find(table, joint_angle((JOINT, SIMULATED_JOINT), names[1:]), file),
    }
    if how.input_column == TORQUE:
        found["input"] = find(table, motor_torque((TORQUE,), names), file)
        if found["input"] is None and constant is not None:
            current = find(table, motor_current((CURRENT,), names), file)
            found["input"] = current and replace(current, factor=current.factor * constant * (how.gear_ratio or 1.0))
    findings = Findings()
    for key, column in found.items():
        if column is None or column.name == getattr(how, f"{key}_column"):
            continue
        scale = getattr(how, f"{key}_scale")
        how = replace(
            how,
            **{f"{key}_column": column.name, f"{key}_scale": column.factor if scale == 1 else scale},  # type: ignore[arg-type]
        )
        if column.note:
            findings.note(DataIssue.UNITS, f"{column.note} (--scale overrides)", count=1)
    return how, tuple(findings)


def _no_torque(name: str, present: Sequence[str]) -> str:
    """Message for a file without the motor's torque; other torques of the joint have similar names, so none is
    suggested.
    """
    constant = "--torque-constant, or torque_constant_N_m_per_A in [drive]"
    if CURRENT in present:
        return f'{name}: column "{TORQUE}" is missing, and {CURRENT} needs the torque constant: {constant}'
    return (
        f'{name}: column "{TORQUE}" is missing; columns: {", ".join(present)}. Name the torque of the motor with '
        f"--input-column, or log its current as {CURRENT} and give {constant}"
    )


def _log(piece: Piece, record: Record, start_rad: float) -> MotorsLog:
    """Thin a piece to rows of equal distance."""
    step = record.step_s
    every = max(1, round(ROW_S / step))
    as_read = piece.travel_m(as_read=True)
    motor, read = smooth_angle(as_read, step)[::every], as_read[::every]
    torque, at_joint = (
        thinned(x, step, every) if np.isfinite(x).all() else None for x in (piece.input_N, piece.output_N)
    )
    if torque is None:
        raise InputError(f"{record.name}: the motor's torque is no number in some rows; repair the column")
    none = np.full(len(motor), np.nan)
    joint, joint_read = (none if x is None else x[::every] for x in (piece.output_m, piece.read_output_m))
    start = start_rad if piece.output_m is None else float(np.median(joint[:3]))
    run = MotorRun.of_one(motor - motor[0], step * every, start, read - read[0])
    return MotorsLog(
        name=record.name,
        motors=(LOOP,),
        run=run,
        torque_N_m=torque[:, None],
        joint_rad=joint[:, None],
        joint_torque_N_m=at_joint,
        counted=_counted(motor[:, None]),
        motor_share=reading_share(read)[:, None],
        joint_share=reading_share(joint_read)[:, None],
        noise_N_m=np.array([max(record.input_noise_N, NOISE_FLOOR * float(np.ptp(torque)))]),
        findings=record.findings,
        started_s=record.started_s,
        zero_rad=float(motor[0]),
    )


def _counted(motor_rad: Array) -> Mask:
    """Rows after every motor that moves has made a stroke and turned back; after a third where one does not, and of
    several motors at most.
    """
    rows, motors = motor_rad.shape
    back = BACK_SHARE if motors == 1 else 1.0  # of several, each goes on where another has turned
    turned = max(_turned(angle, back) for angle in motor_rad.T)
    return np.asarray(np.arange(rows) >= (min(turned, rows // 3) if motors > 1 or turned == rows else turned))


def _turned(motor_rad: Array, back: float) -> int:
    """Row at which a motor has gone back by a share of its first full stroke; their number where it has not."""
    wide = STROKE_SHARE * float(np.ptp(motor_rad))
    high = np.maximum.accumulate(motor_rad)
    stroke = int(np.argmax(high - np.minimum.accumulate(motor_rad) >= wide))
    after = motor_rad[stroke:] if motor_rad[stroke] == high[stroke] else -motor_rad[stroke:]
    gone = np.flatnonzero(np.maximum.accumulate(after) - after >= back * wide)
    return stroke + int(gone[0]) if gone.size else len(motor_rad)


def read_several(finger: Finger, files: Sequence[Path], start_rad: Array, how: Measurement) -> list[MotorsLog]:
    """Read measured files; InputError where one cannot be used.

    Of `how`, what is left out at the start, when torques are zero and columns that the user named are taken.
    """
    names = [Path(file).name for file in files]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"{twice} is given twice; name each measured file once")
    return [_read_several(finger, Path(file), start_rad, how) for file in files]


def answered_several(
    finger: Finger, logs: Sequence[MotorsLog], run: Run, file: str, confirm: Callable[[str], bool]
) -> tuple[str, ...]:
    """Units of logs that the user accepts although they look like others, as warnings; see `answered`."""
    found = list[UnitDoubt]()
    for log in logs:
        arms = np.abs(finger.moment_arm_m(log.run.start_rad[None])).sum(axis=-1)[0]
        of_tendon = dict(zip((tendon.name for tendon in finger.tendons), arms.tolist(), strict=True))
        for k, motor in enumerate(finger.motors):
            arm_m = max(of_tendon[name] for name in motor.winds)
            found += motor_doubts(
                log.name, log.run.motor_rad[:, k], log.torque_N_m[:, k], motor.drive, arm_m, of=motor.name
            )
        for name, angle in zip(finger.names, log.joint_rad.T, strict=True):
            found += encoder_doubts(log.name, name, angle)
    return answered(found, run, confirm, file=file)


def _read_several(finger: Finger, file: Path, start_rad: Array, how: Measurement) -> MotorsLog:
    names = [motor.name for motor in finger.motors]
    alone = ("joint_rad",) if len(finger.joints) == 1 else ()
    angles = [motor_angle((f"motor_{n}_rad",), (n,)) for n in names]
    joints = [joint_angle((f"joint_{n}_rad", f"{n}_rad", *alone), (n,)) for n in finger.names]
    others = [joint_angle((f"joint_{n}_rad", f"{n}_rad"), (n,)) for n in finger.others]
    felt_by = felt_channels(finger.motors)
    usual = [*TIME.usual, *(n for channel in (*angles, *felt_by, *joints, *others) for n in channel.usual)]
    require_channels(how, usual)
    named = how.named_columns
    table = read_table(file, [*usual, *named.values()])
    columns = [find_time(table, file), *(find(table, channel, file, named) for channel in angles)]
    for channel, column in zip((TIME, *angles), columns, strict=True):
        if column is None:
            name = channel.usual[0]
            near = nearest_column(name, (*table.columns, *table.offered))
            raise InputError(f'{file.name}: column "{name}" is missing{near}; the log needs the angle of each motor')
    clock, *turned = [column for column in columns if column is not None]
    time = clock.factor * table.seconds(clock.name)[0]
    found = [column.of(table) for column in turned]
    felt, cells = felt_columns(table, finger.motors, file, named)
    for own in felt:
        read = [column.of(table) for column in own]
        if how.tare_s is not None:  # their motors are not loaded there
            rest = rows_within(time, how.tare_s, "--tare", file.name)
            read = [x - np.nanmedian(x[rest]) for x in read]
        found.append(np.sum(read, axis=0))
    seen, bent = ([find(table, channel, file, named) for channel in some] for some in (joints, others))
    measured = {n: column.of(table) for n, column in zip(finger.others, bent, strict=True) if column is not None}
    standing = condition_of(file.name, finger.others, measured, how)
    encoders = [np.full(len(time), np.nan) if column is None else column.of(table) for column in seen]
    needed = np.column_stack([time, *found])
    good = np.isfinite(needed).all(axis=1)
    good &= np.concatenate([[True], np.diff(np.maximum.accumulate(np.where(good, time, -np.inf))) > 0])
    good &= time >= time[good][0] + (how.skip_s or 0.0) if good.any() else good
    findings = Findings()
    for column in (clock, *turned, *(column for own in felt for column in own), *seen, *bent):
        if column is not None and column.note:
            findings.note(DataIssue.UNITS, column.note, count=1)
    if (left_out := int((~good).sum())) > 0:
        findings.note(DataIssue.MISSING, "no number, a clock that does not rise, or skipped: left out", count=left_out)
    if good.sum() < TUNED.least_drive_rows:
        raise InputError(f"{file.name}: {good.sum()} usable rows, {TUNED.least_drive_rows} are needed; log longer")
    time, values = time[good], np.column_stack([*found, *encoders])[good]
    if (gap := float(np.diff(time).max())) > LONGEST_GAP_S:
        at = float(time[int(np.argmax(np.diff(time)))])
        raise InputError(
            f"{file.name}: a gap of {gap:.3g} s at t = {at:.4g} s; friction forgets nothing there: cut the file at the "
            "gap, and give its parts as files"
        )
    log = _sampled(finger, file.name, time, values, start_rad, tuple(findings))
    run = replace(log.run, standing_rad=standing, cells=cells)
    return replace(log, run=run)


def _sampled(
    finger: Finger, name: str, time: Array, values: Array, start_rad: Array, findings: tuple[Finding, ...]
) -> MotorsLog:
    """Even rows, thinned; motors smoothed by what is noise, torques by one low-pass."""
    own = float(np.median(np.diff(time)))
    even = even_times(time, own)
    rows = np.column_stack([np.interp(even, time, column) for column in values.T])
    every, count = max(1, round(ROW_S / own)), len(finger.motors)
    step = own * every
    motor = np.column_stack([smooth_angle(x, own)[::every] for x in rows[:, :count].T])
    torque = np.column_stack([thinned(x, own, every) for x in rows[:, count : 2 * count].T])
    noise = [max(noise_of(x), NOISE_FLOOR * float(np.ptp(x))) for x in rows[:, count : 2 * count].T]
    joint = np.column_stack([thinned(x, own, every) for x in rows[:, 2 * count :].T])
    share = np.column_stack([reading_share(x) for x in rows[::every].T])
    first = np.median(joint[:3], axis=0)
    if not np.ptp(motor, axis=0).any():
        raise InputError(f"{name}: no motor ever moves, so there is nothing to identify")
    start = np.where(np.isfinite(first), first, start_rad)
    return MotorsLog(
        name=name,
        motors=tuple(each.name for each in finger.motors),
        run=MotorRun(motor_rad=motor - motor[0], step_s=step, start_rad=start, joint_rad=joint),
        torque_N_m=torque,
        joint_rad=joint,
        counted=_counted(motor),
        motor_share=share[:, :count],
        joint_share=share[:, 2 * count :],
        noise_N_m=np.array(noise),
        findings=findings,
    )
