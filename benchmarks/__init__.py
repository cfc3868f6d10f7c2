"""Studies that take long, and comparisons with other programs: run from a checkout."""
