"""Result of a design."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.ignored import IgnoredMotion
from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.compensators.next_step import limited_by, next_step
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.score import Score, Verified
from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.design.online import Online
from tendonff.compensator.studies.design.shown import ShownDesign
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.tendon.stability import StickSlipPrediction
from tendonff.ocp.tracking.result import Tracking


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Design(ShownDesign):
    """Force profiles for one scenario, and what each delivers.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    reference : Reference
        What was to be delivered, sampled.
    compensators : tuple of Compensator
        In the order in which they are shown.
    profiles : dict of str to Profile
        By name of the compensator.
    failed : dict of str to str
        What ended the computation of other profiles, by name of the compensator.
    verified : tuple of Verified
        Every compensator on every level.
    proof : tuple of Verified
        Every compensator on the design level with more masses and a smaller step.
    stick_slip : StickSlipPrediction
        Where friction that weakens with speed makes feedforward fail.
    expectation : Expectation
        What to expect on a rig, and the profile that does best there.
    live : Expectation
        The same of the exact inverse where the reference is known only at run time, as exported C has it.
    ignored : IgnoredMotion or None
        What it would cost to ignore that joints move; None where none does.
    feedback : FeedbackResult or None
        Feedback beside the feedforward, where the scenario has [feedback].
    online : Online or None
        Filters of a live reference, where the scenario has [stream].
    warnings : tuple of str
        What the user should know.
    """

    shown_by: ClassVar[str] = "studies.design.output"

    scenario: Scenario
    reference: Reference
    compensators: tuple[Compensator, ...]
    profiles: Mapping[str, Profile]
    failed: Mapping[str, str]
    verified: tuple[Verified, ...]
    proof: tuple[Verified, ...]
    stick_slip: StickSlipPrediction
    expectation: Expectation
    live: Expectation
    ignored: IgnoredMotion | None
    feedback: FeedbackResult | None
    online: Online | None
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
    def headline(self) -> str:
        """Expected error on a rig, and the next step."""
        found, file = self.expectation, as_argument(self.scenario.source)
        change = "" if self.tracking is None else limited_by(found, self.tracking.reasons)
        then = next_step(found, file, f"tendonff export-c {file} --out c", change=change)
        return found.headline(self.recommended.label, then)

    def check(self, method: Method) -> MethodCheck:
        """Simulate the recommended profile by a method on the design level; see `ShownDesign.check`."""
        name = self.recommended.name
        verified = self.on_level(name, self.level)
        plant = replace(verified.plant, method=method)
        response = plant.respond(self.profiles[name], self.reference).require()
        outputs = verified.response.output_N, response.output_N
        return MethodCheck.of(method, self.recommended.label, "N", self.reference.tension_N, outputs)

    @property
    def is_position_drive(self) -> bool:
        """The actuator takes positions."""
        return self.scenario.transmission.actuator.drive is Drive.POSITION

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
