"""Identification on a path that moves: joint angles come with the measured file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.fitting.residuals import fit_pieces
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level

SECONDS = 4.0


@pytest.fixture(scope="module")
def finger(examples: Path) -> Scenario:
    """The truth: mu 0.2, soft bristle 2e4 N/m."""
    return load_scenario(examples / "finger_moving.toml")


@pytest.fixture(scope="module")
def log(finger: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Noisy cells, and encoders that scatter by 1 mrad; the joints swing by 1.2 and 0.7 rad."""
    file = tmp_path_factory.mktemp("log") / "finger.csv"
    time = np.arange(0.0, SECONDS, 1e-3)
    fade = np.minimum(time / 0.5, 1)
    force = 40 + fade * (25 * np.sin(2 * np.pi * 0.45 * time) + 8 * np.sin(2 * np.pi * 1.2 * time))
    truth = moved(finger, SECONDS)
    assert truth.motion is not None
    write_synthetic(file, truth, time, force, Faults(noise=0.003), masses=36)
    table = pd.read_csv(file)
    angles = truth.motion.at(table["time_s"].to_numpy())
    angles += np.random.default_rng(1).normal(0, 1e-3, angles.shape)
    table["knuckle_rad"], table["middle_rad"] = angles.T
    table.to_csv(file, index=False)
    return file


@pytest.fixture(scope="module")
def wrong(finger: Scenario) -> Scenario:
    """What one might think before the measurement."""
    friction = replace(
        finger.transmission.friction, mu_dynamic=0.15, mu_static=0.15, soft_bristle_stiffness_N_per_m=3e4
    )
    return replace(finger, transmission=replace(finger.transmission, friction=friction))


@pytest.mark.compiler
@pytest.mark.slow
def test_friction_is_found_on_a_path_that_moves(wrong: Scenario, log: Path) -> None:
    found = identify(wrong, [log])
    assert found.described
    assert found.fit_percent < 0.5
    assert found.estimate("mu_dynamic").value == pytest.approx(0.2, rel=0.02)
    assert found.estimate("soft_bristle_stiffness_N_per_m").value == pytest.approx(2e4, rel=0.1)
    assert found.scenario.transmission.friction.mu_dynamic == pytest.approx(0.2, rel=0.02)


@pytest.mark.compiler
def test_the_chain_of_the_fits_moves_with_the_rows(finger: Scenario, log: Path) -> None:
    """With the angles of the file the true values leave noise; with joints that stand still they leave far more."""
    how, rig = finger.measurement, finger.transmission
    [piece] = fit_pieces([clean(read_measurement(log, how, rig.joints), how)])
    assert piece.drive.motion is not None
    model = ParametricChain(transmission=rig, level=Level.PRESLIDING, count=12)
    still = replace(piece.drive, motion=piece.drive.motion.held(np.zeros(2)))
    moving, resting = (
        float(np.std(piece.off(model.predict(model.values(), drive).output_N))) for drive in (piece.drive, still)
    )
    assert moving < 0.01 * np.ptp(piece.measured)
    assert resting > 10 * moving


def test_a_log_without_the_joints_is_refused_with_the_way_out(wrong: Scenario, log: Path, tmp_path: Path) -> None:
    pd.read_csv(log).drop(columns="middle_rad").to_csv(tmp_path / "short.csv", index=False)
    with pytest.raises(InputError, match=r'column "middle_rad" is missing.*log its angle'):
        identify(wrong, [tmp_path / "short.csv"])
