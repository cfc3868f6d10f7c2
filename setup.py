"""Package discovery, the one thing that pyproject.toml cannot say for folders that map to `tendonff.*`."""

from setuptools import find_packages, setup

TOP = ("models", "ocp", "compensator")

setup(packages=[f"tendonff.{name}" for top in TOP for name in (top, *(f"{top}.{sub}" for sub in find_packages(top)))])
