"""Least-squares fits of static law, elongation and chain."""
