"""A law: named scalar inputs, named scalar outputs, as CasADi expressions."""

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """One law: named scalar inputs, named scalar outputs.

    Parameters
    ----------
    name, comment : str
        Identifier, and what it computes with source.
    inputs : tuple of ca.SX
        Scalar symbols.
    outputs : dict of str to ca.SX
        Expressions.
    """

    name: str
    comment: str
    inputs: tuple[ca.SX, ...]
    outputs: dict[str, ca.SX]

    def function(self) -> ca.Function:
        """The law as a CasADi function."""
        return ca.Function(
            self.name,
            list(self.inputs),
            list(self.outputs.values()),
            [s.name() for s in self.inputs],
            list(self.outputs),
        )
