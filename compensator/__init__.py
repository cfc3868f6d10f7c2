"""User-facing layer: scenarios, designs, tables, reports, the command line."""

# A bare `compensator` on sys.path would be a second copy with its own enums and exceptions.
if __name__ != "tendonff.compensator":
    raise ImportError(
        f"import this package as tendonff.compensator, not as {__name__}; install it with 'pip install .'"
    )
