"""`tendonff adapt`: the self-tuning compensator on plants that differ from the scenario."""
