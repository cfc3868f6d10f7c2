"""Identification of a transmission's parameters from measured tensions (and positions) at both ends."""
