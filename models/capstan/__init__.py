"""The static capstan law: with one driven end, with two, and with slip that sets in gradually."""

from tendonff.models.capstan.law import (
    NO_JOINTS,
    Branch,
    CapstanLaw,
    ExponentLine,
    behind_drive_N,
    exponent_lines,
    held_within,
    section_exponents,
)

__all__ = [
    "NO_JOINTS",
    "Branch",
    "CapstanLaw",
    "ExponentLine",
    "behind_drive_N",
    "exponent_lines",
    "held_within",
    "section_exponents",
]
