"""The command line `tendonff`."""
