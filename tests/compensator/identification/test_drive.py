"""The drive's own friction, identified from its force, the tension at its end and its position."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.answer import estimate as estimates
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.drive import drive_estimates
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.outcome import with_drive
from tendonff.compensator.scenarios import load_scenario
from tests.independent_plant import respond

COULOMB, STEP = 4.0, 2e-3


@pytest.fixture(scope="module")
def rig(examples):
    return load_scenario(examples / "finger.toml")


def logged(rig, file, **drive):
    """Strokes at several loads on an independent plant, with the noise of cells and encoder."""
    time = np.arange(0, 3, STEP)
    force = (
        45 + 25 * np.sin(2 * np.pi * 0.6 * time) * np.minimum(time, 1) + 8 * np.sin(2 * np.pi * 1.7 * time) * (time > 1)
    )
    t = rig.transmission
    rubbing = replace(t, actuator=replace(t.actuator, **drive))
    seen = respond(rubbing, time, force, 45.0, masses=4)
    noise = np.random.default_rng(3)
    columns = {
        "time_s": time,
        "input_tension_N": seen.input_N + noise.normal(0, 0.05, len(time)),
        "output_tension_N": seen.output_N + noise.normal(0, 0.05, len(time)),
        "input_position_m": seen.actuator_m + noise.normal(0, 2e-6, len(time)),
        "actuator_force_N": force + 0.8 + noise.normal(0, 0.1, len(time)),
    }
    write_csv(file, columns)
    return file


@pytest.fixture(scope="module")
def measured(rig, tmp_path_factory):
    return logged(rig, tmp_path_factory.mktemp("drive") / "strokes.csv", coulomb_N=COULOMB)


def test_the_friction_of_the_drive_is_told_and_goes_into_the_fitted_scenario(rig, measured, record_property):
    found = identify(rig, [measured], static_only=True)
    estimate = found.estimate("coulomb_N")
    record_property(
        "figure", f"coulomb_N of 4 N on an independent plant: {estimate.value:.4g} +- {estimate.standard_error:.2g} N"
    )
    assert estimate.identifiable
    assert estimate.value == pytest.approx(COULOMB, rel=0.03)
    assert "offset of 0.8" in estimate.why
    assert found.scenario.transmission.actuator.coulomb_N == estimate.value
    assert found.as_json()["estimates"]["coulomb_N"]["identifiable"]


def test_without_the_position_or_the_force_it_is_not_told(rig, measured):
    blind = replace(rig, measurement=replace(rig.measurement, input_position_column="none"))
    estimate = identify(blind, [measured], static_only=True).estimate("coulomb_N")
    assert not estimate.identifiable
    assert "name it with --input-position-column" in estimate.why
    assert estimate.value == 0
    unforced = replace(rig, measurement=replace(rig.measurement, actuator_force_column="none"))
    names = [e.name for e in identify(unforced, [measured], static_only=True).estimates]
    assert "coulomb_N" not in names


def test_the_drive_s_friction_is_known_from_the_same_error_on_as_every_other_value(rig, measured, monkeypatch):
    raw = [read_measurement(measured, rig.measurement, ())]
    (estimate,) = drive_estimates(rig, raw)
    assert estimate.identifiable
    assert estimates.is_known(estimate.standard_error, estimate.value)
    stricter = replace(TUNED, identifiable_share=0.9 * estimate.standard_error / estimate.value)
    monkeypatch.setattr(estimates, "TUNED", stricter)
    assert not drive_estimates(rig, raw)[0].identifiable
    assert not estimates.is_known(np.nan, 1.0)


def test_a_gear_that_loses_a_share_is_told_from_constant_friction(rig, tmp_path, record_property):
    file = logged(rig, tmp_path / "geared.csv", coulomb_N=1.0, gear_efficiency=0.85)
    rest, estimate = drive_estimates(rig, [read_measurement(file, rig.measurement, ())])
    record_property(
        "figure", f"gear_efficiency of 0.85 told as {estimate.value:.4f}, coulomb_N of 1 N as {rest.value:.3g}"
    )
    assert estimate.value == pytest.approx(0.85, abs=0.01)
    assert rest.value + (1 - estimate.value) * 45 == pytest.approx(1.0 + 0.15 * 45, rel=0.02)
    fitted = with_drive(rig, (rest, estimate)).transmission.actuator
    assert (fitted.gear_efficiency, fitted.coulomb_N) == (estimate.value, rest.value)
