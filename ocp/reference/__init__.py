"""References derived from the given one: of a motion of the load, with kept holds."""
