"""Scenarios drawn from what a scenario says of its numbers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.compensators.every import compensator_of, problem_of
from tendonff.compensator.files.reading import InputError
from tendonff.models.errors import ParameterError

EXAMPLES = Path(__file__).resolve().parents[5] / "examples"
FILES = ("finger.toml", "hand_joint.toml", "three_joint_finger.toml")


def numbers(scenario: Any) -> list[float]:
    """Friction and stiffness of its first tendon."""
    system = scenario.system
    first = system if hasattr(system, "friction") else system.tendons[0]
    return [first.friction.mu_dynamic, first.tendon.stiffness_N_per_m]


@pytest.mark.parametrize("file", FILES)
def test_a_seed_draws_the_same_scenarios_again_and_another_one_others(file: str) -> None:
    scenario = tf.load_scenario(EXAMPLES / file)
    first, again, other = (tf.draw(scenario, 5, seed=seed) for seed in (1, 1, 2))
    assert list(map(numbers, first)) == list(map(numbers, again))
    assert list(map(numbers, first)) != list(map(numbers, other))
    assert len({each.digest() for each in (scenario, *first, *other)}) == 11


@pytest.mark.parametrize("file", FILES)
def test_what_is_drawn_stays_within_the_intervals_and_covers_them(file: str, tmp_path: Path) -> None:
    """[robust] mu = 0.3: 64 draws reach both tenths at its ends, and none lies beyond."""
    text = (EXAMPLES / file).read_text(encoding="utf-8").partition("[robust")[0] + "\n[robust]\nmu = 0.3\n"
    path = tmp_path / file
    path.write_text(text, encoding="utf-8")
    scenario = tf.load_scenario(path)
    factors = np.array([numbers(each)[0] for each in tf.draw(scenario, 64)]) / numbers(scenario)[0]
    assert 0.7 <= factors.min() < 0.73
    assert 1.27 < factors.max() <= 1.3


@pytest.mark.compiler
@pytest.mark.parametrize("file", FILES)
def test_drawn_scenarios_are_plants_that_differ(file: str) -> None:
    """The inverse of the scenario errs on each of them more than on its own."""
    scenario = tf.load_scenario(EXAMPLES / file)
    profile = problem_of(scenario).answer(compensator_of(scenario, "inverse"))
    own, *others = (problem_of(each).score(profile).rmse for each in (scenario, *tf.draw(scenario, 2, seed=3)))
    assert min(others) > 1.2 * own


def test_a_drawn_joint_says_in_its_text_what_was_changed() -> None:
    drawn = tf.draw(tf.load_scenario(EXAMPLES / "hand_joint.toml"), 1)[0]
    assert f"# changed: mu = {drawn.changed['mu']:.9g}" in drawn.to_toml()


@pytest.mark.parametrize("n", [0, -1, 2.5, True])
def test_a_number_of_scenarios_that_is_none_is_refused(n: Any) -> None:
    with pytest.raises(InputError, match="n must be a whole number >= 1"):
        tf.draw(tf.load_scenario(EXAMPLES / "finger.toml"), n)


def test_a_seed_that_is_none_is_refused_by_its_bound() -> None:
    with pytest.raises((InputError, ParameterError), match="seed"):
        tf.draw(tf.load_scenario(EXAMPLES / "finger.toml"), 1, seed=-1)
