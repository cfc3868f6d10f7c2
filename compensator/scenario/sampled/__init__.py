"""References and motions on the grid of a run."""
