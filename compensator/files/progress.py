"""How long work reports its progress."""

from collections.abc import Callable

Advance = Callable[[int, int], None]
"""Told parts done and parts in all."""


def silent(_done: int, _total: int) -> None:
    """Report to nobody."""
