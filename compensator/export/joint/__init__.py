"""Exported C of driven joints: its text, golden vectors, judgement, and the folder."""
