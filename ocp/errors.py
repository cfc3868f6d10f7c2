"""What can go wrong when a problem over a horizon is posed or solved: one exception per cause."""

from tendonff.models.errors import TendonffError


class SolveError(TendonffError, RuntimeError):
    """A computation ended without the result that was asked for; the text is its diagnosis."""


class CodeError(TendonffError, RuntimeError):
    """C code could not be generated, compiled or loaded."""
