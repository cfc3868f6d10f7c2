"""Commands that read what a rig measured."""
