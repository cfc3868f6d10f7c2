"""`tendonff experiment`: the paper's ten-state test on two motors."""
