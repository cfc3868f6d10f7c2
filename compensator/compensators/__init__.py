"""Compensators: maps from a reference tension to a force, one file each, and the score of a force."""
