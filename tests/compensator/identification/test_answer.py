"""What the user reads: the headline, the command that reproduces it, and one value beside its own interval."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.answer.estimate import Estimate, reasons_of
from tendonff.compensator.identification.answer.messages import about_issues
from tendonff.compensator.identification.answer.records import Channel, shown
from tendonff.compensator.identification.answer.report import identification_report
from tendonff.compensator.identification.answer.result import crosstalk_shares, headline
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.reading import DataIssue, Finding
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw

STORED = Path(__file__).parents[2] / "golden" / "stored"


@pytest.fixture(scope="module")
def finger(examples):
    found = load_scenario(examples / "finger.toml")
    return replace(found, measurement=replace(found.measurement, cutoff_Hz=12.0))


def log(path, *, output_offset_N=0.0, twist=0.0):
    time = np.arange(0.0, 20.0, 0.01)
    force = 42 - 26 * np.cos(2.0 * time) + 10 * np.sin(0.71 * time)
    output = CapstanLaw(pull_exponent=0.5, release_exponent=0.45).output_history_N(force)
    noise = np.random.default_rng(0).normal(0, 0.02, (2, len(time)))
    read = output + output_offset_N + twist * np.sin(31 * time) * np.ptp(output)
    write_csv(path, {"time_s": time, "input_tension_N": force + noise[0], "output_tension_N": read + noise[1]})
    return path


@pytest.fixture(scope="module")
def found(finger, tmp_path_factory):
    file = log(tmp_path_factory.mktemp("a") / "run 1.csv", output_offset_N=1.0)
    return identify(finger, [file], static_only=True)


def test_the_headline_has_friction_error_and_the_next_command(found):
    line = headline(found, "fit")
    assert re.match(r"mu = 0\.1\d+ pulling, 0\.1\d+ releasing \(\+-[\d.]+ %\); the model explains the log to", line)
    assert line.endswith("Next: tendonff design fit/fitted.toml")
    assert found.lines("fit")[0] == line
    assert identification_report(found, {}).summary.startswith(headline(found))


def test_a_log_that_does_not_show_mu_is_followed_by_the_measurement_that_does(found):
    """A design would rest on the scenario's value."""
    why = "its standard error would be 90 %; repeat with full strokes in both directions at several loads"
    lost = {
        name: replace(found.estimate(name), identifiable=False, interval=None, why=why)
        for name in ("mu_dynamic", "mu_dynamic_release")
    }
    blind = replace(found, estimates=tuple(lost.get(e.name, e) for e in found.estimates))
    line = headline(blind, "fit")
    assert (
        "Next: run fit/suggested_force.csv on the rig and log both tensions (repeat with full strokes in both" in line
    )
    assert "tendonff design" not in line
    assert "in N (--scale)" in headline(replace(blind, suggests=False))
    assert "Next: drive the near end alone" in headline(replace(blind, described=False))


def test_crosstalk_is_said_with_what_it_does_to_either_direction(found):
    """The ratio of the tensions while the tendon slides, by the law itself."""
    law, force = CapstanLaw(pull_exponent=0.5, release_exponent=0.45), np.array([10.0, 90.0, 20.0])
    ratio = np.log(force / (law.output_history_N(force) + 0.01 * force))
    shares = crosstalk_shares(0.5, 0.45)
    assert (ratio[1] / 0.5 - 1, -ratio[2] / 0.45 - 1) == pytest.approx(shares, rel=1e-9)
    assert shares == pytest.approx((-0.0327, 0.0141), rel=0.01)
    assert sum("3.3 % too small pulling and 1.4 % too large releasing" in line for line in found.lines()) == 1


def test_what_is_not_identifiable_is_one_line(found):
    lines = found.lines()
    assert sum("not identifiable" in line for line in lines) == 1
    assert "stiffness_N_per_m" in found.missing


def test_the_command_that_reproduces_a_fit_asks_what_was_asked(found):
    """Names with blanks survive the shell; what was found is no option."""
    words = shlex.split(identification_report(found, {}).provenance.command)
    assert words[words.index("--data") + 1] == "run 1.csv"
    assert words[words.index("--cutoff") + 1] == "12"
    assert "--offset" not in words


def test_the_error_of_the_file_is_that_of_the_file_read_back(found, finger):
    """The law knows a bias of the cell that the file has not; its own error is larger by that much."""
    how = found.scenario.measurement
    if how.output_offset_N is None and how.input_offset_N is None:
        assert found.replay_percent > found.fit_percent
    again = identify(replace(found.scenario, measurement=how), [found.inputs[0]], static_only=True)
    assert found.replay_percent >= again.fit_percent * 0.9


def test_no_value_stands_beside_an_interval_of_another(finger, tmp_path):
    """Nothing explains this log: the scenario's values are kept, without the fit's intervals."""
    found = identify(finger, [log(tmp_path / "a.csv", twist=0.3)], static_only=True)
    assert not found.described
    assert headline(found).startswith("No law explains the log")
    assert "tendonff design" not in headline(found)
    assert "fitted.toml has the scenario's own values" in headline(found)
    judged = replace(found, fit_percent=0.4, validation_percent=12.8)
    assert "an RMS error of 12.8 % of range on the validation files" in headline(judged)
    for name, estimate in json.loads(json.dumps(found.as_json()))["estimates"].items():
        if estimate["estimate"] == estimate["scenario"]:
            assert estimate["interval_95"] is None, name
            assert estimate["standard_error"] is None, name


def test_the_column_of_reasons_says_a_text_once():
    """Texts that differ by the value's own name are one; a part that is new keeps the whole."""
    stretch = "no positions: {} is not identifiable; measure both positions"
    texts = {
        "stiffness_N_per_m": stretch.format("stiffness_N_per_m"),
        "relaxing_stiffness_N_per_m": stretch.format("relaxing_stiffness_N_per_m"),
        "mu_dynamic": "dynamic stage",
        "mu_dynamic_release": "dynamic stage",
        "damping_N_s_per_m": "standard error 200 %; measure both positions",
    }
    estimates = [Estimate(name=name, value=1.0, why=why) for name, why in texts.items()]
    expected = list(texts.values())
    expected[1] = "as stiffness_N_per_m"
    assert reasons_of(estimates) == expected


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("mu_dynamic", "-"),
        ("bristle_stiffness", "-"),
        ("tendons.open.tendon.stiffness_N_per_m", "N/m"),
        ("viscous_N_s_per_m", "N s/m"),
        ("joint_stiffness_N_m_per_rad", "N m/rad"),
        ("sensor_compliance_rad_per_N_m", "rad/(N m)"),
    ],
)
def test_the_unit_of_an_estimate_stands_at_the_end_of_its_name(name, unit):
    assert Estimate(name=name, value=1.0, why="").unit == unit


@pytest.mark.parametrize("motors", ["loop", "short_finger"])
def test_fit_json_has_the_same_keys_for_a_tendon_and_for_motors(found, motors):
    stored = json.loads((STORED / motors / "identify" / "fit.json").read_text(encoding="utf-8"))
    own = json.loads(json.dumps(found.as_json()))
    assert set(stored) == set(own)
    estimates = [next(iter(each["estimates"].values())) for each in (stored, own)]
    assert set(estimates[0]) == set(estimates[1])
    assert {"name", "role", "findings"} <= set(stored["files"][0]) & set(own["files"][0])


def test_a_figure_shows_the_files_that_judge_first_and_the_longest_piece_of_each():
    def channel(file, role, name, rows):
        time = np.arange(float(rows))
        return Channel(
            figure="torque", file=file, role=role, name=name, unit="N m", time_s=time, measured=time, model=time
        )

    places = [("a", "fit"), ("a", "fit"), ("b", "validate"), ("c", "fit")]
    one = [channel(file, role, "m", rows) for rows, (file, role) in enumerate(places, 1)]
    assert [(c.file, len(c.time_s)) for c in shown(one, 4)] == [("b", 3), ("a", 2), ("c", 4)]
    several = [channel(file, role, name, 5) for file, role in places[1:] for name in "mn"]
    assert [(c.file, c.name) for c in shown(several, 3)] == [("b", "m"), ("b", "n")]


def test_what_was_treated_in_a_file_is_a_remark_and_what_wants_action_a_warning():
    findings = [Finding(issue=i, count=1, times_s=(), text=f"{i}: 1") for i in (DataIssue.SPIKE, DataIssue.BIAS)]
    spikes, bias = about_issues([SimpleNamespace(name="a.csv", findings=findings)])
    assert isinstance(spikes, Remark)
    assert not isinstance(bias, Remark)
    [alike, _] = about_issues([SimpleNamespace(name=f"{k}.csv", findings=findings) for k in range(9)])
    assert isinstance(alike, Remark)
