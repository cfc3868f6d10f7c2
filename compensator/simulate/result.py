"""What a simulation under a force file leaves to say."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedForce:
    """A force file that was simulated; its rows are in the file that was named.

    Parameters
    ----------
    rows : int
        Rows written.
    warnings : tuple of str
        What the user should know.
    check : str or None
        Estimate of the discretisation error, and whether the run is reproducible, in words, when it was asked for.
    """

    rows: int
    warnings: tuple[str, ...]
    check: str | None
