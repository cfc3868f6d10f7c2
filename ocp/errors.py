"""Exceptions of problems over a horizon, one per cause."""

from tendonff.models.errors import TendonffError


class SolveError(TendonffError, RuntimeError):
    """A computation ended without the requested result; the text is its diagnosis."""


class CodeError(TendonffError, RuntimeError):
    """C code could not be generated, compiled or loaded."""
