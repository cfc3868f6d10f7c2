"""What can go wrong when a model is built: one exception per cause."""

import math


class TendonffError(Exception):
    """Base of every error that tendonff raises on purpose; its text is meant for the user."""


class ParameterError(TendonffError, ValueError):
    """A physical parameter or an argument lies outside the range in which the model means anything."""


LARGEST = 1e15
"""Largest value of any quantity in SI units: larger ones come from a wrong unit and would overflow on the way."""


def require(name: str, value: float, *, above: float | None = None, least: float | None = None, hint: str) -> None:
    """Refuse `value` unless it is finite and above / at least the bound; NaN fails every comparison.

    Parameters
    ----------
    name : str
        Key in the scenario file.
    value : float
        What was given.
    above, least : float, optional
        Exclusive, and inclusive, lower bound.
    hint : str
        The way out, for the message.
    """
    if above is not None and not (above < value < math.inf):
        raise ParameterError(f"{name} must be a finite number > {above:g}, got {value}; {hint}")
    if least is not None and not (least <= value < math.inf):
        raise ParameterError(f"{name} must be a finite number >= {least:g}, got {value}; {hint}")
    if value > LARGEST:
        raise ParameterError(f"{name} must be at most {LARGEST:g}, got {value:g}; check its unit")
