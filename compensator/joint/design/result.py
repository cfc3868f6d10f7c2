"""Result of a joint's design."""

import math
import os
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.joint.compensators import JointCompensator
from tendonff.compensator.joint.scenario.reference import JointQuantity
from tendonff.compensator.joint.scenario.scenario import JointScenario, SampledJoint
from tendonff.compensator.reporting.results import Result, views_of
from tendonff.models.joint.closed_form import DataSheet
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.ocp.joint.invert import JointInversion, JointStatus

_BEYOND = 1.005  # of a limit: rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointProfile:
    """A command of the motors, and what it did on the verifying mechanism.

    Attributes
    ----------
    name : str
    motor_rad : ndarray, shape (rows, motors)
        Commanded angle.
    reached : ndarray, shape (rows,)
        Angle of the joint [rad], or its torque on what it touches [N m].
    tension_N : ndarray, shape (rows, tendons)
        At the joint.
    torque_N_m : ndarray, shape (rows, motors)
        Of the motors.
    error : ndarray, shape (rows,)
        Reached less wanted.
    """

    name: str
    motor_rad: FloatArray
    reached: FloatArray
    tension_N: FloatArray
    torque_N_m: FloatArray
    error: FloatArray

    @property
    def rms(self) -> float:
        """RMS error [rad or N m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def peak(self) -> float:
        """Largest error [rad or N m]."""
        return float(np.abs(self.error).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class JointDesign(Result):
    """Motor angles for one joint, and what each delivers.

    Attributes
    ----------
    scenario : JointScenario
        The scenario it was made for.
    sampled : SampledJoint
        Its reference, sampled.
    compensators : tuple of JointCompensator
        In the order in which they are shown.
    profiles : dict of str to JointProfile
        By name of the compensator.
    failed : dict of str to str
        Why a compensator has no profile, by its name.
    inversion : JointInversion
        The exact inverse before the drive.
    homing_rad : ndarray, shape (rows, motors)
        Commands of the homing stroke, which the profiles go on from; empty without one.
    sheet : DataSheet or None
        Closed forms of a loop.
    sheets : tuple of (float, DataSheet)
        Of a loop: the same over pre-tensions.
    expectation : Expectation
        What to expect on a rig, and the profile that does best there.
    feedback : FeedbackResult or None
        Feedback beside the feedforward, where the scenario has [feedback].
    middle : Mechanism or None
        What the robust profile is designed for; None where there is none.
    masses, refinement : int
        Of the verifying mechanism: masses a tendon, and its steps in one of the design.
    warnings : tuple of str
        What the user should know.
    """

    scenario: JointScenario
    sampled: SampledJoint
    compensators: tuple[JointCompensator, ...]
    profiles: dict[str, JointProfile]
    failed: dict[str, str]
    inversion: JointInversion
    homing_rad: FloatArray
    sheet: DataSheet | None
    sheets: tuple[tuple[float, DataSheet], ...]
    expectation: Expectation
    feedback: FeedbackResult | None
    middle: Mechanism | None
    masses: int
    refinement: int
    warnings: tuple[str, ...]

    @property
    def is_angle(self) -> bool:
        """An angle is wanted, not a torque."""
        return self.scenario.reference.quantity is JointQuantity.ANGLE

    @property
    def is_loop(self) -> bool:
        """Whether one motor holds both tendons."""
        return self.scenario.mechanism.drive.kind is DriveKind.LOOP

    def percent(self, value: float) -> float:
        """A value as a share of the wanted range [%]."""
        return 100 * value / self.sampled.range

    def text(self, value: float) -> str:
        """An error in degrees or N m and as a share of the range."""
        shown = f"{math.degrees(value):.2g} deg" if self.is_angle else f"{value:.2g} N m"
        return f"{shown} ({self.percent(value):.2g} % of range)"

    @property
    def recommended(self) -> JointCompensator:
        """The compensator whose worst error over the uncertainty is least."""
        return next(c for c in self.compensators if c.name == self.expectation.recommended)

    @property
    def change(self) -> str:
        """The change to make where the motor cannot follow the reference; empty where it can."""
        drive, inversion = self.scenario.mechanism.drive, self.inversion
        torque = float(np.abs(inversion.motor_torque_N_m).max())
        if drive.torque_max_N_m is not None and torque > _BEYOND * drive.torque_max_N_m:
            return (
                f"a motor or gear_ratio for {torque:.3g} N m (torque_max_N_m = {drive.torque_max_N_m:g}), or less load"
            )
        speed = float(np.abs(np.diff(inversion.motor_rad, axis=0)).max()) / self.scenario.run.step_s
        if drive.speed_max_rad_per_s is not None and speed > _BEYOND * drive.speed_max_rad_per_s:
            return (
                f"a reference slower by {speed / drive.speed_max_rad_per_s:.2g}, or a motor for {speed:.3g} rad/s "
                f"(speed_max_rad_per_s = {drive.speed_max_rad_per_s:g})"
            )
        if inversion.status is JointStatus.SLACK and self.sheet is not None:
            return f"raise pretension_N from {drive.pretension_N:g} to {self.sheet.recommended_pretension_N:.3g}"
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
        best = self.profiles[self.recommended.name]
        whole = f"{math.degrees(self.sampled.range):.3g} deg" if self.is_angle else f"{self.sampled.range:.3g} N m"
        return (
            f"With exactly the design's parameters the RMS error is {self.text(best.rms)} ({self.recommended.label}, "
            f"{self.masses} masses a tendon, step/{self.refinement}), {self.text(self.profiles['linear'].rms)} with "
            f"the ratio alone; the range is {whole}. Known in advance: profile.csv to the motors; known only at "
            "run time: tendonff export-c, or tf.Runtime."
        )

    @property
    def is_usable(self) -> bool:
        """No compensator failed, and no tendon of a pair would have to push."""
        return not self.failed and self.inversion.status is not JointStatus.WOULD_PUSH

    def write(self, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False) -> None:
        """Write `profile.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder.

        An interactive report has a view with zoom, hover and a legend that hides curves, and needs Bokeh.
        """
        views_of(JointDesign).write(self, folder, interactive=interactive, pdf=pdf)
