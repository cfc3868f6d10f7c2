"""Scenarios with a driven joint."""
