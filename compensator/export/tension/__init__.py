"""Self test of a tension's modules."""
