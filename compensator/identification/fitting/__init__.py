"""Fits to cleaned measurements: static law, tendon, chain, and the choice between laws."""
