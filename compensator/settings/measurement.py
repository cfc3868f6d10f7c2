"""Table [measurement]: how measured files are to be read."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """How measured files are to be read; no settings yet."""
