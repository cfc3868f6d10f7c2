"""Goal of a scenario: which quantities of what are wanted, and in which unit."""

from dataclasses import dataclass

from tendonff.compensator.scenario.unit import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Wanted quantities.

    Attributes
    ----------
    quantity : str
        In words, such as "joint angle".
    unit : Unit
    names : tuple of str
        Of what has a reference: the joints.
    is_named : bool
        Columns and errors carry the names: there may be several.
    """

    quantity: str
    unit: Unit
    names: tuple[str, ...]
    is_named: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the reference."""
        if not self.is_named:
            return (f"reference_{self.unit.key}",)
        return tuple(f"reference_{name}_{self.unit.key}" for name in self.names)

    @property
    def range(self) -> str:
        """The range, in words, that relative errors are a share of."""
        return "the largest joint range" if self.is_named else "range"
