"""Studies of a scenario, one folder for each command that answers with a report."""
