"""`tendonff explore`: an interactive page."""
