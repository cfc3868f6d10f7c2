"""What a simulation under a force file leaves to say."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedForce:
    """A force file that was simulated; its rows are in the file that was named."""

    rows: int  # rows written
    warnings: tuple[str, ...]  # what the user should know
    # estimate of the discretisation error, and whether the run is reproducible, in words, when it was asked for
    check: str | None
