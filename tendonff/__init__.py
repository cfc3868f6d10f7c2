"""Feedforward friction compensation for tendon and Bowden-cable drives."""
