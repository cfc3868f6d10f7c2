"""Wrap angles from the measured points of a centreline: `tendonff path`."""
