"""Designs of several scenarios with one report."""

import json

import pytest

from tendonff.compensator.cli import run


def test_a_hand_gets_a_folder_a_joint_and_one_report(examples, tmp_path):
    files = [str(examples / f"{name}.toml") for name in ("hand_joint", "instrument_pair")]
    assert run(["design", *files, "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))["scenarios"]
    assert list(summary) == ["hand_joint", "instrument_pair"]
    worst = max(summary, key=lambda name: summary[name]["rmse_percent_of_range"])
    assert f"the largest error is that of {worst}" in page
    for name, found in summary.items():
        assert f"{name}/report.html" in page
        alone = json.loads((tmp_path / "out" / name / "summary.json").read_text("utf-8"))
        assert alone["expectation"]["rmse_rad"] == found["rmse_rad"]
        assert (tmp_path / "out" / name / "profile.csv").exists()
        assert found["headline"].split(", with")[0] in page


@pytest.mark.parametrize("option", [["--interactive"], ["--check", "cvodes"]])
def test_what_is_for_one_scenario_is_refused_for_several(examples, tmp_path, capsys, option):
    files = [str(examples / f"{name}.toml") for name in ("hand_joint", "instrument_pair")]
    assert run(["design", *files, "--out", str(tmp_path / "out"), *option]) == 2
    assert "are for one scenario" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_two_files_of_one_name_are_refused(examples, tmp_path, capsys):
    (tmp_path / "hand_joint.toml").write_bytes((examples / "hand_joint.toml").read_bytes())
    files = [str(folder / "hand_joint.toml") for folder in (examples, tmp_path)]
    assert run(["design", *files, "--out", str(tmp_path / "out")]) == 2
    assert "two scenarios are called hand_joint.toml" in capsys.readouterr().err
