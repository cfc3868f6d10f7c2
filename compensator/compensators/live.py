"""Expected error of a reference that arrives live: of the exact inverse, as exported C and Runtime run it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from tendonff.compensator.compensators.closed_form import Inverse
from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.scenario import Scenario


def live_headline(found: Expectation, scenario: Scenario) -> str:
    """The same in a sentence, with the next step."""
    file = as_argument(scenario.source)
    then = next_step(found, file, "call the inverse once per sample, and watch its status")
    return f"For a reference that arrives live: {found.headline(Inverse.label, then)}"


def expect_live(problem: Any, known: Mapping[str, Any] = MappingProxyType({})) -> Expectation:
    """Errors of the exact inverse over all plants that may be the real one, the reference being known live.

    `known` are profiles of the problem that exist already; the one that it is compared with is taken from there.
    """
    inverse, plain = (compensator_of(problem, name) for name in ("inverse", problem.plain))
    beside = known[plain.name] if plain.name in known else problem.answer(plain)
    found: Expectation = problem.expect({inverse.name: problem.answer_live(inverse), plain.name: beside}, inverse.name)
    return found
