"""What a fit takes for granted, the cells' gains and kept values, widens its intervals by what is stated of it."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenarios import load_scenario
from tests.compensator.identification.test_fitted import STEP, strokes

pytestmark = pytest.mark.compiler

GAIN = 1.02


@pytest.fixture(scope="module")
def rig(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def log(rig, tmp_path_factory):
    """The far cell reads 2 % too much."""
    file = tmp_path_factory.mktemp("gain") / "a.csv"
    write_synthetic(file, rig.transmission, *strokes(5), Faults(noise=0.002, seed=1), step_s=STEP, positions=False)
    head, *rows = file.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    at = head.split(",").index("output_tension_N")
    for row in cells:
        row[at] = f"{GAIN * float(row[at]):.9g}" if row[at] else ""
    file.write_text("\n".join([head, *(",".join(row) for row in cells)]) + "\n")
    return file


@pytest.fixture(scope="module")
def silent(rig, log):
    """Fits without a doubt stated, each made once."""
    return functools.cache(lambda static_only: found(rig, log, static_only=static_only))


def found(rig, log, *, static_only=False, **doubts):
    return identify(replace(rig, measurement=replace(rig.measurement, **doubts)), [log], static_only=static_only)


@pytest.mark.parametrize("static_only", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_a_gain_that_is_off_is_in_the_intervals_once_its_doubt_is_said(rig, log, silent, static_only):
    """The ratio of the gains is added to one exponent and taken off the other: half of it at least, in mu theta."""
    said = found(rig, log, static_only=static_only, gain_uncertainty=0.03)
    for name in ("mu_dynamic", "mu_dynamic_release"):
        low, high = said.estimate(name).interval
        assert low <= rig.transmission.friction.mu_dynamic <= high, name
    assert np.ptp(said.estimate("mu_theta").interval) > np.ptp(silent(static_only).estimate("mu_theta").interval)


@pytest.mark.nightly
def test_a_kept_value_in_doubt_widens_the_bristle(rig, log, silent):
    """Kept values are in doubt by default."""
    said, exact = silent(False), found(rig, log, kept_uncertainty=0.0)
    widths = [np.ptp(one.estimate("soft_bristle_stiffness_N_per_m").interval) for one in (said, exact)]
    assert widths[0] > widths[1]
    assert said.estimate("stiffness_N_per_m").value == rig.transmission.tendon.stiffness_N_per_m
