"""Bounds of settings, worded like those of the physical parameters."""

import math

from tendonff.models.errors import ParameterError


def require_number(
    name: str,
    value: float,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    hint: str,
) -> None:
    """Refuse `value` unless it is finite and within the bounds given.

    Parameters
    ----------
    name : str
        Key in the scenario file.
    value : float
        What was given.
    above, least, below : float, optional
        Exclusive lower, inclusive lower and exclusive upper bound.
    hint : str
        The way out, for the message.
    """
    bounds = []
    if above is not None:
        bounds.append(f"> {above:g}")
    if least is not None:
        bounds.append(f">= {least:g}")
    if below is not None:
        bounds.append(f"< {below:g}")
    within = (
        math.isfinite(value)
        and (above is None or value > above)
        and (least is None or value >= least)
        and (below is None or value < below)
    )
    if not within:
        wanted = "a finite number " + " and ".join(bounds)
        raise ParameterError(f"{name} must be {wanted.strip()}, got {value}; {hint}")


def require_whole(name: str, value: int, *, least: int, most: int, hint: str) -> None:
    """Refuse `value` unless it is a whole number from `least` to `most`.

    Parameters
    ----------
    name : str
        Key in the scenario file.
    value : int
        What was given.
    least, most : int
        Inclusive bounds.
    hint : str
        The way out, for the message.
    """
    if not least <= value <= most:
        raise ParameterError(f"{name} must be a whole number from {least} to {most}, got {value}; {hint}")
