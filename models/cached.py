"""Values that are computed once."""

import functools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from functools import cached_property as cached_property  # noqa: PLC0414 - exported
else:

    class cached_property(functools.cached_property):  # noqa: N801 - in its place
        """That of functools, without the lock of Python 3.11.

        One lock for the property of all instances, kept while a value is computed: a thread would wait for it in its
        turn (`models.turns`), and the one that has it for its turn. Two threads may now compute one value, which is
        the same.
        """

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            """Return the value, computed if it is not there yet."""
            if instance is None:
                return self
            if self.attrname not in instance.__dict__:
                instance.__dict__[self.attrname] = self.func(instance)
            return instance.__dict__[self.attrname]
