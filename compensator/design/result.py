"""Result of a design."""

from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.score import IgnoredMotion, Score, Verified
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.stability import StickSlipPrediction
from tendonff.ocp.tracking.result import Tracking


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignData:
    """Force profiles for one scenario and what each delivers. `Design` documents its fields."""

    scenario: Scenario
    reference: Reference
    compensators: tuple[Compensator, ...]
    profiles: Mapping[str, Profile]
    failed: Mapping[str, str]
    verified: tuple[Verified, ...]
    proof: tuple[Verified, ...]
    stick_slip: StickSlipPrediction
    expectation: Expectation
    ignored: IgnoredMotion | None
    warnings: tuple[str, ...]

    @property
    def level(self) -> Level:
        """Fidelity level of the design model."""
        return self.scenario.run.level

    @property
    def forces_N(self) -> dict[str, FloatArray]:
        """Force of each compensator, by name [N]."""
        return {name: profile.force_N for name, profile in self.profiles.items()}

    @property
    def tracking(self) -> Tracking | None:
        """Outcome of the optimal-control problem; None where none was solved."""
        return next((p.tracking for p in self.profiles.values() if p.tracking is not None), None)

    @property
    def recommended(self) -> Compensator:
        """The compensator whose worst error over the uncertainty is least."""
        return next(c for c in self.compensators if c.name == self.expectation.recommended)

    @property
    def is_usable(self) -> bool:
        """No compensator failed."""
        return not self.failed and all(profile.status is not ProfileStatus.FAILED for profile in self.profiles.values())

    def on_level(self, name: str, level: Level) -> Verified:
        """Output of a compensator on a level."""
        return next(v for v in self.verified if v.compensator == name and v.plant.level is level)

    def scores(self, name: str) -> list[Score]:
        """Score of a compensator on every level, then on the finer chain."""
        return [*(self.on_level(name, level).score for level in Level), self.on_proof(name).score]

    def on_proof(self, name: str) -> Verified:
        """Output of a compensator on the finer chain."""
        return next(v for v in self.proof if v.compensator == name)
