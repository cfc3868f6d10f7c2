"""Measured files: reading, cleaning, units, smoothing."""
