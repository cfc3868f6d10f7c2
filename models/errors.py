"""Exceptions of models, one per cause."""

import math
from numbers import Real


class TendonffError(Exception):
    """Base of every error that tendonff raises on purpose; its text is meant for the user."""


class ParameterError(TendonffError, ValueError):
    """A physical parameter or an argument lies outside the range in which the model means anything."""


LARGEST = 1e15
"""Largest value of any quantity in SI units: larger ones come from a wrong unit and would overflow on the way."""


def require(name: str, value: float, *, above: float | None = None, least: float | None = None, hint: str) -> None:
    """Refuse `value` unless it is a finite number above / at least the bound; NaN fails every comparison."""
    if not isinstance(value, Real):
        raise ParameterError(f"{name} must be a number, got {value!r}; {hint}")
    within = (above is None or value > above) and (least is None or value >= least)
    if not (within and math.isfinite(value)):
        bound = f" > {above:g}" if above is not None else f" >= {least:g}" if least is not None else ""
        raise ParameterError(f"{name} must be a finite number{bound}, got {value}; {hint}")
    if value > LARGEST:
        raise ParameterError(f"{name} must be at most {LARGEST:g}, got {value:g}; check its unit")


def require_given(
    name: str, value: float | None, *, above: float | None = None, least: float | None = None, hint: str
) -> None:
    """The same for a key that may be left out."""
    if value is not None:
        require(name, value, above=above, least=least, hint=hint)


def require_whole(name: str, value: int, *, least: int, most: int, hint: str) -> None:
    """Refuse `value` unless it is a whole number from `least` to `most`."""
    if not (isinstance(value, int) and least <= value <= most):
        raise ParameterError(f"{name} must be a whole number from {least} to {most}, got {value}; {hint}")


def require_range(name: str, given: tuple[float, ...] | None) -> None:
    """Refuse a range that is not two finite numbers, the lower one first; None is none."""
    if given is not None and not (len(given) == 2 and math.isfinite(given[0] - given[1]) and given[0] < given[1]):
        raise ParameterError(f"{name} must be two numbers, the lower one first, got {list(given)}; try [0.0, 1.5]")
