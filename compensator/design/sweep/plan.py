"""What a sweep tries: points of a grid over scenario keys, or units drawn from the stated uncertainty."""

import operator
import re
from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np

from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import ParameterError
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.tracking.robust import Sample, draw_transmissions

_TABLES = ("path", "tendon", "friction", "actuator", "actuator.motor", "load", "run")
FACTORS = ("mu_factor", "stiffness_factor", "bristle_stiffness_factor")


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
    """One thing to try."""

    index: int
    values: tuple[float, ...]  # of the varied keys
    scenario: Scenario  # with those values


def grid_units(scenario: Scenario, axes: tuple[Axis, ...]) -> list[Unit]:
    """Every combination of the axes' values."""
    keys = tuple(axis.key for axis in axes)
    points = product(*(axis.values for axis in axes))
    return [Unit(index=k, values=at, scenario=varied(scenario, keys, at)) for k, at in enumerate(points)]


def random_units(scenario: Scenario, count: int) -> list[Unit]:
    """Units that the scenario's uncertainty admits: a Latin hypercube."""
    if scenario.robust.is_certain:
        raise InputError(
            f"{scenario.source.name}: --samples needs an uncertainty; write [robust] with mu = 0.2 or the like"
        )
    drawn = draw_transmissions(scenario.transmission, scenario.robust, count)
    certain = replace(scenario, robust=Uncertainty())
    return [
        Unit(index=k, values=factors_of(sample), scenario=replace(certain, transmission=sample.transmission))
        for k, sample in enumerate(drawn)
    ]


def factors_of(sample: Sample) -> tuple[float, ...]:
    """In the order of `FACTORS`."""
    return (sample.mu, sample.stiffness, sample.bristle_stiffness)


def varied(scenario: Scenario, keys: tuple[str, ...], values: tuple[float, ...]) -> Scenario:
    """The scenario with other values of keys "table.name".

    `mu_static` follows `mu_dynamic` where both are equal, and what the actuator has of its motor follows the motor.
    """
    actuator = scenario.transmission.actuator
    changes: dict[str, dict[str, object]] = {}
    for key, value in zip(keys, values, strict=True):
        table, name = key.rsplit(".", 1)
        if table not in _TABLES:
            raise InputError(f'--over {key}: unknown table "{table}"{suggestion(table, _TABLES)}')
        record = operator.attrgetter(table)(scenario if table == "run" else scenario.transmission)
        if record is None:
            raise InputError(f"--over {key}: {scenario.source.name} has no [{table}]; add it")
        numeric = [f.name for f in fields(record) if isinstance(getattr(record, f.name), int | float)]
        if name not in numeric:
            raise InputError(f'--over {key}: [{table}] has no number "{name}"{suggestion(name, numeric)}')
        whole = isinstance(getattr(record, name), int)
        if whole and value != round(value):
            raise InputError(f"--over {key}: {name} must be a whole number, got {value:g}; choose FROM:TO:COUNT so")
        changes.setdefault(table, {})[name] = round(value) if whole else value
    friction = scenario.transmission.friction
    if "mu_dynamic" in changes.get("friction", {}) and friction.mu_static == friction.mu_dynamic:
        changes["friction"].setdefault("mu_static", changes["friction"]["mu_dynamic"])  # no Stribeck effect stays none
    try:
        if (motor := actuator.motor) is not None and "actuator.motor" in changes:
            turned = replace(motor, **changes.pop("actuator.motor"))  # type: ignore[arg-type]
            changes["actuator"] = {"motor": turned, **turned.at_the_drum, **changes.get("actuator", {})}
        run = replace(scenario.run, **changes.pop("run", {}))  # type: ignore[arg-type]
        transmission = scenario.transmission
        parts = {table: replace(getattr(transmission, table), **change) for table, change in changes.items()}
        return replace(scenario, run=run, transmission=replace(transmission, **parts))
    except ParameterError as error:
        at = ", ".join(f"{key} = {value:g}" for key, value in zip(keys, values, strict=True))
        raise InputError(f"--over: {at}: {error}") from None
