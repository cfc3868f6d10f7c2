"""Exports: C for controllers and FMUs for simulators, printed from the same laws as everything else."""
