"""Urgency of a warning: a plain text asks for action; what is dangerous comes first, what is only to be known last."""

from collections.abc import Iterable


class Danger(str):
    """Warning of what may do harm on the rig, or of a drive that cannot do what is asked."""

    __slots__ = ()


class Remark(str):
    """Warning that asks for no action."""

    __slots__ = ()


def by_urgency(warnings: Iterable[str]) -> tuple[str, ...]:
    """Warnings without repetitions: dangers, those that ask for action, remarks; within each in their order."""
    return tuple(sorted(dict.fromkeys(warnings), key=_rank))


def _rank(warning: str) -> int:
    return 0 if isinstance(warning, Danger) else 2 if isinstance(warning, Remark) else 1
