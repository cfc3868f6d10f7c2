"""Exported C of fingers: its text, golden vectors, judgement, and the folder."""
