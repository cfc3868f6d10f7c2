"""Options of a call as enumerations that a string stands for."""

from enum import StrEnum
from typing import Never

from tendonff.models.errors import ParameterError


class Choice(StrEnum):
    """Enumeration that refuses other strings by `ParameterError`, with those there are."""

    @classmethod
    def _missing_(cls, value: object) -> Never:
        known = ", ".join(f'"{each}"' for each in cls)
        given = f'"{value}"' if isinstance(value, str) else repr(value)
        raise ParameterError(f"{cls.__name__} must be one of {known}, got {given}")
