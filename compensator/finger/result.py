"""Result of a finger's design."""

import math
import os
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.finger.compensators import FingerCompensator
from tendonff.compensator.finger.scenario import FingerScenario, SampledFinger
from tendonff.compensator.finger.sheet import JointSheet, TendonSheet
from tendonff.compensator.reporting.results import Result, views_of
from tendonff.ocp.mechanism.response import MechanismRun


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FingerProfile:
    """Commands of the motors, and what they deliver on the verifying mechanism.

    Attributes
    ----------
    name : str
        Of the compensator.
    motor_rad : ndarray, shape (rows, motors)
        Commanded angles.
    angle_rad : ndarray, shape (rows, joints)
        Of the joints that have a reference.
    tension_N : ndarray, shape (rows, tendons)
        At the far ends.
    error_rad : ndarray, shape (rows, joints)
        Reached less wanted.
    """

    name: str
    motor_rad: FloatArray
    angle_rad: FloatArray
    tension_N: FloatArray
    error_rad: FloatArray

    @property
    def rms_rad(self) -> FloatArray:
        """RMS error of each joint, shape (joints,)."""
        found: FloatArray = np.sqrt(np.mean(self.error_rad**2, axis=0))
        return found

    @property
    def rms_of_all_rad(self) -> float:
        """RMS error over all joints."""
        return float(np.sqrt(np.mean(self.error_rad**2)))

    @property
    def peak_rad(self) -> float:
        """Largest error of any joint."""
        return float(np.abs(self.error_rad).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class FingerDesign(Result):
    """Motor angles for several joints, and what each compensator delivers.

    Attributes
    ----------
    scenario : FingerScenario
    sampled : SampledFinger
    compensators : tuple of FingerCompensator
        In the order in which they are shown.
    profiles : dict of str to FingerProfile
        By name of the compensator.
    failed : dict of str to str
        Why a compensator has no profile, by its name.
    inversion : MechanismRun
        The exact inverse before the drives.
    expectation : Expectation
        What to expect on a rig, and the profile that does best there.
    tendons : tuple of TendonSheet
    joints : tuple of JointSheet
        Data sheet.
    masses, refinement : int
        Of the verifying mechanism: masses a tendon, and its steps in one of the design.
    doubt_masses : int
        Masses a tendon of the mechanisms that may be the real one.
    warnings : tuple of str
        What the user should know.
    """

    scenario: FingerScenario
    sampled: SampledFinger
    compensators: tuple[FingerCompensator, ...]
    profiles: dict[str, FingerProfile]
    failed: dict[str, str]
    inversion: MechanismRun
    expectation: Expectation
    tendons: tuple[TendonSheet, ...]
    joints: tuple[JointSheet, ...]
    masses: int
    refinement: int
    doubt_masses: int
    warnings: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints that have a reference."""
        return self.scenario.mechanism.names[: self.scenario.wanted]

    @property
    def recommended(self) -> FingerCompensator:
        """The compensator whose worst error over the uncertainty is least."""
        return next(c for c in self.compensators if c.name == self.expectation.recommended)

    @property
    def headline(self) -> str:
        """Expected error on a rig, and the next step."""
        file = as_argument(self.scenario.source)
        then = next_step(self.expectation, file, f"run motor angles of {file} from profile.csv, or tf.Runtime")
        return self.expectation.headline(self.recommended.label, then)

    @property
    def fine_print(self) -> str:
        """Errors with exactly the design's parameters."""
        best, plain = (math.degrees(self.profiles[n].rms_of_all_rad) for n in (self.recommended.name, "linear"))
        return (
            f"With exactly the design's parameters the RMS error over all joints is {best:.2g} deg "
            f"({self.recommended.label}, {self.masses} masses a tendon, step/{self.refinement}), {plain:.2g} deg with "
            "the lengths of the tendons alone. Known in advance: profile.csv to the motors; known only at run "
            "time: tendonff export-c, or tf.Runtime."
        )

    @property
    def is_usable(self) -> bool:
        """No compensator failed."""
        return not self.failed

    def write(self, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False) -> None:
        """Write `profile.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder.

        An interactive report has a view with zoom, hover and a legend that hides curves, and needs Bokeh.
        """
        views_of(FingerDesign).write(self, folder, interactive=interactive, pdf=pdf)
