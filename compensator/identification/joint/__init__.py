"""Identification of a joint between tendons from what its motor feels."""
