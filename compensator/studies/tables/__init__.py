"""`tendonff table`: compensation tables."""
