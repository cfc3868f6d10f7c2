"""Expected error of a reference that arrives live: of the exact inverse, as exported C and Runtime run it."""

from collections.abc import Mapping
from dataclasses import replace

from tendonff.compensator.compensators.base import Problem, with_motion, with_travel
from tendonff.compensator.compensators.closed_form import Frictionless, Inverse
from tendonff.compensator.compensators.expectation import FRICTIONLESS, Expectation
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters.drive import Drive


def driven(problem: Problem, name: str, profile: Profile) -> Profile:
    """Profile of a module as applied by the actuator, within the limits of its motion, which modules do not include.

    Lag, delay and hold of the drive remain, as in the exported code; a position drive takes the command unchanged.
    """
    if problem.transmission.actuator.drive is Drive.POSITION:
        return profile if profile.command_m is not None else with_travel(problem, name, profile)
    return replace(profile, force_N=problem.limited(profile.force_N), travel_m=None)


def live_headline(found: Expectation, scenario: Scenario) -> str:
    """The same in a sentence, with the next step."""
    file = as_argument(scenario.source)
    then = next_step(found, file, "call the inverse once per sample, and watch its status")
    return f"For a reference that arrives live: {found.headline(Inverse.label, then)}"


def expect_live(problem: Problem, known: Mapping[str, Profile] | None = None) -> Expectation:
    """Errors of the exact inverse over all transmissions that may be the real one, the reference being known live.

    `known` are profiles of the problem that exist already; the one without friction is taken from there.
    """
    following, inverse, bare = replace(problem, live=True), Inverse(), Frictionless()
    plain = (known or {}).get(FRICTIONLESS)
    profiles = {
        inverse.name: driven(problem, inverse.name, inverse.profile(following)),
        FRICTIONLESS: with_motion(problem, bare.name, bare.profile(problem)) if plain is None else plain,
    }
    return problem.expect(profiles, inverse.name)
