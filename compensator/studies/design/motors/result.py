"""Result of a design of motor angles."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.compensators.motors.response import MotorResponse
from tendonff.compensator.compensators.motors.sheet import JointSheet, TendonSheet
from tendonff.compensator.compensators.motors.task import MotorCompensator, MotorTask
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.goal import Goal
from tendonff.compensator.studies.design.shown import ShownDesign
from tendonff.models.joint.closed_form import DataSheet
from tendonff.ocp.integrate.method import Method

_BEYOND = 1.005  # of a limit: rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorProfile:
    """A command of the motors, and what it did on the verifying mechanism, after the homing stroke.

    Attributes
    ----------
    name : str
        Of the compensator.
    motor_rad : ndarray, shape (rows, motors)
        Commanded angles.
    reached : ndarray, shape (rows, goals)
        Angles of the joints [rad], or torque of a joint on what it touches [N m].
    tension_N : ndarray, shape (rows, tendons)
        At the far ends.
    torque_N_m : ndarray, shape (rows, motors)
        Of the motors.
    error : ndarray, shape (rows, goals)
        Reached less wanted.
    """

    name: str
    motor_rad: FloatArray
    reached: FloatArray
    tension_N: FloatArray
    torque_N_m: FloatArray
    error: FloatArray

    @property
    def rms_each(self) -> FloatArray:
        """RMS error of each goal, shape (goals,)."""
        found: FloatArray = np.sqrt(np.mean(self.error**2, axis=0))
        return found

    @property
    def rms(self) -> float:
        """RMS error over all goals [rad or N m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def peak(self) -> float:
        """Largest error of any goal [rad or N m]."""
        return float(np.abs(self.error).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotorDesign(ShownDesign):
    """Motor angles for driven joints, and what each compensator delivers.

    Attributes
    ----------
    scenario : JointScenario or FingerScenario
        The scenario it was made for.
    task : MotorTask
        Its reference and mechanism.
    compensators : tuple of MotorCompensator
        In the order in which they are shown.
    profiles : dict of str to MotorProfile
        By name of the compensator.
    failed : dict of str to str
        Why a compensator has no profile, by its name.
    inversion : MotorResponse
        The exact inverse before the drives, after the homing stroke.
    homing_rad : ndarray, shape (rows, motors)
        Commands of the homing stroke, which the profiles go on from; empty without one.
    sheet : DataSheet or None
        Closed forms of a loop.
    sheets : tuple of (float, DataSheet)
        Of a loop: the same over pre-tensions.
    tendons : tuple of TendonSheet
    joints : tuple of JointSheet
        Data sheet of several joints.
    expectation : Expectation
        What to expect on a rig, and the profile that does best there.
    feedback : FeedbackResult or None
        Feedback beside the feedforward, where the scenario has [feedback].
    warnings : tuple of str
        What the user should know.
    """

    shown_by: ClassVar[str] = "studies.design.motors.output"

    scenario: JointScenario | FingerScenario
    task: MotorTask
    compensators: tuple[MotorCompensator, ...]
    profiles: dict[str, MotorProfile]
    failed: dict[str, str]
    inversion: MotorResponse
    homing_rad: FloatArray
    sheet: DataSheet | None
    sheets: tuple[tuple[float, DataSheet], ...]
    tendons: tuple[TendonSheet, ...]
    joints: tuple[JointSheet, ...]
    expectation: Expectation
    feedback: FeedbackResult | None
    warnings: tuple[str, ...]

    @property
    def goal(self) -> Goal:
        """Wanted quantities."""
        return self.task.goal

    @property
    def verifying(self) -> str:
        """The mechanism that profiles are verified on, in words."""
        return f"{self.task.masses} masses a tendon, step/{self.task.refinement}"

    @property
    def doubt_masses(self) -> int:
        """Masses of each tendon of the mechanisms that may be the real one."""
        return self.task.doubt_masses(self.task.system)

    def percent(self, value: float) -> float:
        """A value as a share of the wanted range [%]."""
        return 100 * value / scale_of(self.task.wanted)

    def text(self, value: float) -> str:
        """An error as it is shown, and as a share of the range."""
        unit = self.goal.unit
        return f"{unit.factor * value:.2g} {unit.shown} ({self.percent(value):.2g} % of {self.goal.range})"

    def check(self, method: Method) -> MethodCheck:
        """Simulate the recommended motor angles by the fixed step and by a method; see `ShownDesign.check`."""
        task, unit = self.task, self.goal.unit
        command = task.answer(self.recommended)
        first, second = (
            unit.factor * task.values_of(task.respond(task.system, command, method=each))
            for each in (Method.BDF2, method)
        )
        return MethodCheck.of(method, self.recommended.label, unit.shown, unit.factor * task.wanted, (first, second))

    @property
    def change(self) -> str:
        """The change to make where a motor cannot follow the reference; empty where all can."""
        found = self.inversion
        speed = np.abs(np.diff(found.motor_rad, axis=0)).max(axis=0) / self.task.step_s
        for k, drive in enumerate(self.task.drives):
            torque = float(np.abs(found.torque_N_m[:, k]).max())
            if drive.torque_max_N_m is not None and torque > _BEYOND * drive.torque_max_N_m:
                return (
                    f"a motor or gear_ratio for {torque:.3g} N m (torque_max_N_m = {drive.torque_max_N_m:g}), or less "
                    "load"
                )
            if drive.speed_max_rad_per_s is not None and speed[k] > _BEYOND * drive.speed_max_rad_per_s:
                return (
                    f"a reference slower by {speed[k] / drive.speed_max_rad_per_s:.2g}, or a motor for {speed[k]:.3g} "
                    f"rad/s (speed_max_rad_per_s = {drive.speed_max_rad_per_s:g})"
                )
        if found.slack and self.sheet is not None:
            tension = self.task.drives[0].pretension_N
            return f"raise pretension_N from {tension:g} to {self.sheet.recommended_pretension_N:.3g}"
        return ""

    @property
    def headline(self) -> str:
        """Expected error on a rig, and the next command."""
        file = as_argument(self.scenario.source)
        then = next_step(self.expectation, file, f"tendonff export-c {file} --out c", change=self.change)
        return self.expectation.headline(self.recommended.label, then)

    @property
    def fine_print(self) -> str:
        """Errors with exactly the design's parameters."""
        best, plain = self.profiles[self.recommended.name], self.profiles["linear"]
        unit, target = self.goal.unit, self.task.target
        whole = unit.factor * float(np.ptp(target, axis=0).max())
        over = " over all joints" if self.goal.is_named else ""
        columns = ", ".join(self.columns_of(self.recommended.name))
        return (
            f"With exactly the design's parameters the RMS error{over} is {self.text(best.rms)} "
            f"({self.recommended.label}, {self.verifying}), {self.text(plain.rms)} with the ratio alone; "
            f"{self.goal.range} {whole:.3g} {unit.shown}. Known in advance: "
            f"{columns} of profile.csv to the motors; known only at run time: tendonff export-c, or tf.Runtime."
        )

    def columns_of(self, name: str) -> tuple[str, ...]:
        """Columns of `profile.csv` with the motors' angles of that compensator, in the order of the motors."""
        if self.goal.is_named:
            return tuple(f"motor_{motor}_{name}_rad" for motor in self.task.motors)
        if self.sheet is not None:
            return (f"motor_{name}_rad",)
        by = "" if name == "inverse" else f"_{name}"
        return tuple(f"motor_{motor}{by}_rad" for motor in self.task.motors)

    @property
    def is_usable(self) -> bool:
        """No compensator failed, and no tendon would have to push."""
        return not self.failed and not self.inversion.would_push
