"""Commands that write what a controller runs."""
