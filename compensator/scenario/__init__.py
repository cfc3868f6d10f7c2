"""Scenario files: their tables, their checks, and the sampled reference."""
