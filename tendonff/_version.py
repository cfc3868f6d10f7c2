"""The version, stated here once: the build, the command line and everything that is written take it from here."""

__version__ = "0.4.0"
