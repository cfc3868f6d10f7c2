"""References that are derived from the wanted one: of a motion of the load, with kept holds."""
