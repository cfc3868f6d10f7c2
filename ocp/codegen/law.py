"""A law: named scalar inputs, named scalar outputs, as CasADi expressions."""

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """One law: named scalar inputs, named scalar outputs."""

    # name, comment: identifier, and what it computes with source
    name: str
    comment: str
    inputs: tuple[ca.SX, ...]  # scalar symbols
    outputs: dict[str, ca.SX]  # expressions

    def function(self) -> ca.Function:
        """The law as a CasADi function."""
        return ca.Function(self.name, [*self.inputs], [*self.outputs.values()])
