"""Scenario files of driven joints, one or several."""
