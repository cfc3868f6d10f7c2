"""All compensators, in the order in which they are shown."""

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.closed_form import Capstan, Frictionless, Inverse, Uncompensated
from tendonff.compensator.compensators.optimal import Optimal
from tendonff.compensator.compensators.smoothed import Smoothed
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.files.reading import InputError, suggestion

COMPENSATORS: tuple[Compensator, ...] = (
    Uncompensated(),
    Frictionless(),
    Capstan(),
    Smoothed(),
    Inverse(),
    Optimal(),
    CompensationTable(),
)
"""Everything that `design` and `compare` try; a further one is one more line here, whatever kinds it is for."""


def known() -> tuple[Compensator, ...]:
    """All of them."""
    return COMPENSATORS


def compensator(name: str) -> Compensator:
    """The compensator of a name, as in the files: "inverse"; InputError if there is none."""
    for each in COMPENSATORS:
        if each.name == name:
            return each
    raise InputError(f'there is no compensator "{name}"{suggestion(name, [c.name for c in COMPENSATORS])}')
