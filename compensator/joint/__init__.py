"""Driven joints: scenario, design, report and command line of a joint between tendons."""
