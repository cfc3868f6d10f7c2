"""Measured files of several motors: read, evenly sampled, smoothed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError, nearest_column
from tendonff.compensator.files.tables import Table, read_table
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.doubts import answered, encoder_doubts, motor_doubts
from tendonff.compensator.identification.measured.reading import LEAST_TARE_ROWS
from tendonff.compensator.identification.measured.smoothing import adaptive_low_pass, count_of, low_pass_piece, noise_of
from tendonff.compensator.scenario.doubts import UnitDoubt
from tendonff.compensator.scenario.settings import Run
from tendonff.models.cached import cached_property
from tendonff.models.joint.parameters.finger import Finger, Motor
from tendonff.ocp.fits.mechanism import MotorRun

ROW_S = 0.01
"""Step of what is fitted: a log that is faster is thinned to it."""

STROKE_SHARE = 0.3
"""A stroke of this share of a motor's range wipes out what friction stored before."""

LEAST_NOISE = 2e-3
"""Noise of a torque that counts at least, as a share of its range."""

LONGEST_GAP_S = 0.2
LEAST_ROWS = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorsLog:
    """A measured file, after the low-pass.

    Attributes
    ----------
    name : str
    step_s : float
    motor_rad : ndarray, shape (rows, motors)
        Of each motor since the start.
    torque_N_m : ndarray, shape (rows, motors)
        Of each motor, as measured.
    joint_rad : ndarray, shape (rows, joints)
        NaN of a joint without an encoder.
    start_rad : ndarray, shape (joints,)
        Where the joints are at the start.
    counted : ndarray of bool, shape (rows,)
        Rows after what friction stored before the first row is wiped out.
    noise_N_m : ndarray, shape (motors,)
        Standard deviation of the noise of each torque.
    findings : tuple of str
    """

    name: str
    step_s: float
    motor_rad: Array
    torque_N_m: Array
    joint_rad: Array
    start_rad: Array
    counted: Mask
    noise_N_m: Array
    findings: tuple[str, ...]

    @property
    def time_s(self) -> Array:
        """Shape (rows,)."""
        return np.arange(len(self.torque_N_m), dtype=np.float64) * self.step_s

    @cached_property
    def turning(self) -> tuple[MotorRun, ...]:
        """Motion of each motor."""
        return tuple(MotorRun(motor_rad=angle, step_s=self.step_s, start_rad=0.0) for angle in self.motor_rad.T)

    @property
    def encoders(self) -> Mask:
        """Which joints have an encoder, shape (joints,)."""
        return np.asarray(np.isfinite(self.joint_rad).all(axis=0))


def read_logs(
    finger: Finger,
    files: Sequence[Path],
    start_rad: Array,
    skip_s: float | None,
    tare_s: tuple[float, float] | None = None,
) -> list[MotorsLog]:
    """Read measured files; InputError where one cannot be used.

    Torques are set to zero over `tare_s`, from and to after the first row [s], and `skip_s` is left out at the start.
    """
    names = [Path(file).name for file in files]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"{twice} is given twice; name each measured file once")
    return [_read(finger, Path(file), start_rad, skip_s or 0.0, tare_s) for file in files]


def answered_logs(
    finger: Finger, logs: Sequence[MotorsLog], run: Run, file: str, confirm: Callable[[str], bool]
) -> tuple[str, ...]:
    """Units of logs that the user accepts although they look like others, as warnings; see `answered`."""
    found = list[UnitDoubt]()
    for log in logs:
        arms = np.abs(finger.moment_arm_m(log.start_rad[None])).sum(axis=-1)[0]
        of_tendon = dict(zip((tendon.name for tendon in finger.tendons), arms.tolist(), strict=True))
        for k, motor in enumerate(finger.motors):
            arm_m = max(of_tendon[name] for name in motor.winds)
            found += motor_doubts(
                log.name, log.motor_rad[:, k], log.torque_N_m[:, k], motor.drive, arm_m, of=motor.name
            )
        for name, angle in zip(finger.names, log.joint_rad.T, strict=True):
            found += encoder_doubts(log.name, name, angle)
    return answered(found, run, confirm, file=file)


def _read(finger: Finger, file: Path, start_rad: Array, skip_s: float, tare_s: tuple[float, float] | None) -> MotorsLog:
    motors = [f"motor_{motor.name}_rad" for motor in finger.motors]
    torques = [(f"motor_torque_{m.name}_N_m", f"motor_current_{m.name}_A") for m in finger.motors]
    alone = ("joint_rad",) if len(finger.joints) == 1 else ()
    joints = [(f"joint_{name}_rad", f"{name}_rad", *alone) for name in finger.names]
    expected = ("time_s", *motors, *(name for pair in (*torques, *joints) for name in pair))
    table = read_table(file, expected)
    for name in ("time_s", *motors):
        if name not in table.columns:
            near = nearest_column(name, (*table.columns, *table.offered))
            raise InputError(f'{file.name}: column "{name}" is missing{near}; the log needs the angle of each motor')
    time, _ = table.seconds("time_s")
    found = [table.numbers(name) for name in motors]
    felt = [_torque(table, names, motor, file.name) for names, motor in zip(torques, finger.motors, strict=True)]
    found += felt if tare_s is None else [_tared(values, time, tare_s, file.name) for values in felt]
    blank = np.full(len(time), np.nan)
    angles = [next((table.numbers(n) for n in names if n in table.columns), blank) for names in joints]
    needed = np.column_stack([time, *found])
    good = np.isfinite(needed).all(axis=1)
    good &= np.concatenate([[True], np.diff(np.maximum.accumulate(np.where(good, time, -np.inf))) > 0])
    good &= time >= time[good][0] + skip_s if good.any() else good
    findings = [f"{(~good).sum()} rows left out: no number, a clock that does not rise, or skipped"] * bool(
        (~good).any()
    )
    if good.sum() < LEAST_ROWS:
        raise InputError(f"{file.name}: {good.sum()} usable rows, at least {LEAST_ROWS} are needed; log longer")
    time, values = time[good], np.column_stack([*found, *angles])[good]
    if (gap := float(np.diff(time).max())) > LONGEST_GAP_S:
        at = float(time[int(np.argmax(np.diff(time)))])
        raise InputError(
            f"{file.name}: a gap of {gap:.3g} s at t = {at:.4g} s; friction forgets nothing there: cut the file at the "
            "gap, and give its parts as files"
        )
    return _sampled(finger, file.name, time, values, start_rad, tuple(findings))


def _tared(torque: Array, time: Array, tare_s: tuple[float, float], file: str) -> Array:
    """A torque less its median over a time in which its motor is not loaded."""
    since = time - time[np.isfinite(time)][0]
    rows = (since >= tare_s[0]) & (since <= tare_s[1]) & np.isfinite(torque)
    if rows.sum() < LEAST_TARE_ROWS:
        raise InputError(
            f"{file}: {rows.sum()} samples between {tare_s[0]:g} and {tare_s[1]:g} s, {LEAST_TARE_ROWS} are needed to "
            "set the torques to zero; give --tare a longer time within the file"
        )
    zeroed: Array = torque - float(np.median(torque[rows]))
    return zeroed


def _torque(table: Table, names: tuple[str, str], motor: Motor, file: str) -> Array:
    torque, current = names
    if torque in table.columns:
        return table.numbers(torque)
    constant = motor.drive.torque_constant_N_m_per_A
    if current in table.columns and constant is not None:
        return constant * table.numbers(current)
    if current in table.columns:
        raise InputError(
            f'{file}: {current} needs the torque constant: torque_constant_N_m_per_A in [[motors]] "{motor.name}"'
        )
    raise InputError(
        f'{file}: column "{torque}" is missing{nearest_column(torque, tuple(table.columns))}; log the torque of each '
        f"motor, or its current as {current}"
    )


def _sampled(
    finger: Finger, name: str, time: Array, values: Array, start_rad: Array, findings: tuple[str, ...]
) -> MotorsLog:
    """Even rows, thinned; motors smoothed by what is noise, torques by one low-pass."""
    own = float(np.median(np.diff(time)))
    even = np.arange(int((time[-1] - time[0]) / own + 1e-6) + 1) * own + time[0]
    rows = np.column_stack([np.interp(even, time, column) for column in values.T])
    every, count = max(1, round(ROW_S / own)), len(finger.motors)
    step = own * every
    counts = [count_of(x) for x in values[:, :count].T]
    motor = np.column_stack(
        [adaptive_low_pass(x, own, one)[::every] for x, one in zip(rows[:, :count].T, counts, strict=True)]
    )
    torque = np.column_stack([low_pass_piece(x, own, 0.4 / step)[::every] for x in rows[:, count : 2 * count].T])
    noise = [max(noise_of(x), LEAST_NOISE * float(np.ptp(x))) for x in rows[:, count : 2 * count].T]
    joint = np.column_stack([low_pass_piece(x, own, 0.4 / step)[::every] for x in rows[:, 2 * count :].T])
    first = np.median(joint[:3], axis=0)
    if not np.ptp(motor, axis=0).any():
        raise InputError(f"{name}: no motor ever moves, so there is nothing to identify")
    return MotorsLog(
        name=name,
        step_s=step,
        motor_rad=motor - motor[0],
        torque_N_m=torque,
        joint_rad=joint,
        start_rad=np.where(np.isfinite(first), first, start_rad),
        counted=_counted(motor),
        noise_N_m=np.array(noise),
        findings=findings,
    )


def _counted(motor_rad: Array) -> Mask:
    """Rows after every motor that moves has made a stroke and turned back."""
    turned = 0
    for angle in motor_rad.T:
        wide = STROKE_SHARE * float(np.ptp(angle))
        if wide == 0:
            continue
        low = np.minimum.accumulate(angle)
        high = np.maximum.accumulate(angle)
        away = np.flatnonzero(
            (high - angle >= wide) & (high - low >= wide) | (angle - low >= wide) & (high - low >= wide)
        )
        turned = max(turned, int(away[0]) if away.size else len(angle) // 5)
    rows = np.arange(len(motor_rad))
    found: Mask = rows >= min(turned, len(motor_rad) // 3)
    return found
