"""Design of a joint: what its compensators achieve, and the report."""
