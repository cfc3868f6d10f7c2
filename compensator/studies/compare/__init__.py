"""`tendonff compare`: fidelity levels against each other and the capstan law."""
