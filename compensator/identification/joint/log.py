"""Measured files of a joint's motor: read, cleaned, evenly sampled."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record, clean
from tendonff.compensator.identification.measured.doubts import answered, encoder_doubts, motor_doubts
from tendonff.compensator.identification.measured.reading import Finding, MissingColumnError, read_measurement
from tendonff.compensator.identification.measured.smoothing import adaptive_low_pass, low_pass_piece
from tendonff.compensator.scenario.doubts import UnitDoubt
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.ocp.fits.mechanism import MotorRun

TORQUE, CURRENT, MOTOR, JOINT = "motor_torque_N_m", "motor_current_A", "motor_rad", "joint_rad"
SIMULATED_JOINT = "angle_rad"
"""The joint's angle as `simulate` writes it; read where there is no `joint_rad`."""

ROW_S = 0.01
"""Step of what is fitted: a log that is faster is thinned to it."""

STROKE_SHARE = 0.3
"""A stroke of this share of the motor's range wipes out what friction stored before."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLog:
    """A measured file, after the low-pass.

    Attributes
    ----------
    name : str
    run : MotorRun
        The motor's angle since the start.
    torque_N_m : ndarray, shape (rows,)
        Of the motor, as measured.
    joint_rad : ndarray or None, shape (rows,)
        Of the joint, where there is an encoder.
    joint_torque_N_m : ndarray or None, shape (rows,)
        At the joint, where it was measured.
    counted : ndarray of bool, shape (rows,)
        Rows after what friction stored before the first row is wiped out.
    noise_N_m : float
        Standard deviation of the noise of the torque.
    findings : tuple of Finding
    started_s : float or None
        Seconds from 1970 to its first row.
    zero_rad : float
        Reading of the motor's angle at the first row.
    """

    name: str
    run: MotorRun
    torque_N_m: Array
    joint_rad: Array | None
    counted: Mask
    noise_N_m: float
    findings: tuple[Finding, ...]
    started_s: float | None
    zero_rad: float = 0.0
    joint_torque_N_m: Array | None = None

    @property
    def time_s(self) -> Array:
        """Shape (rows,)."""
        return np.arange(len(self.torque_N_m), dtype=np.float64) * self.run.step_s

    def part(self, rows: slice, ratio: float) -> "JointLog":
        """Some of its rows, as a log of its own whose motor starts at zero.

        `ratio` is what the joint turns per radian of the motor: a run starts in the middle of the lost motion.
        """
        motor = self.run.motor_rad[rows]
        start = self.run.start_rad + ratio * float(motor[0] - self.run.motor_rad[0])
        run = MotorRun(motor_rad=motor - motor[0], step_s=self.run.step_s, start_rad=start)
        return replace(
            self,
            run=run,
            torque_N_m=self.torque_N_m[rows],
            joint_rad=None if self.joint_rad is None else self.joint_rad[rows],
            joint_torque_N_m=None if self.joint_torque_N_m is None else self.joint_torque_N_m[rows],
            counted=_counted(run.motor_rad),
        )


LEAST_NOISE = 2e-3
"""Noise of the torque that counts at least, as a share of its range."""


def how_to_read(scenario: JointScenario, given: Measurement) -> Measurement:
    """Format of files of a motor: `given` with the columns of the contract where it states none."""
    usual = Measurement()
    constant = given.torque_constant_N_m_per_A or scenario.mechanism.drive.torque_constant_N_m_per_A
    names = {"input_column": TORQUE, "input_position_column": MOTOR, "output_position_column": JOINT}
    changed = {key: name for key, name in names.items() if getattr(given, key) == getattr(usual, key)}
    return replace(given, **changed, drum_radius_m=1.0, torque_constant_N_m_per_A=constant)  # type: ignore[arg-type]


def read_logs(scenario: JointScenario, files: Sequence[Path], given: Measurement) -> list[JointLog]:
    """Read measured files; InputError where one cannot be used."""
    how = how_to_read(scenario, given)
    start = scenario.reference_start_rad()
    return [_read(Path(file), how, start) for file in files]


def answered_logs(scenario: JointScenario, logs: Sequence[JointLog], confirm: Callable[[str], bool]) -> tuple[str, ...]:
    """Units of logs that the user accepts although they look like others, as warnings; see `answered`."""
    mechanism, found = scenario.mechanism, list[UnitDoubt]()
    arm_m = max(abs(arm) for arm in mechanism.arms_at(scenario.reference_start_rad()))
    for log in logs:
        found += motor_doubts(log.name, log.run.motor_rad, log.torque_N_m, mechanism.drive, arm_m)
        found += encoder_doubts(log.name, mechanism.joint.name, log.joint_rad)
    return answered(found, scenario.run, confirm, file=scenario.source.name)


def _read(file: Path, how: Measurement, start_rad: float) -> JointLog:
    motor = (
        f'{file.name}: column "{how.input_position_column}" is missing: the motor angle says where the drum is (choose '
        "one with --input-position-column)"
    )
    try:
        raw = read_measurement(file, how)
    except MissingColumnError as error:
        if error.key == "output" and how.output_column == Measurement().output_column:  # needed without that angle
            raise InputError(motor) from None
        if error.key != "input" or how.input_column != TORQUE:
            raise
        if CURRENT not in error.present or how.torque_constant_N_m_per_A is None:
            raise InputError(_no_torque(file.name, error.present)) from None
        how = replace(how, input_column=CURRENT)
        raw = read_measurement(file, how)
    if raw.input_m is None:
        raise InputError(motor)
    if raw.output_m is None and how.output_position_column == JOINT and SIMULATED_JOINT in raw.unread:
        raw = read_measurement(file, replace(how, output_position_column=SIMULATED_JOINT))
    record = clean(raw, how)
    piece = max(record.pieces, key=lambda p: len(p.time_s))
    return _log(piece, record, start_rad)


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


def _log(piece: Piece, record: Record, start_rad: float) -> JointLog:
    """Thin a piece to rows of equal distance."""
    step = record.step_s
    every = max(1, round(ROW_S / step))
    as_read = piece.travel_m(as_read=True)
    motor, read = adaptive_low_pass(as_read, step)[::every], as_read[::every]
    torque, at_joint = (
        low_pass_piece(x, step, 0.4 / (step * every))[::every] if np.isfinite(x).all() else None
        for x in (piece.input_N, piece.output_N)
    )
    if torque is None:
        raise InputError(f"{record.name}: the motor's torque is no number in some rows; repair the column")
    joint = None if piece.output_m is None else piece.output_m[::every]
    start = start_rad if joint is None else float(np.median(joint[:3]))
    run = MotorRun(motor_rad=motor - motor[0], step_s=step * every, start_rad=start, read_rad=read - read[0])
    return JointLog(
        name=record.name,
        run=run,
        torque_N_m=torque,
        joint_rad=joint,
        joint_torque_N_m=at_joint,
        counted=_counted(run.motor_rad),
        noise_N_m=max(record.input_noise_N, LEAST_NOISE * float(np.ptp(torque))),
        findings=record.findings,
        started_s=record.started_s,
        zero_rad=float(motor[0]),
    )


def _counted(motor_rad: Array) -> Mask:
    """Rows after the first full stroke, from where a reversal follows it."""
    wide = STROKE_SHARE * float(np.ptp(motor_rad))
    low = high = motor_rad[0]
    way, turned, since = 0, 0, motor_rad[0]
    for row, at in enumerate(motor_rad):
        low, high = min(low, at), max(high, at)
        if way == 0:
            if high - low >= wide:
                way, since = (1 if at == high else -1), at
            continue
        since = max(since, at) if way > 0 else min(since, at)
        if way * (since - at) >= 0.2 * wide:
            turned = row
            break
    found: Mask = np.arange(len(motor_rad)) >= (turned or len(motor_rad) // 5)
    return found
