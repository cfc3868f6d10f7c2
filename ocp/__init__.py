"""Problems over a horizon: simulation, exact inverse, optimal control."""

# A bare `ocp` on sys.path would be a second copy with its own enums and exceptions.
if __name__ != "tendonff.ocp":
    raise ImportError(f"import this package as tendonff.ocp, not as {__name__}; install it with 'pip install .'")
