"""Simulation and inversion of a tendon over a horizon."""
