"""All compensators, in the order in which they are shown."""

from collections.abc import Sequence

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.closed_form import Capstan, Frictionless, Inverse, Uncompensated
from tendonff.compensator.compensators.optimal import Optimal
from tendonff.compensator.compensators.smoothed import Smoothed
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.models.errors import ParameterError

COMPENSATORS: tuple[Compensator, ...] = (
    Uncompensated(),
    Frictionless(),
    Capstan(),
    Smoothed(),
    Inverse(),
    Optimal(),
    CompensationTable(),
)
"""Everything that `design` and `compare` try; a further compensator is one more line here."""


def compensator(name: str) -> Compensator:
    """The compensator of a name, as in the files: "inverse"; InputError if there is none."""
    for each in COMPENSATORS:
        if each.name == name:
            return each
    raise InputError(f'there is no compensator "{name}"{suggestion(name, [c.name for c in COMPENSATORS])}')


def chosen(given: Sequence[Compensator | str]) -> tuple[Compensator, ...]:
    """Compensators of a tension, given by themselves or by name; InputError for others."""
    found = tuple(compensator(each) if isinstance(each, str) else each for each in given)
    for each in found:
        if not isinstance(each, Compensator):
            raise InputError(f"{each} is no compensator of a tension; {', '.join(c.name for c in COMPENSATORS)} are")
        if not isinstance(getattr(each, "name", None), str):
            raise ParameterError(f'{type(each).__name__} has no name; write name = "mine" in the class')
    return found
