"""Implicit time step: scheme, laws, engines."""
