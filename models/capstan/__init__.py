"""The static capstan law: with one driven end, with two, and with slip that sets in gradually."""

from tendonff.models.capstan.law import Branch, CapstanLaw, held_within, section_exponents

__all__ = ["Branch", "CapstanLaw", "held_within", "section_exponents"]
