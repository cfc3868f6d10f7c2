"""Sweeps: what is stored is gone on with, wherever it is computed, and the numbers are those of single runs."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tendonff.compensator import cli
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Inverse
from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import verify
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import SineReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.sweep import run
from tendonff.compensator.studies.design.sweep.plan import Axis, random_keys, random_units, varied
from tendonff.compensator.studies.design.sweep.run import sweep
from tendonff.models.parameters.drive import Motor
from tendonff.models.parameters.uncertainty import OtherLaw, Uncertainty

EXAMPLES = Path(__file__).resolve().parents[5] / "examples"
NAMES = ("none", "inverse")


@pytest.fixture(scope="module")
def unsure() -> Scenario:
    scenario = load_scenario(EXAMPLES / "finger.toml")
    reference = scenario.reference
    assert isinstance(reference, SineReference)
    return replace(
        scenario,
        reference=replace(reference, duration_s=0.6),
        run=replace(scenario.run, step_s=4e-3),
        robust=Uncertainty(mu=0.2, stiffness=0.1),
    )


@pytest.mark.usefixtures("unpainted")
def test_a_sweep_that_was_killed_goes_on_and_equals_one_that_ran_through(
    unsure: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = sweep(unsure, tmp_path / "whole", samples=40, compensators=NAMES)
    whole.write(tmp_path / "whole")
    monkeypatch.setattr(run, "_JOBS_OF_WAVE", 2)
    waves = 0

    def killed(done: int, _total: int) -> None:
        nonlocal waves
        waves += done > 0
        if waves == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(unsure, tmp_path / "parts", samples=40, compensators=NAMES, progress=killed)
    rows = tmp_path / "parts" / "rows.partial.csv"
    stored = rows.read_text(encoding="utf-8")
    assert stored.count("\n") == 24
    rows.write_text(stored[:-7], encoding="utf-8")  # as if killed in the middle of a line
    begun: list[int] = []
    again = sweep(
        unsure, tmp_path / "parts", samples=40, compensators=NAMES, progress=lambda done, _total: begun.append(done)
    )
    again.write(tmp_path / "parts")
    assert begun[0] == 23
    for name in ("samples.csv", "summary.json"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_ctrl_c_says_what_is_kept_and_without_rows_leaves_no_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (EXAMPLES / "finger.toml").read_text(encoding="utf-8")
    text = text.replace("duration_s = 4.0", "duration_s = 0.6").replace("step_s = 0.001", "step_s = 0.004")
    (tmp_path / "s.toml").write_text(text + "\n[robust]\nmu = 0.2\n", encoding="utf-8")
    monkeypatch.setattr(run, "_JOBS_OF_WAVE", 2)
    jobs, out = run.run_jobs, str(tmp_path / "o")
    for waves, samples, said in (
        (0, 9, "interrupted; nothing was written"),
        (1, 10, f"interrupted; 8 of 10 units kept in {out}; start again to go on"),
    ):
        left = iter([jobs] * waves)

        def stopped(*arguments: Any, left: Iterator[Any] = left, **options: Any) -> Any:
            for work in left:
                return work(*arguments, **options)
            raise KeyboardInterrupt

        monkeypatch.setattr(run, "run_jobs", stopped)
        command = ["sweep", str(tmp_path / "s.toml"), "--compensators", "inverse", "--out", out]
        assert cli.run([*command, "--samples", str(samples)]) == cli.EXIT_INTERRUPTED
        assert capsys.readouterr().err.strip() == said


def test_what_the_actuator_has_of_its_motor_follows_a_swept_motor(unsure: Scenario) -> None:
    motor = Motor(
        drum_radius_m=0.02, gear_ratio=10.0, inertia_kg_m2=1e-5, torque_max_N_m=0.5, speed_max_rad_per_s=300.0
    )
    actuator = replace(unsure.transmission.actuator, motor=motor, **motor.at_the_drum)
    there = replace(unsure, transmission=replace(unsure.transmission, actuator=actuator))
    axis = Axis.parse("actuator.motor.gear_ratio=20:20:1")
    geared = varied(there, (axis.key,), axis.values).transmission.actuator
    assert geared.motor == replace(motor, gear_ratio=20.0)
    assert geared.force_max_N == pytest.approx(0.5 * 20 / 0.02)
    assert geared.mass_kg == pytest.approx(1e-5 * 1e6)
    assert geared.speed_max_m_per_s == pytest.approx(300 * 0.02 / 20)
    with pytest.raises(InputError, match=r"mass_kg must be 2\.5, as the actuator's motor gives, got 3"):
        varied(there, ("actuator.mass_kg",), (3.0,))


def test_a_unit_scores_what_a_single_run_on_it_scores(unsure: Scenario, tmp_path: Path) -> None:
    result = sweep(unsure, tmp_path / "s", samples=5, compensators=NAMES)
    problem = Problem.of(replace(unsure, robust=Uncertainty()))
    profile, row = Inverse().profile(problem), result.rows[3]
    friction = unsure.transmission.friction
    unit = varied(
        unsure,
        ("friction.mu_dynamic", "friction.mu_static", "tendon.stiffness_N_per_m", "tendon.relaxing_stiffness_N_per_m"),
        (
            friction.mu_dynamic * row.values[0],
            friction.mu_static * row.values[0],
            unsure.transmission.tendon.stiffness_N_per_m * row.values[1],
            unsure.transmission.tendon.relaxing_stiffness_N_per_m * row.values[1],
        ),
    ).transmission
    alone = verify(Plant(unit, problem.level, FINE_SEGMENTS), "inverse", profile, problem.reference).score
    assert row.percent[1] == pytest.approx(alone.rmse_percent_of_range, rel=1e-9)
    assert row.percent[1] > 1


def test_yields_and_quantiles_are_counts_of_the_rows(unsure: Scenario, tmp_path: Path) -> None:
    result = sweep(unsure, tmp_path / "s", samples=12, compensators=NAMES)
    errors = sorted(row.percent[1] for row in result.rows)
    assert result.yield_of("inverse", errors[4]) == 4 / 12
    assert result.quantiles("inverse")[-1] == errors[-1]
    assert [entry[0] for entry in result.budget] == ["mu", "stiffness"]
    mu, stiffness = ((entry[3][1], entry[4][1]) for entry in result.budget)
    assert min(mu) > 10 * max(stiffness)  # friction is what feedforward lives and dies by


def test_a_grid_designs_anew_at_every_point(unsure: Scenario, tmp_path: Path) -> None:
    axes = (Axis.parse("friction.mu_dynamic=0.1:0.2:3"), Axis.parse("path.segments=2:4:2"))
    result = sweep(unsure, tmp_path / "s", over=axes, compensators=NAMES)
    assert [row.values for row in result.rows] == [
        (mu, n) for mu in np.linspace(0.1, 0.2, 3).tolist() for n in (2.0, 4.0)
    ]
    assert max(row.percent[1] for row in result.rows) < 0.8  # on 40 masses; one force for all would leave several %
    assert result.rows[0].percent[0] < result.rows[4].percent[0]


def test_without_a_stribeck_effect_friction_is_varied_as_a_whole(unsure: Scenario) -> None:
    friction = unsure.transmission.friction
    without = replace(unsure.transmission, friction=replace(friction, mu_static=friction.mu_dynamic))
    there = varied(replace(unsure, transmission=without), ("friction.mu_dynamic",), (0.4,)).transmission.friction
    assert there.mu_static == there.mu_dynamic == 0.4


def test_the_first_sentence_is_that_of_a_design_and_no_unit_is_worse(unsure: Scenario, tmp_path: Path) -> None:
    result = sweep(unsure, tmp_path / "s", samples=6, compensators=NAMES)
    problem = Problem.of(unsure)
    profiles = {name: compensator(name).profile(problem) for name in NAMES}
    worst = problem.expect(profiles).worst_percent
    assert f"({two_digits(min(worst.values()))} % of range)" in result.headline
    for k, name in enumerate(NAMES):
        assert max(row.percent[k] for row in result.rows) <= 1.02 * worst[name]
    assert "other_law" not in result.headline


def test_a_law_that_no_unit_has_is_named_with_its_error(unsure: Scenario, tmp_path: Path) -> None:
    other = OtherLaw(keys=("friction.mu_dynamic",), values=(0.3,))
    result = sweep(
        replace(unsure, robust=replace(unsure.robust, other_law=other)), tmp_path / "s", samples=2, compensators=NAMES
    )
    error = result.expectation.best.other.rmse_percent_of_range
    assert f"No unit has the law of [robust.other_law]: {two_digits(error)} % with it." in result.headline
    assert error > max(result.percent(result.expectation.recommended))


@pytest.mark.slow
def test_a_dask_cluster_by_its_address_gives_the_same_rows(unsure: Scenario, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    from tendonff.compensator.studies.design.sweep.run import executor_of

    here = sweep(unsure, tmp_path / "here", samples=8, compensators=NAMES)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster,
        executor_of(cluster.scheduler_address) as executor,
    ):
        there = sweep(unsure, tmp_path / "there", samples=8, compensators=NAMES, executor=executor)
    assert there.rows == here.rows


_KILLED = """
import os, signal
from pathlib import Path
from tendonff.compensator.studies.design.sweep import run
from tendonff.compensator.studies.design.sweep.run import executor_of
from tendonff.compensator.scenarios import load_scenario
run._JOBS_OF_WAVE = 2

def tell(done, _total):
    if done >= 16:
        os.kill(os.getpid(), signal.SIGKILL)

with executor_of("{address}") as executor:
    run.sweep(
        load_scenario(Path("{scenario}")),
        Path("{out}"),
        samples=24,
        compensators=("none", "inverse"),
        executor=executor,
        progress=tell,
    )
"""


@pytest.mark.nightly
@pytest.mark.usefixtures("unpainted")
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no SIGKILL")
def test_a_sweep_on_a_cluster_of_processes_that_was_killed_equals_one_that_ran_through(tmp_path: Path) -> None:
    """The one that ran through needed no cluster."""
    distributed, pandas = pytest.importorskip("distributed"), pytest.importorskip("pandas")
    from tendonff.compensator.studies.design.sweep.run import executor_of

    text = (EXAMPLES / "finger.toml").read_text(encoding="utf-8")
    text = text.replace("duration_s = 4.0", "duration_s = 0.6").replace("step_s = 0.001", "step_s = 0.004")
    (tmp_path / "s.toml").write_text(text + "\n[robust]\nmu = 0.2\nstiffness = 0.1\n", encoding="utf-8")
    scenario, parts, whole = load_scenario(tmp_path / "s.toml"), tmp_path / "parts", tmp_path / "whole"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster:
        address = cluster.scheduler_address
        code = _KILLED.format(address=address, scenario=tmp_path / "s.toml", out=parts)
        killed = subprocess.run([sys.executable, "-c", code], check=False, timeout=300)
        assert killed.returncode == -signal.SIGKILL
        assert (parts / "rows.partial.csv").read_text(encoding="utf-8").count("\n") == 16
        with executor_of(address) as executor:
            sweep(scenario, parts, samples=24, compensators=NAMES, executor=executor).write(parts, parquet=True)
    sweep(scenario, whole, samples=24, compensators=NAMES).write(whole)
    for name in ("samples.csv", "summary.json"):
        assert (parts / name).read_bytes() == (whole / name).read_bytes()
    frame, again = pandas.read_parquet(parts / "samples.parquet"), pandas.read_csv(whole / "samples.csv")
    pandas.testing.assert_frame_equal(frame, again, rtol=1e-14)


def test_what_cannot_be_swept_is_refused_with_a_way_out(unsure: Scenario, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"write friction\.mu_dynamic=0\.15:0\.25:11"):
        Axis.parse("mu=1")
    with pytest.raises(InputError, match=r'no number "mu_dynamc", did you mean "mu_dynamic"'):
        sweep(unsure, tmp_path / "a", over=[Axis(key="friction.mu_dynamc", values=(1.0,))])
    with pytest.raises(InputError, match=r"finger\.toml has no \[actuator\.motor\]; add it"):
        sweep(unsure, tmp_path / "a", over=[Axis(key="actuator.motor.gear_ratio", values=(10.0,))])
    with pytest.raises(InputError, match="whole number"):
        sweep(unsure, tmp_path / "a", over=[Axis(key="path.segments", values=(1.5,))])
    with pytest.raises(InputError, match="either --over"):
        sweep(unsure, tmp_path / "a")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="holds no sweep"):
        sweep(unsure, tmp_path / "full", samples=3)
    sweep(unsure, tmp_path / "b", samples=3, compensators=NAMES)
    with pytest.raises(InputError, match="another sweep"):
        sweep(unsure, tmp_path / "b", samples=4, compensators=NAMES)


@pytest.mark.parametrize("kind", ["tendon", "joint"])
def test_units_without_a_statement_are_drawn_from_what_design_assumes(unsure: Scenario, kind: str) -> None:
    joint = load_scenario(EXAMPLES / "hand_joint.toml")
    scenario = replace(unsure, robust=Uncertainty()) if kind == "tendon" else joint
    assumed = problem_of(scenario).doubt.uncertainty
    assert len(assumed.spreads) == (1 if kind == "tendon" else 3)
    stated = replace(scenario, robust=assumed)
    assert random_keys(scenario) == random_keys(stated)
    assert [u.values for u in random_units(scenario, 4)] == [u.values for u in random_units(stated, 4)]
    assert {u.scenario.robust for u in random_units(scenario, 2)} == {Uncertainty()}
