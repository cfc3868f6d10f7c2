"""Least-squares fits of capstan law, elongation and chain."""
