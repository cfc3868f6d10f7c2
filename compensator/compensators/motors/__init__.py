"""Motors of driven joints: what is asked of them, by whom, and what a mechanism does."""
