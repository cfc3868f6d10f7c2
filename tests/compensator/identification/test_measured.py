"""Identification of real measurements: each tests a part of the physics, and the dirt is the measurement's own."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.identification.fitting.sliding import sliding_ratios
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import Branch

TORQUES = Measurement(
    input_column="input_torque_Nm",
    output_column="output_torque_Nm",
    input_position_column="input_angle_rad",
    output_position_column="output_angle_rad",
)


@pytest.fixture(scope="module")
def scenario(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def grasper(scenario, measured_data):
    folder = measured_data / "davinci_tool4"
    fit, judge = (sorted((folder / part).glob("*.csv")) for part in ("identify", "validate"))
    return identify(replace(scenario, measurement=TORQUES), fit, judge)


def test_a_surgical_grasper_is_predicted_over_whole_files_at_loads_not_seen(grasper):
    """Signed torques of a pre-tensioned loop, change-over at the stroke ends included."""
    assert grasper.described
    assert grasper.validation_percent < 2.5
    assert "two bristles" in grasper.law


def test_the_load_that_is_switched_on_at_the_start_is_left_out_with_a_message(grasper):
    onsets = {file.name: f for file in grasper.files for f in file.findings if f.issue is DataIssue.ONSET}
    names = {"06", "26", "46", "03", "09", "23", "29", "43", "49"}  # the others start without a resisting torque
    assert set(onsets) == {f"tool4_{name}.csv" for name in names}
    assert all(40 <= f.count <= 100 for f in onsets.values())  # 0.2 to 0.5 s at 200 Hz
    assert sum("load switched on" in w for w in grasper.warnings) == 1
    assert any("load switched on at the start in 9 files" in w for w in grasper.warnings)


def test_without_the_motion_the_message_names_the_columns_that_were_not_read(scenario, measured_data):
    how = Measurement(input_column="input_torque_Nm", output_column="output_torque_Nm")
    folder = measured_data / "davinci_tool4"
    fit, judge = (sorted((folder / part).glob("*.csv"))[:2] for part in ("identify", "validate"))
    found = identify(replace(scenario, measurement=how), fit, judge, static_only=True)
    assert not found.described
    assert found.as_json()["status"] == "no law explains the files"
    [message] = [w for w in found.warnings if "no law explains" in w]
    assert "--input-position-column" in message
    assert "columns not read: input_angle_rad, motor_current_A, output_angle_rad" in message


def test_its_friction_is_that_of_a_pre_tensioned_loop_alike_in_both_directions(grasper):
    theta = grasper.scenario.transmission.path.total_angle_rad
    assert grasper.law.startswith("symmetric with load-independent friction, presliding")
    assert grasper.estimate("mu_dynamic").value * theta == pytest.approx(0.35, abs=0.02)
    assert grasper.estimate("adhesion_N").value == pytest.approx(0.117, abs=0.015)
    assert grasper.estimate("input_offset_N").value == pytest.approx(-0.024, abs=0.005)
    assert not grasper.estimate("viscous_N_s_per_m").identifiable


@pytest.mark.usefixtures("unpainted")
def test_the_file_holds_the_law_that_is_reported(grasper, tmp_path):
    """A guide and a second bristle, which no chain has, stand beside the offsets; read again it is the same law."""
    assert grasper.replay_percent == pytest.approx(grasper.fit_percent, rel=1e-9)
    grasper.write(tmp_path / "out")
    how = load_scenario(tmp_path / "out" / "fitted.toml").measurement
    assert how.explain is Explain.INPUT
    assert how.bristle_spread == grasper.estimate("bristle_spread").value > 0
    assert how.guide_stiffness_N_per_m == grasper.estimate("guide_stiffness_N_per_m").value != 0
    [message] = [w for w in grasper.warnings if "they are no part of a design" in w]
    assert message.startswith("guide_stiffness_N_per_m, bristle_spread")


def test_the_plain_capstan_law_is_seen_to_fail_on_it(grasper):
    by_name = {law.name: law.validation_percent for law in grasper.laws}
    assert by_name["symmetric"] > 4 * grasper.validation_percent


def test_one_load_alone_does_not_tell_friction_with_load_from_friction_without(scenario, measured_data):
    files = [measured_data / "davinci_tool4" / "identify" / "tool4_46.csv"]
    found = identify(replace(scenario, measurement=TORQUES), files)
    for name in ("mu_dynamic", "adhesion_N"):
        assert not found.estimate(name).identifiable
        assert "repeat at several loads" in found.estimate(name).why


@pytest.fixture(scope="module")
def band(scenario, measured_data):
    folder = measured_data / "band_capstan"
    return identify(scenario, [folder / "dataset4_harmonic.csv"], [folder / "dataset4_step.csv"])


@pytest.mark.nightly
@pytest.mark.compiler
def test_a_band_driven_by_its_drum_is_recognised_as_no_transmission(band, scenario):
    assert not band.described
    assert any("no law explains these files" in w and "driven" in w for w in band.warnings)
    assert not any(e.identifiable for e in band.estimates)
    assert band.scenario == scenario


@pytest.mark.nightly
@pytest.mark.compiler
def test_an_error_that_says_nothing_is_null_in_the_file(band):
    """Friction of the chain runs to a bound here; its covariance is round-off, 1e10 and more."""
    estimates = band.as_json()["estimates"]
    for name in ("mu_dynamic", "soft_bristle_stiffness_N_per_m"):
        assert estimates[name]["standard_error"] is None
        assert estimates[name]["interval_95"] is None


@pytest.mark.nightly
@pytest.mark.compiler
def test_the_ratios_of_the_band_in_gross_sliding_are_reported_for_each_direction(band):
    pull, release = (next(g for g in band.sliding if g.branch is b) for b in (Branch.PULL, Branch.RELEASE))
    assert pull.log_ratio == pytest.approx(4.2, abs=0.15)
    assert release.log_ratio == pytest.approx(-3.6, abs=0.15)
    assert pull.interval[0] < 4.14 < pull.interval[1]
    assert pull.log_ratio + release.log_ratio > 0.3  # the asymmetry is real
    assert "NaN" not in json.dumps(band.as_json(), allow_nan=False)


def test_a_biased_cell_keeps_one_direction_and_refuses_the_other_with_a_reason(measured_data):
    file = measured_data / "band_capstan" / "dataset1_biased_slack_cell.csv"
    record = clean(read_measurement(file, Measurement()), Measurement())
    [bias] = [f for f in record.findings if f.issue is DataIssue.BIAS]
    assert "zero it without tension" in bias.text
    pull, release = sliding_ratios([record])
    assert pull.log_ratio == pytest.approx(4.34, abs=0.05)
    assert release.log_ratio is None
    assert "cell with an offset" in release.reason


@pytest.mark.nightly
def test_a_seal_has_a_constant_friction_and_hardly_any_that_grows_with_load(scenario, measured_data):
    """The rod is moved, the gas holds: p (e^{mu theta} - 1) is what remains without load."""
    how = Measurement(
        input_column="input_force_N", output_column="output_force_N", skip_s=1.0, explain=Explain.INPUT, cutoff_Hz=10.0
    )
    files = sorted((measured_data / "seal_friction").glob("oring_[17]bar.csv"))
    found = identify(replace(scenario, measurement=how), files)
    theta = found.scenario.transmission.path.total_angle_rad
    grown = np.expm1(found.estimate("mu_dynamic").value * theta)
    assert "load-independent friction" in found.law
    assert grown == pytest.approx(0.0105, abs=0.004)
    assert found.estimate("load_independent_friction_N").value == pytest.approx(
        4.3, abs=0.9
    )  # whole strokes, ends included
    assert not found.estimate("viscous_N_s_per_m").identifiable
