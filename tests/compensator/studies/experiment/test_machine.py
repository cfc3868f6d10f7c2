"""The state machine as data: the default cycle, a cycle of one's own, and what is refused."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.experiment import EndTension, Experiment, ExperimentState, Hold, MotorMode
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.experiment.machine import Machine, plan_experiment
from tendonff.compensator.studies.experiment.numbers import holds, relaxation, reversals, sliding_direction, warnings_of
from tendonff.compensator.studies.experiment.rig import Modes, Rig
from tendonff.compensator.studies.experiment.run import experiment, run_machine
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level

A, L, H, F = MotorMode

OWN = """
[experiment]
low_tension_N = 30.0
high_tension_N = 90.0
blend_s = 0.03
states       = ["rest", "pull",              "wind"]
motor_1      = ["A",    "A",                 "A_h"]
motor_2      = ["L",    "L",                 "L"]
motor_1_rate = [0.0,    200.0,               0.0]
motor_2_rate = [0.0,    0.0,                 0.02]
until        = ["",     "tension_1 >= 80.0", "tension_2 >= 60"]
at_most_s    = [0.1,    2.0,                 2.0]
"""


@pytest.fixture(scope="module")
def finger(examples: Path) -> Scenario:
    return load_scenario(examples / "finger.toml")


def with_table(finger: Scenario, examples: Path, table: str) -> Scenario:
    return parse_scenario((examples / "finger.toml").read_text(encoding="utf-8") + table, finger.source)


def columns(**changes: object) -> Experiment:
    """The machine of `OWN` with some columns changed."""
    table = tomllib.loads(OWN)["experiment"] | changes
    return Experiment(**{key: tuple(value) if isinstance(value, list) else value for key, value in table.items()})


@pytest.mark.parametrize("name", ["finger", "bowden", "surgical", "finger_fast", "finger_stribeck"])
def test_the_default_cycle_works_for_every_example_without_a_table(examples: Path, name: str) -> None:
    """Every condition is met by a tension in good time, on the scenario's level; both reversals cross the path."""
    scenario = load_scenario(examples / f"{name}.toml")
    assert scenario.experiment == Experiment()
    result = experiment(scenario)
    assert warnings_of(result) == []
    assert [done.met for done in result.fine.passes if done.state.until is not None] == [True] * 6


def test_motor_1_acts_first_and_motor_2_second_and_they_hold_in_s4_and_s9(finger: Scenario) -> None:
    _, run = run_machine(plan_experiment(finger), Level.ELASTIC)
    acting = [next(k for k in (0, 1) if done.state.modes[k] is not L) + 1 for done in run.passes]
    assert acting == [1, 1, 1, 1, 1, 2, 2, 2, 2, 1]
    assert [(done.state.name, motor + 1) for done, motor in holds(run)] == [("S4", 1), ("S9", 2)]
    assert [done.state.name for done in reversals(run)] == ["S5", "S7"]


def test_the_tendon_slides_where_the_states_say(finger: Scenario) -> None:
    """At the end of each ramp every mass slides to motor 1 in S2, S3, S7, S8 and to motor 2 in S5, S6."""
    _, run = run_machine(plan_experiment(finger), Level.ELASTIC)
    directions = {done.state.name: sliding_direction(done) for done in run.passes if sliding_direction(done)}
    assert directions == {"S2": 1, "S3": 1, "S5": -1, "S6": -1, "S7": 1, "S8": 1}
    for done in run.passes:
        if done.state.name in directions:
            assert np.all(np.sign(run.velocity_m_per_s[done.stop_row]) == directions[done.state.name])


def test_a_machine_of_ones_own_runs_and_reads_back(finger: Scenario, examples: Path) -> None:
    scenario = with_table(finger, examples, OWN)
    assert parse_scenario(scenario_to_toml(scenario), finger.source).experiment == scenario.experiment
    result = experiment(scenario)
    run = result.runs[Level.PRESLIDING]
    rest, pull, wind = run.passes
    assert run.state_names()[0] == "rest"
    assert rest.last_row == 100
    assert not rest.met
    assert run.link_tension_N[pull.stop_row, 0] == pytest.approx(80, abs=0.3)
    assert run.link_tension_N[wind.stop_row, -1] == pytest.approx(60, abs=0.3)
    held = run.position_m[wind.first_row : wind.last_row + 1, 0]
    assert np.ptp(held) < 0.05 * np.ptp(run.position_m[:, 1])
    assert run.position_m[-1, 1] < run.position_m[wind.first_row, 1]  # motor 2 moves away from the tendon


def test_a_state_without_its_condition_ends_with_its_longest_time(finger: Scenario) -> None:
    settings = columns(until=["", "tension_1 >= 89", ""], at_most_s=[0.1, 0.15, 0.1], motor_2_rate=[0.0, 0.0, 0.0])
    result = experiment(replace(finger, experiment=settings))
    pull = result.fine.passes[1]
    assert (pull.met, pull.stop_row - pull.first_row) == (False, 150)
    assert any("pull ended after 0.15 s without tension_1 >= 89" in note for note in warnings_of(result))


def test_a_tendon_that_goes_slack_is_reported_with_its_state(finger: Scenario) -> None:
    settings = columns(motor_1_rate=[0.0, -200.0, 0.0], until=["", "", ""], at_most_s=[0.1, 0.3, 0.1])
    notes = warnings_of(experiment(replace(finger, experiment=settings)))
    assert any("goes slack in pull at t = " in note and "raise low_tension_N" in note for note in notes)


@pytest.mark.parametrize("modes", [(A, L), (F, L), (L, F), (H, L), (L, A), (L, H), (L, L), (H, A), (A, H), (H, H)])
def test_changing_modes_at_rest_leaves_the_rig_at_rest(finger: Scenario, modes: Modes) -> None:
    """L to A sets f_c = f; A to L sets x_c = x +- f/k: after a pull, with unequal tensions at the ends."""
    rig = Rig(plan_experiment(finger), Level.ELASTIC, (A, L))
    ramp = np.concatenate([np.linspace(0, 300, 100), np.full(200, 300.0), np.linspace(300, 0, 100), np.zeros(2000)])
    rig.advance(np.column_stack([ramp, np.zeros_like(ramp)]))
    near, far = rig.end_tensions_N
    assert near > 1.5 * far
    rig.switch(modes)
    rows = rig.advance(np.zeros((100, 2)))
    np.testing.assert_allclose(rows.tension_N[:, [0, -1]], np.tile([near, far], (100, 1)), atol=2e-3)
    np.testing.assert_allclose(rows.force_N, np.tile([near, far], (100, 1)), atol=2e-3)


@pytest.mark.parametrize("level", Level)
def test_the_rig_is_the_same_from_both_ends(finger: Scenario, level: Level) -> None:
    """What motor 1 does to f_1 .. f_7, motor 2 does to f_7 .. f_1, where friction has no preferred direction."""
    plan = plan_experiment(finger)
    ramp = np.concatenate([np.full(300, 200.0), np.full(400, -130.0)])
    still = np.zeros_like(ramp)
    one = Rig(plan, level, (A, L)).advance(np.column_stack([ramp, still]))
    two = Rig(plan, level, (L, A)).advance(np.column_stack([still, ramp]))
    np.testing.assert_allclose(two.tension_N[:, ::-1], one.tension_N, atol=1e-6)
    np.testing.assert_allclose(two.force_N[:, ::-1], one.force_N, atol=1e-6)
    np.testing.assert_allclose(-np.diff(two.position_m[:, ::-1], axis=0), np.diff(one.position_m, axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "motor", "met", "not_met"), [("tension_1 >= 80", 0, 80.0, 79.9), ("tension_2<=4e1", 1, 40.0, 40.1)]
)
def test_a_condition_is_met_on_its_own_side_of_its_own_tension(
    text: str, motor: int, met: float, not_met: float
) -> None:
    states = columns(until=["", text, ""]).own_states()
    assert states is not None
    until = states[1].until
    assert until is not None
    far_off = {0: (0.0, 500.0), 1: (500.0, 0.0)}[1 - motor]
    for value, answer in ((met, True), (not_met, False)):
        ends = list(far_off)
        ends[motor] = value
        assert until.met((ends[0], ends[1])) is answer


def test_a_machine_takes_up_its_rate_keeps_it_until_its_condition_and_gives_it_up(finger: Scenario) -> None:
    state = ExperimentState(
        name="S",
        modes=(A, L),
        rates=(100.0, 0.0),
        until=EndTension(motor=1, rising=True, tension_N=40.0),
        at_most_s=9.0,
    )
    plan = replace(plan_experiment(finger), blend_s=0.01, rest_s=0.005)
    machine, given = Machine(state, plan), []
    while (now := machine.next_rates((30.0 if len(given) < 25 else 41.0, 0.0))) is not None:
        given.append(now[0])
    up, down = np.arange(1, 11) * 10.0, np.arange(9, -1, -1) * 10.0
    np.testing.assert_allclose(given, [*up, *np.full(15, 100.0), *down, *np.zeros(5)], atol=1e-9)
    assert (machine.met, machine.stopped_at) == (True, 25)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"motor_1": ["A", "A", "X"]}, r'motor_1\[2\] must be one of "A", "L", "A_h", "A_f", got "X"'),
        ({"until": ["", "tension_3 >= 80", ""]}, r'until\[1\] must read like "tension_1 >= 80".*got "tension_3 >= 80"'),
        ({"until": ["", "tension_1 >= nan", ""]}, r"until\[1\] must read like"),
        ({"until": ["", ""]}, "until must have one entry for each of the 3 states, got 2"),
        ({"at_most_s": None}, "at_most_s is missing: the states need the columns states, motor_1"),
        ({"at_most_s": [0.1, 0.0, 0.1]}, r"at_most_s\[1\] must be a finite number > 0, got 0.0"),
        ({"states": ["a", "b", "a"]}, 'states must differ, got "a" twice'),
        ({"states": ["a", "b,c", "d"]}, r'states\[1\] must be a name of letters and digits such as "S1", got "b,c"'),
        ({"motor_2_rate": [0.0, math.nan, 0.0]}, r"motor_2_rate\[1\] must be a finite number"),
        ({"low_tension_N": 95.0}, "high_tension_N must be > low_tension_N = 95, got 90.0"),
        ({"blend_s": 0.0}, "blend_s must be a finite number > 0, got 0.0"),
        ({"fine_segments": 0}, "fine_segments must be a whole number from 1 to 1000, got 0"),
    ],
)
def test_a_bad_table_is_refused_by_name_and_value(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        columns(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"high_tension_N": 900.0}, r"within the actuator's 0 to 200 N, got 30 to 900"),
        (
            {"motor_1_rate": [0.0, 1e6, 0.0]},
            r"motor_1_rate of pull must be within force_rate_max_N_per_s = \d+, got 1e\+06",
        ),
        ({"low_tension_N": 500.0, "high_tension_N": None}, r"low_tension_N must be > 0 and < high_tension_N = 150"),
    ],
)
def test_what_the_actuator_cannot_do_is_refused(finger: Scenario, changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=rf"finger.toml \[experiment\]: .*{message}"):
        plan_experiment(replace(finger, experiment=columns(**changes)))


def test_one_mass_is_enough_and_a_path_without_friction_has_no_reversal_to_cross(finger: Scenario) -> None:
    smooth = replace(finger.transmission.friction, mu_dynamic=0.0, mu_static=0.0)
    path = replace(finger.transmission.path, segments=1)
    scenario = replace(finger, transmission=replace(finger.transmission, friction=smooth, path=path))
    result = experiment(scenario)
    run = result.runs[Level.ELASTIC]
    assert run.tension_N.shape[1] == 7
    quiet = [done.last_row for done in run.passes]
    np.testing.assert_allclose(run.tension_N[quiet, 0], run.tension_N[quiet, -1], rtol=2e-3)


def test_a_held_force_stays_while_the_tendon_creeps_and_a_held_position_relaxes(finger: Scenario) -> None:
    """S4 on a level that relaxes: A_f keeps f_1 and the motor travels, A_h keeps the motor and loses tension."""
    found = {}
    for hold in Hold:
        scenario = replace(finger, experiment=replace(finger.experiment, hold=hold))
        _, run = run_machine(plan_experiment(scenario), Level.VISCOELASTIC)
        found[hold] = relaxation(run)["S4"]
    assert abs(found[Hold.FORCE].change_N) < 0.01
    assert found[Hold.POSITION].change_N < -1
    assert found[Hold.FORCE].travel_m > 10 * abs(found[Hold.POSITION].travel_m)
    assert found[Hold.FORCE].travel_m > 1e-4


def test_a_damper_acts_between_the_motor_and_its_moving_rest_position(finger: Scenario) -> None:
    """Where mass and rest position move alike, the damper carries nothing: the run is that without a damper.

    Motor 2 winds at a steady 5 mm/s and all of the tendon follows it, motor 1 has a force: after the start the tension
    at motor 2 does not depend on the damper of its mode, and with the damper against the frame it would by b v.
    """
    ends = []
    for damping in (0.0, 200.0):
        settings = replace(finger.experiment, load_damping_N_s_per_m=damping)
        plan = plan_experiment(replace(finger, experiment=settings))
        rig = Rig(plan, Level.ELASTIC, (A, L))
        rows = rig.advance(np.column_stack([np.zeros(3000), np.full(3000, 5e-3)]))
        speed = rows.velocity_m_per_s[-1, -1]
        assert speed == pytest.approx(-5e-3, rel=1e-3)
        ends.append(rows.force_N[-1, 1])
    assert ends[1] == pytest.approx(ends[0], abs=1e-3 * 200.0 * 5e-3)


def test_each_mode_has_its_own_damper(finger: Scenario) -> None:
    settings = replace(finger.experiment, load_damping_N_s_per_m=3.0, hold_damping_N_s_per_m=0.0)
    plan = plan_experiment(replace(finger, experiment=settings))
    dampings = {mode: plan.ends[mode].damping_N_s_per_m for mode in MotorMode}
    own = finger.transmission.actuator.damping_N_s_per_m
    assert own > 0
    assert dampings == {A: own, F: own, L: 3.0, H: 0.0}


def test_a_held_force_that_moves_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"motor_1_rate\[1\] must be 0 where motor_1 holds its force \(A_f\), got 200"
    ):
        columns(motor_1=["A", "A_f", "A"])
