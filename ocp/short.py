"""Short `repr` of a result of many rows."""

from tendonff.ocp.step.protocol import Array


def rows_in_short(result: object, outcome: str, time_s: Array) -> str:
    """`repr` of a simulation: how it ended, and its rows."""
    return f"<{type(result).__name__} {outcome}: {len(time_s)} rows to {time_s[-1] if len(time_s) else 0:g} s>"
