"""Compensators in a control loop in Python: the exported C, compiled here."""
