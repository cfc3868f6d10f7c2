"""A scenario as a problem of optimal control that users extend."""
