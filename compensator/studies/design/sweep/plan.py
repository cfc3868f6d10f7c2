"""Plan of a sweep: points of a grid over scenario keys, or units drawn from the stated uncertainty."""

import re
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from tendonff.compensator.compensators.every import AnyScenario, problem_of
from tendonff.compensator.compensators.uncertain import draw_systems
from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.models.errors import ParameterError
from tendonff.models.parameters.numbers import FACTORS, is_whole, keys_of, with_numbers
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A key of the scenario and the values it takes."""

    key: str  # "table.name" or "table.inner.name", as in the scenario file
    values: tuple[float, ...]

    @classmethod
    def parse(cls, text: str) -> "Axis":
        """Read KEY=FROM:TO:COUNT, evenly spaced, both ends included."""
        number = r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)"
        found = re.fullmatch(rf"([A-Za-z_]\w*(?:\.\w+)+)={number}:{number}:(\d+)", text.strip())
        try:
            key, first, last, count = found[1], float(found[2]), float(found[3]), int(found[4])  # type: ignore[index]
        except (TypeError, ValueError):
            raise InputError(
                f'--over must be KEY=FROM:TO:COUNT, got "{text}"; write friction.mu_dynamic=0.15:0.25:11'
            ) from None
        if not 1 <= count <= 100_000:
            raise InputError(f"--over {key}: COUNT must lie between 1 and 100000, got {count}")
        return cls(key=key, values=tuple(np.linspace(first, last, count).tolist()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """Point of the plan."""

    index: int
    values: tuple[float, ...]  # of the varied keys
    scenario: AnyScenario  # with those values


def grid_units(scenario: AnyScenario, axes: tuple[Axis, ...]) -> list[Unit]:
    """Every combination of the axes' values."""
    keys = tuple(axis.key for axis in axes)
    points = product(*(axis.values for axis in axes))
    return [Unit(index=k, values=at, scenario=varied(scenario, keys, at)) for k, at in enumerate(points)]


def uncertainty_of(scenario: AnyScenario) -> Uncertainty:
    """Intervals that are drawn from: [robust], or those that `design` assumes where it states nothing."""
    if not scenario.robust.is_certain:
        return scenario.robust
    stated: Uncertainty = problem_of(scenario).doubt.uncertainty
    return stated


def random_keys(scenario: AnyScenario) -> tuple[str, ...]:
    """Keys that the scenario's uncertainty varies, in the order of a unit's values."""
    return tuple(key for spread in uncertainty_of(scenario).spreads for key in spread.keys)


def random_units(scenario: AnyScenario, count: int) -> list[Unit]:
    """Units that the scenario's uncertainty, stated or assumed, admits: a Sobol sequence over its intervals."""
    stated = uncertainty_of(scenario)
    drawn = draw_systems(scenario.system, stated, count)
    certain, keys = replace(scenario, robust=Uncertainty()), random_keys(scenario)
    return [
        Unit(
            index=k,
            values=tuple(sample.numbers[key] for key in keys),
            scenario=certain.with_system(sample.system, sample.numbers),
        )
        for k, sample in enumerate(drawn)
    ]


@in_turn
def draw(scenario: AnyScenario, n: int, *, seed: int | None = None) -> tuple[AnyScenario, ...]:
    """Draw scenarios at random from what a scenario says of its numbers, such as for randomised training.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        Its [robust] has the intervals; where it states none, those that `design` assumes.
    n : int
        How many, >= 1: a Sobol sequence over all intervals, which covers them evenly.
    seed : int, optional
        Another one gives other scenarios, the same one the same; default: that of [robust].

    Returns
    -------
    tuple of scenarios
        Each with numbers of its own and without intervals, for `tf.simulate`, `tf.design`, `tf.Runtime` and all others.

    Raises
    ------
    InputError
        If `n` is no such number.

    Examples
    --------
    >>> import tendonff as tf
    >>> drawn = tf.draw(tf.load_scenario("examples/finger.toml"), 3, seed=1)
    >>> [round(each.transmission.friction.mu_dynamic, 3) for each in drawn]
    [0.2, 0.18, 0.19]
    """
    if isinstance(n, bool) or not isinstance(n, int) or n < 1:
        raise InputError(f"draw: n must be a whole number >= 1, got {n!r}")
    stated = uncertainty_of(scenario)
    try:
        stated = stated if seed is None else replace(stated, seed=seed)
    except ParameterError as error:
        raise InputError(f"draw: {error}") from None
    return tuple(unit.scenario for unit in random_units(replace(scenario, robust=stated), n))


def varied(scenario: AnyScenario, keys: tuple[str, ...], values: tuple[float, ...]) -> AnyScenario:
    """The scenario with other values of keys "table.name"; what follows from them follows, see `with_numbers`."""
    run, system = scenario.run, scenario.system
    changes: dict[str, float] = {}
    steps: dict[str, float] = {}
    known = [*keys_of(system)[len(FACTORS) :], "run.step_s"]
    for key, value in zip(keys, values, strict=True):
        if key not in known:
            _refuse(scenario, key, known)
        if key != "run.step_s" and is_whole(system, key) and value != round(value):
            name = key.rpartition(".")[2]
            raise InputError(f"--over {key}: {name} must be a whole number, got {value:g}; choose FROM:TO:COUNT so")
        (steps if key == "run.step_s" else changes)[key] = value
    try:
        if steps:
            run = replace(run, step_s=steps["run.step_s"])
        changed: AnyScenario = replace(scenario, run=run).with_system(with_numbers(system, changes), changes)
    except ParameterError as error:
        at = ", ".join(f"{key} = {value:g}" for key, value in zip(keys, values, strict=True))
        raise InputError(f"--over: {at}: {error}") from None
    return changed


def _refuse(scenario: AnyScenario, key: str, known: list[str]) -> None:
    """Say what is wrong with a key that is not known: its table, a table that the file lacks, or its name."""
    table, name = key.rsplit(".", 1)
    names = [each.rsplit(".", 1)[1] for each in known if each.rsplit(".", 1)[0] == table]
    if names:
        raise InputError(f'--over {key}: [{table}] has no number "{name}"{suggestion(name, names)}')
    if table == "actuator.motor":
        raise InputError(f"--over {key}: {scenario.source.name} has no [{table}]; add it")
    tables = list(dict.fromkeys(each.rsplit(".", 1)[0] for each in known))
    raise InputError(f'--over {key}: unknown table "{table}"{suggestion(table, tables)}')
