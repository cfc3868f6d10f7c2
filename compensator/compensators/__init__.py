"""Compensators: ways from a wanted tension to a force, one file each, and how well a force does."""
