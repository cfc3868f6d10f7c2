"""The ten-state test on the finger example: what the three models show, as numbers, and the files."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shared_outputs import Output

from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.reporting.page import render_report
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.experiment import output as experiment_output
from tendonff.compensator.studies.experiment.figures import tensions_figure
from tendonff.compensator.studies.experiment.machine import plan_experiment
from tendonff.compensator.studies.experiment.numbers import (
    MEANINGS,
    deviations,
    largest_switch,
    law_deviation,
    read_measured,
    refinement,
    relaxation,
    reversals,
    sliding_direction,
    transient,
    warnings_of,
)
from tendonff.compensator.studies.experiment.output import write_run
from tendonff.compensator.studies.experiment.report import experiment_report
from tendonff.compensator.studies.experiment.result import ExperimentRun, MeasuredTensions
from tendonff.compensator.studies.experiment.rig import Rig
from tendonff.compensator.studies.experiment.run import ExperimentResult, experiment, follow_schedule, run_machine
from tendonff.models.fidelity import Level

RELAXING = [Level.VISCOELASTIC, Level.PRESLIDING]
STIFF = [Level.ELASTIC, Level.VISCOELASTIC]
TENSIONS = [f"tension_{k}_N" for k in range(1, 8)]
MOTORS = ["motor_1_position_m", "motor_2_position_m", "motor_1_force_N", "motor_2_force_N"]


@pytest.fixture(scope="module")
def finger(examples: Path) -> Scenario:
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def result(finger: Scenario) -> ExperimentResult:
    return experiment(finger)


@pytest.fixture(scope="module")
def bowden(examples: Path) -> ExperimentResult:
    """Another coefficient when releasing, and adhesion."""
    return experiment(load_scenario(examples / "bowden.toml"))


def widths(run: ExperimentRun) -> dict[str, float]:
    found = {done.state.name: transient(run, done) for done in reversals(run)}
    return {name: value.width_s for name, value in found.items() if value is not None}


@pytest.mark.parametrize("level", RELAXING)
def test_held_tension_relaxes_in_s4_and_recovers_in_s9_where_the_link_relaxes(
    result: ExperimentResult, level: Level
) -> None:
    change = {state: value.change_percent_of_range for state, value in relaxation(result.runs[level]).items()}
    assert list(change) == ["S4", "S9"]
    assert change["S4"] < -2
    assert change["S9"] > 1.5


def test_held_tension_stays_in_the_elastic_model(result: ExperimentResult) -> None:
    for value in relaxation(result.runs[Level.ELASTIC]).values():
        assert abs(value.change_percent_of_range) < 0.05


def test_the_hold_relaxes_with_the_relaxation_time_of_the_tendon(result: ExperimentResult) -> None:
    """Towards the end of the hold the departure from the last value falls by e within about tau = 0.4 s.

    The springs in series make the time constant of a held tension a little longer than tau.
    """
    run = result.runs[Level.VISCOELASTIC]
    hold = next(done for done in run.passes if done.state.name == "S4")
    tau = run.transmission.tendon.relaxation_time_s
    rows = slice(hold.first_row, hold.last_row)
    f, t = run.link_tension_N[rows, 0], run.time_s[rows]
    early, late = (int(np.argmax(t >= t[0] + k * tau)) for k in (0.5, 1.5))
    slope = np.gradient(f, t)
    assert np.log(slope[early] / slope[late]) == pytest.approx(1.0, abs=0.2)


def test_the_soft_bristle_smooths_both_reversals(result: ExperimentResult) -> None:
    """The first half of the output's change takes more than twice as long as with stiff bristles."""
    soft = widths(result.runs[Level.PRESLIDING])
    for level in STIFF:
        stiff = widths(result.runs[level])
        assert list(stiff) == list(soft) == ["S5", "S7"]
        for state, width in stiff.items():
            assert soft[state] > 2 * width


def test_the_width_of_a_straight_ramp_is_9_twentieths_of_its_time(result: ExperimentResult) -> None:
    run = result.runs[Level.ELASTIC]
    done = reversals(run)[0]
    tension = run.link_tension_N.copy()
    count = done.last_row - done.first_row
    tension[done.first_row : done.last_row + 1, -1] = np.linspace(90.0, 40.0, count + 1)
    found = transient(replace(run, link_tension_N=tension), done)
    assert found is not None
    assert found.change_N == pytest.approx(-50)
    assert found.width_s == pytest.approx(0.45 * count * 1e-3, abs=2e-3)
    assert found.max_slope_N_per_s == pytest.approx(50 / (count * 1e-3), rel=1e-6)


@pytest.mark.parametrize("level", Level)
def test_switchings_are_bumpless(result: ExperimentResult, level: Level) -> None:
    assert 0 < largest_switch(result.runs[level]) < 0.1


def test_a_switch_that_is_not_bumpless_is_seen(finger: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    right = Rig._bumpless
    monkeypatch.setattr(Rig, "_bumpless", lambda self, mode, k: right(self, mode, k) + 1e-3)
    _, run = run_machine(plan_experiment(finger), Level.PRESLIDING)
    assert largest_switch(run) > 1


def test_six_and_forty_masses_agree(result: ExperimentResult) -> None:
    found = refinement(result.runs[result.lead], result.fine)
    assert (found.segments, found.fine_segments) == (6, 40)
    assert found.rms_percent_of_range < 0.2
    assert 0 < found.max_percent_of_range < 1


def profiles_in_slip(run: ExperimentRun) -> dict[str, FloatArray]:
    """ln((f_1 + p)/(f_i + p)) over mu theta, as a ramp ends in which every mass slides one way; 1 at the far end."""
    friction, angle = run.transmission.friction, run.transmission.path.total_angle_rad
    found = {}
    for done in run.passes:
        direction, k = sliding_direction(done), done.stop_row
        v = run.velocity_m_per_s[k] * direction
        if direction and v.min() > 0.1 * v.max():
            lifted = np.log(run.link_tension_N[k] + friction.adhesion_N)
            mu = friction.mu_dynamic if direction > 0 else friction.release_dynamic
            found[done.state.name] = direction * (lifted[0] - lifted) / (mu * angle)
    return found


@pytest.mark.parametrize("level", STIFF)
@pytest.mark.parametrize("example", ["result", "bowden"])
def test_profiles_in_one_way_slip_follow_the_static_law(
    request: pytest.FixtureRequest, example: str, level: Level
) -> None:
    """(f_1 + p)/(f_i + p) = e^{+-mu theta_i} with the coefficient of the direction, at the end of each ramp."""
    found = profiles_in_slip(request.getfixturevalue(example).runs[level])
    assert list(found) == ["S2", "S3", "S5", "S6", "S7", "S8"]
    for profile in found.values():
        assert profile == pytest.approx(np.linspace(0, 1, len(profile)), abs=0.01)


def test_a_soft_bristle_lags_the_static_law_in_growing_tension_and_leads_it_in_falling(
    result: ExperimentResult,
) -> None:
    """f_s follows mu f_n only over a sliding distance of mu f_n/sigma0, so it is too small while f_n grows."""
    found = profiles_in_slip(result.runs[Level.PRESLIDING])
    assert found["S3"][-1] < 0.99
    assert found["S5"][-1] > 1.01


@pytest.mark.parametrize("example", ["result", "bowden"])
def test_without_presliding_and_relaxation_all_ten_states_are_the_law_with_two_ends(
    request: pytest.FixtureRequest, example: str
) -> None:
    """What a bristle of finite stiffness adds goes away as it stiffens."""
    test: ExperimentResult = request.getfixturevalue(example)
    ideal, ordinary = (law_deviation(run) for run in (test.quasi_static, test.runs[Level.ELASTIC]))
    assert ideal.rms_percent_of_range < 0.005
    assert ideal.max_percent_of_range < 0.1
    assert ideal.rms_percent_of_range < 0.01 * ordinary.rms_percent_of_range


def test_a_tension_off_the_law_is_seen(result: ExperimentResult) -> None:
    tension = result.quasi_static.link_tension_N.copy()
    tension[5000, 3] *= 1.05
    assert law_deviation(replace(result.quasi_static, link_tension_N=tension)).max_percent_of_range > 1


def test_all_levels_receive_the_same_forces_at_the_ends_of_ramps(result: ExperimentResult) -> None:
    ends = [done.last_row for done in result.fine.passes if done.state.name in {"S2", "S3", "S5", "S6", "S7", "S8"}]
    motors = [0, 0, 0, 1, 1, 1]
    lead = result.runs[result.lead].force_N[ends, motors]
    for each in [*result.runs.values(), result.fine, result.quasi_static]:
        np.testing.assert_allclose(each.force_N[ends, motors], lead, rtol=1e-9)


def test_played_again_on_its_own_level_the_schedule_gives_the_machines_run(finger: Scenario) -> None:
    plan = plan_experiment(finger)
    schedule, run = run_machine(plan, Level.VISCOELASTIC)
    again = follow_schedule(plan, schedule, Level.VISCOELASTIC)
    np.testing.assert_allclose(again.link_tension_N, run.link_tension_N, atol=1e-6)


def test_seven_sections_of_any_chain_end_at_its_ends(result: ExperimentResult) -> None:
    fine = result.fine
    np.testing.assert_allclose(fine.tension_N[:, [0, -1]], fine.link_tension_N[:, [0, -1]], rtol=1e-12)
    assert fine.tension_N.shape[1] == 7
    # In slip ln T is linear in the angle, so that interpolation between links is exact.
    profile = np.log(fine.tension_N[next(d.stop_row for d in fine.passes if d.state.name == "S5")])
    links = np.log(fine.link_tension_N[next(d.stop_row for d in fine.passes if d.state.name == "S5")])
    np.testing.assert_allclose(profile[3], links[20], rtol=1e-12)


def test_each_table_of_a_level_has_the_columns_of_the_contract(result: ExperimentResult, tmp_path: Path) -> None:
    run_ = result.runs[Level.ELASTIC]
    write_run(run_, tmp_path / "experiment_elastic.csv")
    lines = (tmp_path / "experiment_elastic.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].split(",") == ["time_s", "state", *TENSIONS, *MOTORS]
    columns = read_csv(tmp_path / "experiment_elastic.csv", ["time_s", *TENSIONS, *MOTORS], starts_at_zero=True)
    read = np.column_stack([columns[name] for name in TENSIONS])
    np.testing.assert_allclose(read, run_.tension_N, rtol=1e-15)  # pandas before 3.1 may miss the last bit
    np.testing.assert_allclose(columns["motor_2_force_N"], run_.force_N[:, 1], rtol=1e-15)
    states = [line.split(",")[1] for line in lines[1:]]
    assert list(dict.fromkeys(states)) == [f"S{k}" for k in range(1, 11)]
    assert states.count("S4") == round(run_.passes[3].state.at_most_s / 1e-3)


def test_at_rest_a_motors_force_is_the_tension_at_its_end(result: ExperimentResult) -> None:
    run_ = result.runs[Level.ELASTIC]
    for done in run_.passes:
        np.testing.assert_allclose(
            run_.force_N[done.last_row], run_.link_tension_N[done.last_row, [0, -1]], atol=0.001 * run_.range_N
        )


def test_the_figure_names_every_state(result: ExperimentResult) -> None:
    texts = {text.get_text() for text in tensions_figure(result).axes[0].texts}
    assert texts == {f"S{k}" for k in range(1, 11)}


def test_nothing_is_left_where_a_figure_fails(
    result: ExperimentResult, finger: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(experiment_output, "experiment_figures", broken)
    with pytest.raises(KeyboardInterrupt):
        result.write(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_command_writes_everything_for_the_finger(output: Callable[..., Output], result: ExperimentResult) -> None:
    folder = output("experiment", "finger").folder
    names = {path.name for path in folder.iterdir()}
    pictures = {f"experiment_{what}" for what in ("distribution", "tensions", "details", "hysteresis")}
    assert names == (
        {f"experiment_{level}.csv" for level in Level}
        | {f"{name}.svg" for name in pictures}
        | {"summary.json", "report.html"}
    )
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["schema"] == 1
    assert summary["warnings"] == warnings_of(result) == []
    assert [state["state"] for state in summary["states"]] == [f"S{k}" for k in range(1, 11)]
    elastic, viscoelastic, presliding = (summary["levels"][level] for level in Level)
    assert abs(elastic["relaxation"]["S4"]["change_N"]) < 0.1
    assert viscoelastic["relaxation"]["S4"]["change_N"] < -1
    assert presliding["transient"]["S5"]["width_s"] > 2 * elastic["transient"]["S5"]["width_s"]
    assert summary["largest_switch_percent_of_range"] < 0.1
    assert summary["refinement"]["fine_segments"] == 40
    assert summary["quasi_static_elastic"]["two_ended_law"]["max_percent_of_range"] < 0.1


@pytest.fixture(scope="module")
def measured(result: ExperimentResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sensors 2 and 6 of a rig that is the viscoelastic model but for 0.5 N at the sixth."""
    path, run_ = tmp_path_factory.mktemp("rig") / "rig.csv", result.runs[Level.VISCOELASTIC]
    rows = slice(50, -50, 7)
    sixth = run_.tension_N[rows, 5] + 0.5
    write_csv(path, {"time_s": run_.time_s[rows], "tension_2_N": run_.tension_N[rows, 1], "tension_6_N": sixth})
    return path


def test_measured_tensions_are_laid_over_and_compared(result: ExperimentResult, measured: Path, tmp_path: Path) -> None:
    with_rig = replace(result, measured=read_measured(measured))
    levels = experiment_output.summary(with_rig)["levels"]
    second, sixth = levels[Level.VISCOELASTIC]["measured"]
    assert (second["sensor"], sixth["sensor"]) == (2, 6)
    assert second["measured_rms_percent_of_range"] == pytest.approx(0, abs=1e-3)
    for key in ("measured_rms_percent_of_range", "measured_max_percent_of_range"):
        assert sixth[key] == pytest.approx(50 / result.runs[Level.VISCOELASTIC].range_N, rel=1e-3)
    assert levels[Level.ELASTIC]["measured"][0]["measured_rms_percent_of_range"] > 0.5
    lines, bare = (len(tensions_figure(one).axes[0].lines) for one in (with_rig, result))
    assert lines == bare + 2
    page = render_report(experiment_report(with_rig, {}))
    assert "rig.csv, dashed in the figure" in page
    assert "rig.csv agrees best with the viscoelastic level: RMS difference" in page


@pytest.mark.parametrize(
    ("text", "message"),
    [("time_s,a\n0,1\n1,2\n", "at least one of tension_1_N"), ("time_s,tension_1_N\n0,x\n", "rows hold numbers")],
)
def test_a_measured_file_that_cannot_be_used_is_refused(
    finger: Scenario, tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "rig.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        experiment(finger, tmp_path / "rig.csv")


def test_motors_with_dry_friction_are_refused_by_file_and_table(finger: Scenario) -> None:
    rubbing = replace(finger.transmission.actuator, coulomb_N=3.0)
    with pytest.raises(InputError, match=r"finger\.toml \[actuator\]: coulomb_N must be 0 .* got 3; leave it out"):
        experiment(replace(finger, transmission=replace(finger.transmission, actuator=rubbing)))


def test_a_measured_file_of_another_time_is_refused(result: ExperimentResult) -> None:
    late = MeasuredTensions(name="rig.csv", time_s=np.array([1e4, 2e4]), tension_N={0: np.array([1.0, 2.0])})
    with pytest.raises(InputError, match="let the measured time start with the test"):
        deviations(result.runs[Level.ELASTIC], late)


def test_the_report_explains_every_number_of_the_summary(result: ExperimentResult) -> None:
    """Keys that hold a number, or a record with its own line, but for counts and times that name themselves."""

    def numbers_in(value: object, path: tuple[str, ...]) -> set[tuple[str, ...]]:
        if isinstance(value, dict):
            return set().union(*(numbers_in(inner, (*path, str(key))) for key, inner in value.items()))
        if isinstance(value, list):
            return set().union(*(numbers_in(inner, path) for inner in value))
        return {path} if isinstance(value, int | float) else set()

    explained = {word for line in MEANINGS for word in line.split(", ")}
    known = {"schema", "sections", "start_s", "end_s"}
    found = numbers_in(experiment_output.summary(result), ())
    assert [path for path in found if not explained & set(path) and path[-1] not in known] == []
