"""Fits to cleaned measurements: capstan law, tendon, chain, and the choice between laws."""
