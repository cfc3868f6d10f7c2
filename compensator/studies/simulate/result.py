"""Result of a simulation from file to file."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedFile:
    """A file of commands that was simulated; its rows are in the file that was named."""

    rows: int  # rows written
    warnings: tuple[str, ...]  # what the user should know
    notes: tuple[str, ...] = ()  # what was taken for granted when it was read
    # estimate of the discretisation error, and whether the run is reproducible, in words, on request
    check: str | None = None
