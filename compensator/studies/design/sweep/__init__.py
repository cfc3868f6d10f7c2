"""`tendonff sweep`: designs and scores over a grid of parameters, or over units that differ."""
