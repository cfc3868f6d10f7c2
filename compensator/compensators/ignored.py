"""Cost of a design that ignores the motion of the joints on its path."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.score import Score, verify
from tendonff.compensator.scenario.unit import Unit
from tendonff.models.path import JointMotion
from tendonff.ocp.errors import SolveError


@dataclass(frozen=True, slots=True, kw_only=True)
class IgnoredMotion:
    """Cost of designing for the mean pose of joints that move.

    Attributes
    ----------
    motion : JointMotion
        What the joints do.
    known, ignored : Score
        Of the exact inverse that knows the motion, and of the one for the mean pose, both on the moving path; infinite
        where that cannot be simulated.
    """

    motion: JointMotion
    known: Score
    ignored: Score

    @property
    def text(self) -> str:
        """The finding in words."""
        joints = ", ".join(
            f"{name} by {np.ptp(angle):.2f} rad around {angle.mean() + 0.0:.2f} rad"
            for name, angle in zip(self.motion.names, self.motion.angle_rad.T, strict=True)
        )
        ignored, known = (
            f"{found.percent} %{share}" if math.isfinite(found.rmse) else "not to be simulated"
            for found, share in ((self.ignored, " of range"), (self.known, ""))
        )
        return (
            f"The joints move: {joints}. RMS error of the exact inverse on the moving path: {ignored} if it is "
            f"designed for the mean pose, {known} if it knows the motion."
        )

    def named(self, unit: Unit) -> dict[str, float | None]:
        """The errors of the one for the mean pose, as files have them; None where it cannot be simulated."""
        return {key: value if math.isfinite(value) else None for key, value in self.ignored.named(unit).items()}


def ignored_motion(problem: Problem) -> IgnoredMotion | None:
    """Design the exact inverse for the mean pose and simulate it on the moving path; None where nothing moves.

    A side calculation: that one of them cannot be simulated is a finding, and ends nothing.
    """
    motion = problem.transmission.motion
    if motion is None or not motion.moves:
        return None
    still = replace(problem, model=problem.chain.at_rest(motion.angle_rad.mean(axis=0)))
    plant = Plant.fine(problem.transmission, problem.level)
    profiles = (Profile(force_N=each.limited(each.inversion.force_N)) for each in (problem, still))

    def tried(each: Problem, profile: Profile) -> Score:
        try:
            return verify(plant, "inverse", with_motion(each, "inverse", profile), problem.reference).score
        except SolveError:
            return Score(rmse=math.inf, rmse_percent_of_range=math.inf, peak_error=math.inf)

    known, ignored = (tried(each, profile) for each, profile in zip((problem, still), profiles, strict=True))
    return IgnoredMotion(motion=motion, known=known, ignored=ignored)
