"""Feedback beside the feedforward: its law, its loop linearised along a motion, its gains, and its simulation."""
