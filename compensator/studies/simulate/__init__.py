"""`tendonff simulate`: the response to a force file."""
