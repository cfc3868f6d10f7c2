"""What a filter of a live reference costs and buys, drawn and picked."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.scenario.scenario import scenario_to_toml
from tendonff.compensator.scenario.settings import Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.online import online_figure, study_online
from tendonff.ocp.errors import SolveError


@pytest.fixture(scope="module")
def finger(examples):
    scenario = load_scenario(examples / "finger.toml")
    return replace(scenario, reference=replace(scenario.reference, duration_s=1.5))


def test_the_pick_is_what_lag_and_noise_admit_and_longer_filters_need_preview(finger):
    study = study_online(Problem.of(finger), Stream(lag_max_s=0.02))
    table = pd.DataFrame(study.columns)
    (picked,) = table[table.picked == 1].itertuples()
    assert 0 < picked.lag_s <= 0.02
    assert picked.force_noise_dB <= 0
    assert f"{1e3 * picked.lag_s:.3g} ms of lag" in study.sentence
    assert table[table.lag_s < 0].filter_s.max() == pytest.approx(0.05)
    plain = table[table.keeps_parabolas == 0].sort_values("filter_s")
    assert np.all(np.diff(plain.force_noise_dB[plain.lag_s < 0]) < 0)  # longer: quieter


def test_the_figure_rings_the_pick(finger):
    study = study_online(Problem.of(finger), Stream())
    (axes,) = online_figure(study).axes
    (ring,) = (line for line in axes.lines if line.get_label() == "picked")
    picked = study.choice.picked
    assert ring.get_xydata()[0] == pytest.approx([picked.noise_dB, picked.score.rmse_percent_of_range])


def test_design_draws_it_where_the_scenario_has_the_table(finger, tmp_path, capsys):
    scenario = tmp_path / "s.toml"
    short = replace(finger, reference=replace(finger.reference, duration_s=0.12), stream=Stream())
    scenario.write_text(scenario_to_toml(short), encoding="utf-8")
    assert run(["design", str(scenario), "--out", str(tmp_path / "d")]) == 0
    assert (tmp_path / "d" / "online.csv").exists()
    assert "<h2>Live reference</h2>" in (tmp_path / "d" / "report.html").read_text(encoding="utf-8")
    assert "live reference:" in "".join(capsys.readouterr())


def test_a_path_that_moves_has_none(examples):
    with pytest.raises(SolveError, match="no filter is drawn where joints move the path"):
        study_online(Problem.of(load_scenario(examples / "finger_moving.toml")), Stream())
