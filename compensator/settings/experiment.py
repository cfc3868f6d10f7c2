"""Table [experiment]: the two-motor test."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """The two-motor test; no settings yet."""
