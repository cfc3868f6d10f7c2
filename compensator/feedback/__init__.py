"""Feedback beside the feedforward: its design, its page, and its module on a controller."""
