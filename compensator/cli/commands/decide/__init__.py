"""Commands that choose a compensator."""
