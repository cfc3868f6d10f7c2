"""Figures and pages, made in one way."""
