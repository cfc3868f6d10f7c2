"""Real type of generated C; apart from the printer, because the command line imports it."""

from enum import StrEnum


class Precision(StrEnum):
    """Real type of generated C, by its name there."""

    DOUBLE = "double"
    FLOAT = "float"
