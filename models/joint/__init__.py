"""A joint on tendons: its data, what holds it in balance, and the quasi-static law of a loop."""
