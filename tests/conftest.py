"""Shared by all tests."""

import os
from pathlib import Path

import matplotlib as mpl
import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]

mpl.use("Agg")

# A failure prints what reproduces it; no deadline, for machines differ in speed; the same examples on every run, so
# that a red build is a change of the code.
settings.register_profile(
    "tendonff", print_blob=True, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tendonff")


@pytest.fixture(scope="session")
def examples() -> Path:
    """Folder of the example scenarios."""
    return ROOT / "examples"


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """Folder of the measured data, which is not part of the repository; skips where it is absent."""
    folder = Path(os.environ.get("TENDONFF_DATA") or ROOT.parent / "shared" / "data")
    if not (folder / "band_capstan").is_dir():
        pytest.skip("measured data not found; set TENDONFF_DATA to its folder")
    return folder
