"""Zero of the cells."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.preparation import slack_rows
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.errors import ParameterError

STEP = 2e-3
TIME = np.arange(0, 12, STEP)
PULLED = np.maximum(30 * np.sin(2 * np.pi * 0.4 * TIME), 0.0)
NOISE = np.random.default_rng(1).standard_normal((2, len(TIME)))


def play(tension, exponent=0.4):
    out, memory = np.empty_like(tension), tension[0]
    for k, t in enumerate(tension):
        out[k] = memory = min(max(memory, t * np.exp(-exponent)), t * np.exp(exponent))
    return out


def log(path, offsets=(0.0, 0.0), lift=0.0, noise=0.02):
    tension = PULLED + lift
    write_csv(
        path,
        {
            "time_s": TIME,
            "input_tension_N": tension + offsets[0] + noise * NOISE[0],
            "output_tension_N": play(tension) + offsets[1] + noise * NOISE[1],
        },
    )
    return path


@pytest.mark.parametrize("offsets", [(0.4, -0.3), (-0.2, 0.4)])
def test_offsets_are_found_from_slack_samples_and_said(tmp_path, offsets):
    found = read_measurement(log(tmp_path / "a.csv", offsets), Measurement())
    [finding] = [f for f in found.findings if f.issue is DataIssue.OFFSET]
    assert "read as a slack tendon; --offset 0 keeps the readings" in finding.text
    slack = PULLED == 0
    assert found.input_N[slack].mean() == pytest.approx(0.0, abs=0.01)
    assert found.output_N[slack].mean() == pytest.approx(0.0, abs=0.01)


def test_offsets_that_are_given_are_taken_and_nothing_is_looked_for(tmp_path):
    file = log(tmp_path / "a.csv", (0.4, 0.2))
    kept = read_measurement(file, Measurement(input_offset_N=0.0, output_offset_N=0.0))
    assert kept.input_N[PULLED == 0].mean() == pytest.approx(0.4, abs=0.01)
    assert not [f for f in kept.findings if f.issue is DataIssue.OFFSET]
    taken = read_measurement(file, Measurement(output_offset_N=0.5))
    np.testing.assert_allclose(taken.output_N, kept.output_N - 0.5, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(taken.input_N, kept.input_N, rtol=1e-9, atol=1e-9)


def test_a_tare_sets_both_cells_to_zero_over_a_time(tmp_path):
    """Half a period of this file is slack, from 1.25 to 2.5 s."""
    found = read_measurement(log(tmp_path / "a.csv", (3.0, -2.0)), Measurement(tare_s=(1.4, 2.4)))
    rows = (TIME > 1.4) & (TIME < 2.4)
    assert found.input_N[rows].mean() == pytest.approx(0.0, abs=0.01)
    assert found.output_N[rows].mean() == pytest.approx(0.0, abs=0.01)
    with pytest.raises(InputError, match="give --tare a longer time"):
        read_measurement(tmp_path / "a.csv", Measurement(tare_s=(40.0, 41.0)))
    with pytest.raises(ParameterError, match="tare_s must be from and to"):
        Measurement(tare_s=(2.0, 1.0))


def test_a_hold_at_low_tension_is_not_slack():
    """The lowest tension is held for long, and it is a tension: 2.5 N of 32."""
    tension = PULLED + 2.5
    assert slack_rows(tension + 0.02 * NOISE[0], play(tension) + 0.02 * NOISE[1]) is None


def test_a_tendon_that_is_never_slack_has_no_zero():
    tension = 20 + 10 * np.sin(2 * np.pi * 0.4 * TIME)
    assert slack_rows(tension, play(tension)) is None


def test_scatter_around_zero_while_slack_is_no_biased_cell(tmp_path):
    """A fifth of the samples lies 0.1 % of the range below zero."""
    record = clean(read_measurement(log(tmp_path / "a.csv", (0, 0), noise=0.03), Measurement()), Measurement())
    assert not [f for f in record.findings if f.issue is DataIssue.BIAS]
    kept = replace(Measurement(), input_offset_N=0.0, output_offset_N=0.0)
    below = clean(read_measurement(log(tmp_path / "a.csv", (-0.03, -0.03)), kept), kept)
    assert [f.issue for f in below.findings if f.issue is DataIssue.BIAS] == []
    assert any(f.issue is DataIssue.NEGATIVE for f in below.findings)
