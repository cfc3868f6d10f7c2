"""What can go wrong when a model is built: one exception per cause."""


class TendonffError(Exception):
    """Base of every error that tendonff raises on purpose; its text is meant for the user."""


class ParameterError(TendonffError, ValueError):
    """A physical parameter or an argument lies outside the range in which the model means anything."""
