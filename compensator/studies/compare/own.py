"""The user's own force beside the compensators: [compare] force = "FILE.csv"."""

from dataclasses import dataclass

from tendonff.compensator.compensators.base import Compensator, Problem
from tendonff.compensator.compensators.every import AnyScenario
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.studies.simulate.run import ForceProfile, read_force
from tendonff.models.parameters.drive import Drive


@dataclass(frozen=True)  # without slots: the class holds what all compensators have
class OwnForce(Compensator):
    """Force of a file, held after its last row."""

    force: ForceProfile

    name = "own"
    knows_the_level = False

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name of the file."""
        return f"own force, {self.force.name}"

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Force at the samples of the reference, as it is; see `Compensator.profile`."""
        return Profile(force_N=self.force.at(problem.reference.time_s))


def own_force(scenario: AnyScenario) -> tuple[OwnForce, ...]:
    """The user's own force, where the scenario names one; InputError where it cannot be compared."""
    file = scenario.source.name
    if scenario.compare is None:
        return ()
    given = scenario.compare
    if scenario.transmission.actuator.drive is Drive.POSITION:
        raise InputError(f"{file} [compare]: force is for a force drive, this one takes positions; leave it out")
    force = read_force(scenario.source.parent / given.force, given.column)
    last = scenario.run.step_s + float(force.time_s[-1])
    length = getattr(scenario.reference, "duration_s", last)
    if last < length:
        raise InputError(
            f"{file} [compare]: {given.force} ends at {force.time_s[-1]:g} s, the reference at {length:g} s; give it "
            "the whole reference"
        )
    return (OwnForce(force),)
