"""Measured files as they come: nothing wrong with them goes unseen, nothing is repaired silently."""

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.identification.measured.smoothing import adaptive_low_pass, noise_of
from tendonff.compensator.scenario.measurement import Measurement

HOW = Measurement()
STEP = 1e-3


def rows(seconds=4.0, noise=0.02):
    time = np.arange(0, seconds, STEP)
    rng = np.random.default_rng(0)
    u = 40 + 15 * np.sin(3 * time) + noise * rng.standard_normal(len(time))
    y = 30 + 8 * np.sin(3 * time - 0.3) + noise * rng.standard_normal(len(time))
    return np.column_stack([time, u, y])


def record(tmp_path, table, how=HOW, header="time_s,input_tension_N,output_tension_N"):
    path = tmp_path / "rig.csv"
    lines = [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in table]
    path.write_text("\n".join([header, *lines]) + "\n")
    return clean(read_measurement(path, how), how)


def kinds(found):
    return {f.issue for f in found.findings}


def test_a_clean_file_has_no_findings(tmp_path):
    found = record(tmp_path, rows())
    assert found.findings == ()
    assert found.step_s == pytest.approx(STEP)
    assert found.output_noise_N == pytest.approx(0.02, rel=0.1)


def test_missing_values_are_counted_with_their_times(tmp_path):
    table = rows()
    table[[100, 2000], 1] = np.nan
    [finding] = record(tmp_path, table).findings[:1]
    assert (finding.issue, finding.count) == (DataIssue.MISSING, 2)
    assert finding.times_s == pytest.approx((0.1, 2.0))


def test_a_file_of_simulate_has_its_ends_first_and_last(tmp_path):
    """Named explicitly by no option: tension_1_N is at the actuator."""
    time, near, far = rows().T
    moved = 1e-4 * near
    table = np.column_stack([time, near + 1, near, far + 5, far, moved])
    header = "time_s,force_N,tension_1_N,tension_2_N,tension_10_N,actuator_position_m"
    found = record(tmp_path, table, header=header)
    assert found.joined("input_N")[100] == pytest.approx(near[100], rel=5e-3)
    assert found.joined("output_N")[100] == pytest.approx(far[100], rel=5e-3)
    assert found.joined("input_m")[100] == pytest.approx(moved[100], rel=5e-3)
    assert any('output "tension_10_N"' in each.text for each in found.findings)


def test_repeated_and_disordered_time_stamps_are_told_apart(tmp_path):
    table = rows()
    table[500, 0] = table[499, 0]
    table[[1000, 1001], 0] = table[[1001, 1000], 0]
    found = record(tmp_path, table)
    assert {DataIssue.DUPLICATE, DataIssue.OUT_OF_ORDER} <= kinds(found)


def test_a_clock_that_jumps_back_starts_a_new_piece(tmp_path):
    table = rows()
    table[2000:, 0] -= 1.5
    found = record(tmp_path, table)
    assert DataIssue.CLOCK_JUMP in kinds(found)
    assert len(found.pieces) == 2
    assert np.all(np.diff(np.concatenate([p.time_s for p in found.pieces])) > 0)


@pytest.mark.parametrize(("gap_rows", "pieces"), [(5, 1), (300, 1), (1500, 2)])
def test_short_gaps_are_bridged_but_not_fitted_and_long_ones_split(tmp_path, gap_rows, pieces):
    table = np.delete(rows(8.0), slice(3000, 3000 + gap_rows), axis=0)
    found = record(tmp_path, table)
    assert DataIssue.GAP in kinds(found)
    assert len(found.pieces) == pieces
    bridged = sum(int((~p.good).sum()) for p in found.pieces)
    assert (bridged >= gap_rows) == (pieces == 1)
    if pieces == 1:  # the bridge follows the signal's curve
        piece = found.pieces[0]
        assert np.abs(piece.input_N - (40 + 15 * np.sin(3 * piece.time_s)))[3000 : 3000 + gap_rows].max() < 0.3


def test_spikes_are_replaced_and_not_fitted(tmp_path):
    table = rows()
    table[[700, 2500], 2] += [9.0, -12.0]
    found = record(tmp_path, table)
    [finding] = [f for f in found.findings if f.issue is DataIssue.SPIKE]
    assert (finding.count, finding.times_s) == (2, pytest.approx((0.7, 2.5)))
    piece = found.pieces[0]
    assert not piece.good[[700, 2500]].any()
    assert abs(piece.output_N[700] - (30 + 8 * np.sin(3 * 0.7 - 0.3))) < 0.2


def test_a_reversal_and_a_step_are_not_spikes(tmp_path):
    table = rows()
    table[2000:, 1] += 20.0
    assert DataIssue.SPIKE not in kinds(record(tmp_path, table))


def test_readings_slightly_below_zero_are_slack_and_far_below_are_signed_data(tmp_path):
    slack = rows()
    slack[:, 2] -= slack[:, 2].min() + 0.2
    found = record(tmp_path, slack)
    assert DataIssue.NEGATIVE in kinds(found)
    assert not found.signed
    loop = rows()
    loop[:, 1] -= 45
    assert record(tmp_path, loop).signed


def test_a_cell_that_reads_below_zero_for_long_is_called_biased(tmp_path):
    table = rows()
    table[:, 2] = np.maximum(table[:, 2] - 30, -0.1)
    found = record(tmp_path, table)
    [finding] = [f for f in found.findings if f.issue is DataIssue.BIAS]
    assert "zero it without tension" in finding.text


def test_other_names_and_units_give_the_same_record(tmp_path):
    table = rows()
    expected = record(tmp_path, table)
    how = Measurement(
        time_column="t_ms", input_column="in_kgf", output_column="out", time_scale=1e-3, input_scale=9.80665
    )
    other = table.copy()
    other[:, 0] *= 1e3
    other[:, 1] /= 9.80665
    found = record(tmp_path, other, how, "t_ms,in_kgf,out")
    np.testing.assert_allclose(found.pieces[0].input_N, expected.pieces[0].input_N, rtol=1e-6)


def test_a_missing_column_is_named_with_the_option_that_helps(tmp_path):
    with pytest.raises(InputError, match=r'column "input_tension_N" is missing.*--input-column'):
        record(tmp_path, rows(), header="time_s,force,output_tension_N")


def test_too_few_rows_are_refused_with_what_went_wrong(tmp_path):
    table = rows(0.02)
    table[5:, 2] = np.nan
    with pytest.raises(InputError, match="5 usable rows of 20; at least 10 are needed"):
        record(tmp_path, table)


@pytest.mark.parametrize(("column", "name"), [(1, "input_tension_N"), (2, "output_tension_N")])
def test_a_tension_that_never_moves_is_refused(tmp_path, column, name):
    table = rows()
    table[:, column] = 30.0
    with pytest.raises(InputError, match=rf"{name} is 30 N in all \d+ usable rows"):
        record(tmp_path, table)


def test_what_drives_the_model_is_smoothed_most_where_nothing_happens():
    """A friction model remembers every extreme: noise in a hold must go, a corner must stay."""
    time = np.arange(0, 6, STEP)
    truth = np.interp(time, [0, 2, 2.4, 6], [20, 20, 60, 60])
    x = truth + 0.2 * np.random.default_rng(3).standard_normal(len(time))
    left = np.abs(adaptive_low_pass(x, STEP) - truth)
    assert noise_of(x) == pytest.approx(0.2, rel=0.05)
    assert left[4000:5500].max() < 0.03
    assert left[1900:2500].max() < 1.0


def test_rows_with_too_many_cells_are_counted_wherever_they_stand_and_empty_last_cells_are_not(tmp_path):
    lines = [f"{0.01 * k:.2f},{30 + 0.1 * k:.2f},{20 + 0.1 * k:.2f}" for k in range(200)]
    lines[0] += ",7"
    lines[50] += ",1,2"
    lines[80] += ","
    file = tmp_path / "long.csv"
    file.write_text("\n".join(["time_s,input_tension_N,output_tension_N", *lines]) + "\n")
    raw = read_measurement(file, HOW)
    assert [(f.issue, f.count) for f in raw.findings if f.issue is DataIssue.LONG] == [(DataIssue.LONG, 2)]
    assert len(raw.time_s) == 198
    assert 0.8 in raw.time_s.round(6)
