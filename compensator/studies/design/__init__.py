"""`tendonff design`: the force profile, and what it delivers."""
