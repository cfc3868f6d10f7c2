"""Kinds of scenario."""

from enum import StrEnum


class Kind(StrEnum):
    """Kind of a scenario file; the reader knows it by the tables of the file."""

    TENSION = "tension of one tendon"
    JOINT = "driven joint"
    FINGER = "several driven joints"
