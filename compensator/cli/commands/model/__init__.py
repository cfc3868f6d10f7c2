"""Commands that describe and simulate."""
