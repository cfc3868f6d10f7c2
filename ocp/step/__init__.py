"""One implicit time step: scheme, laws, engines."""
