"""Readers of measured files: one file here and one line in `registry` for each format."""
