"""Optimal control: the force profile within limits that tracks a reference."""
