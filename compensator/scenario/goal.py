"""Goal of a scenario: which quantities of what are wanted, and in which unit."""

from dataclasses import dataclass

from tendonff.compensator.scenario.unit import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """Quantity that a drive is given, as figures show it.

    Attributes
    ----------
    title, label : str
        Over a figure, and at its axis, with the unit.
    loop : str
        Title of the figure of both against each other.
    is_ordinate : bool
        There it is drawn over the output.
    """

    title: str
    label: str
    loop: str
    is_ordinate: bool = False


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

    @property
    def each(self) -> tuple[str, ...]:
        """Names that errors carry, one by one; none where there is one goal."""
        return self.names if self.is_named else ()

    @property
    def title(self) -> str:
        """Of a figure of what is reached."""
        return self.quantity.capitalize() + "s" * self.is_named

    @property
    def label(self) -> str:
        """At its axis; several goals are counted from the middle of the range of each."""
        return f"{'angle about mid-range' if self.is_named else self.quantity} [{self.unit.shown}]"

    @property
    def time_label(self) -> str:
        """At the axis of time, on which several goals follow one another."""
        return f"time, joint after joint ({', '.join(self.names)}) [s]" if self.is_named else "time [s]"
