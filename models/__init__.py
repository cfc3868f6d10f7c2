"""Symbolic models of a tendon sliding on a curved path (CasADi, no solver)."""

# A bare `models` on sys.path would be a second copy with its own enums and exceptions.
if __name__ != "tendonff.models":
    raise ImportError(f"import this package as tendonff.models, not as {__name__}; install it with 'pip install .'")
