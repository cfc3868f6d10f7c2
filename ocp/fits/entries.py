"""Names that carry what is particular to them: the entries of the lists of numbers that fits look for."""

from typing import Generic, Self, TypeVar

S = TypeVar("S")


class Entry(str, Generic[S]):
    """A name, of an estimate and in files, with what is particular to it; mixed into an enumeration."""

    __slots__ = ("spec",)

    spec: S

    def __new__(cls, name: str, spec: S | None = None) -> Self:
        """The name alone where the enumeration looks it up."""
        member = str.__new__(cls, name)
        if spec is not None:
            member.spec = spec
        return member
