"""The optional tables of a scenario file, one module each, every key with a safe default."""
