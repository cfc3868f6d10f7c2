"""Demand of each profile on the drive: stroke, speed, force, power and motor torque, against their limits."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.files.notices import Danger
from tendonff.compensator.studies.design.result import Design
from tendonff.models.parameters.drive import Motor

SHOWN = ("inverse", "optimal")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveUse:
    """A profile as the drive sees it, on the design level."""

    name: str  # of the compensator
    # travel_m, speed_m_per_s, force_N: shape (n,); of the actuator's end; the speed is the mean of the step that ends
    # at a row
    travel_m: FloatArray
    speed_m_per_s: FloatArray
    force_N: FloatArray

    @property
    def power_W(self) -> FloatArray:
        """Mechanical power that the drive gives, below 0 where it takes [W], shape (n,)."""
        return self.force_N * self.speed_m_per_s

    @property
    def stroke_m(self) -> float:
        """Way between the ends of the travel [m]."""
        return float(np.ptp(self.travel_m))

    @property
    def force_rms_N(self) -> float:
        """Root mean square force [N]: what warms the motor."""
        return float(np.sqrt(np.mean(self.force_N**2)))

    def torque_N_m(self, motor: Motor) -> FloatArray:
        """Torque of the motor, its own inertia included [N m], shape (n,)."""
        return self.force_N * motor.travel_per_rad_m

    def angle_rad(self, motor: Motor) -> FloatArray:
        """Angle of the motor from the start [rad], shape (n,)."""
        return self.travel_m / motor.travel_per_rad_m

    def load_of_the_line(self, motor: Motor) -> float:
        """Largest share of what torque_max_N_m and the torque-speed line allow at the speed of a row [-]."""
        speed, torque = self.speed_m_per_s / motor.travel_per_rad_m, self.torque_N_m(motor)
        return max(
            abs(t) / limit if (limit := motor.torque_limit_N_m(w)) > 0 else math.inf
            for w, t in zip(speed.tolist(), torque.tolist(), strict=True)
        )


def drive_use(result: Design) -> tuple[DriveUse, ...]:
    """The profiles that know the chain, as the drive sees them."""
    found = []
    for name in SHOWN:
        profile = result.profiles.get(name)
        if profile is None or profile.travel_m is None:
            continue
        speed = np.diff(profile.travel_m, prepend=profile.travel_m[0]) / result.reference.step_s
        found.append(DriveUse(name=name, travel_m=profile.travel_m, speed_m_per_s=speed, force_N=profile.force_N))
    return tuple(found)


def drive_columns(result: Design) -> dict[str, FloatArray]:
    """Columns of `profile.csv` beside the forces: travel, commands, motor torque and angle."""
    used, motor = drive_use(result), result.scenario.transmission.actuator.motor
    columns = {f"travel_{use.name}_m": use.travel_m for use in used}
    for name, profile in result.profiles.items():
        if profile.command_m is not None:
            columns[f"command_{name}_m"] = profile.command_m
        if profile.command_N is not None:
            columns[f"command_{name}_N"] = profile.command_N
    if motor is not None:
        columns |= {f"motor_torque_{use.name}_N_m": use.torque_N_m(motor) for use in used}
        columns |= {f"motor_angle_{use.name}_rad": use.angle_rad(motor) for use in used}
    return columns


def drive_summary(result: Design) -> dict[str, object]:
    """Entries of `summary.json` on the drive, by name of the compensator."""
    motor, found = result.scenario.transmission.actuator.motor, dict[str, object]()
    for use in drive_use(result):
        entry: dict[str, object] = {
            "stroke_m": use.stroke_m,
            "peak_speed_m_per_s": float(np.max(np.abs(use.speed_m_per_s))),
            "peak_force_N": float(np.max(use.force_N)),
            "rms_force_N": use.force_rms_N,
            "peak_power_W": float(np.max(use.power_W)),
        }
        if motor is not None:
            entry["peak_torque_N_m"] = float(np.max(np.abs(use.torque_N_m(motor))))
            entry["rms_torque_N_m"] = use.force_rms_N * motor.travel_per_rad_m
            load = use.load_of_the_line(motor)
            entry["torque_speed_share"] = load if math.isfinite(load) else None
        found[use.name] = entry
    return found


def drive_warnings(result: Design) -> list[str]:
    """Limits of drive and motor that a profile does not keep."""
    actuator, found = result.scenario.transmission.actuator, []
    for use in drive_use(result):
        fastest = float(np.max(np.abs(use.speed_m_per_s)))
        top = actuator.speed_max_m_per_s
        if top is not None and fastest > 1.005 * top:
            found.append(f"{use.name}: the actuator moves at up to {fastest:.3g} m/s, speed_max_m_per_s is {top:.3g}")
        motor = actuator.motor
        if motor is None:
            continue
        rms = use.force_rms_N * motor.travel_per_rad_m
        if motor.torque_rated_N_m is not None and rms > motor.torque_rated_N_m:
            found.append(f"{use.name}: {rms:.3g} N m RMS torque, torque_rated_N_m is {motor.torque_rated_N_m:.3g}")
        if motor.stall_torque_N_m is not None and (share := use.load_of_the_line(motor)) > 1:
            over = f"{100 * share:.3g} % of it" if math.isfinite(share) else "beyond its no-load speed"
            found.append(f"{use.name}: the motor is asked for more than its torque-speed line gives, {over}")
    name = result.expectation.recommended
    command = result.profiles[name].command_N if name in result.profiles else None
    if command is not None:
        low, high = float(command.min()), float(command.max())
        slack = 1e-3 * (actuator.force_max_N - actuator.force_min_N)
        if low < actuator.force_min_N - slack or high > actuator.force_max_N + slack:
            found.append(
                f"command_{name}_N goes from {low:.4g} to {high:.4g} N to make up for the drive's lag, beyond "
                f"force_min_N = {actuator.force_min_N:g} and force_max_N = {actuator.force_max_N:g}: clipped, it "
                "leaves more error than stated. A slower reference needs less"
            )
    return [Danger(text) for text in found]
