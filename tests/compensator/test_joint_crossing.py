"""A joint in every command: what is reported is what a plant does, or the command refuses with a reason.

Drive {loop, pair} x path {arc, sections that bend with the joint} x reference {once, periodic}: every two of them meet.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.table import BOUND_SHARE
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.adapt import loop as study
from tendonff.compensator.studies.adapt.loop import LoopTrials
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.compensator.studies.design.sweep.run import sweep
from tendonff.compensator.studies.tables.motor import MotorTables
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.path import JointMotion
from tendonff.ocp.joint.invert import invert_joint
from tendonff.ocp.joint.simulate import simulate_joint
from tendonff.ocp.joint.start import joint_problem

pytestmark = pytest.mark.compiler
STEP, PERIODS, MASSES = 4e-3, 5, 40
DRIVES = {
    "loop": 'kind = "loop"\npretension_N = 12.0\n',
    "pair": 'kind = "pair"\nleast_tension_N = 3.0\n',
}
PATHS = {
    "arc": "[path]\ntotal_angle_rad = 2.0\nsegments = 3\n",
    "bent": '[path]\nsegments = 4\n[[path.sections]]\nname = "tube"\nangle_rad = 1.2\nlength_m = 0.1\n'
    '[[path.sections]]\nname = "finger"\nangle_rad = 0.8\nlength_m = 0.05\njoint = "q"\nangle_per_rad = 0.5\n'
    "length_per_rad_m = 0.001\n",
}
REFERENCES = {
    "once": 'kind = "waypoints"\ntimes_s = [0.0, 0.15, 0.3]\nangles_rad = [0.0, 0.5, 0.2]\n',
    "periodic": 'kind = "sine"\namplitudes_rad = [0.4]\nfrequencies_Hz = [2.5]\nduration_s = 0.4\nperiodic = true\n',
}
TEXT = """schema = 1
name = "crossing"
[joints.q]
kind = "driven"
inertia_kg_m2 = 4.0e-5
damping_N_m_s_per_rad = 5.0e-3
[tendon]
mass_kg = 0.001
stiffness_N_per_m = 2.0e4
relaxing_stiffness_N_per_m = 0.0
damping_N_s_per_m = 0.05
[friction]
mu_dynamic = 0.2
mu_static = 0.2
viscous_N_s_per_m = 0.0
bristle_stiffness_N_per_m = 1.0e6
soft_bristle_stiffness_N_per_m = 1.0e5
[[tendons]]
name = "flexor"
moment_arm_m = 0.008
[[tendons]]
name = "extensor"
moment_arm_m = -0.008
[run]
step_s = 4.0e-3
level = "presliding"
[robust]
stiffness = 0.2
"""


PAIRWISE = [
    ("loop", "arc", "once"),
    ("loop", "bent", "periodic"),
    ("pair", "arc", "periodic"),
    ("pair", "bent", "once"),
]


@pytest.fixture(scope="module", params=PAIRWISE, ids="-".join)
def scenario(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> JointScenario:
    return written(tmp_path_factory.mktemp("crossing"), *request.param)


def written(folder: Path, drive: str, path: str, reference: str) -> JointScenario:
    file = folder / "joint.toml"
    parts = (PATHS[path], f"[drive]\ndrum_radius_m = 0.008\n{DRIVES[drive]}", f"[reference]\n{REFERENCES[reference]}")
    file.write_text(TEXT + "".join(parts), "utf-8")
    return load_scenario(file)


def error_percent(
    scenario: JointScenario,
    rig: Mechanism,
    command: np.ndarray,
    *,
    masses: int | None = MASSES,
    parts: int = 1,
    level: Level = Level.PRESLIDING,
) -> float:
    """RMS error on a plant that starts at rest; of a cycle in its last period, led in gently."""
    task = JointTask.of(scenario)
    wanted, motion = task.sampled.wanted, task.sampled.motion
    periods = PERIODS if scenario.reference.periodic else 1
    rows = (len(wanted) - 1) * parts
    once = np.column_stack([np.interp(np.arange(rows) / parts, np.arange(len(wanted)), c) for c in command.T])
    turned = np.vstack([*(once for _ in range(periods)), command[-1:]])
    if periods > 1:
        turned = turned * np.minimum(np.arange(len(turned)) / (0.1 * rows), 1.0)[:, None]
    problem = joint_problem(rig, level, motion, segments=masses)
    reached = simulate_joint(problem, turned, STEP / parts).require().angle_rad[::parts][-len(wanted) :]
    return 100 * float(np.sqrt(np.mean((reached - wanted) ** 2))) / float(np.ptp(wanted))


def close(value: float) -> object:
    return pytest.approx(value, rel=1e-3, abs=1e-4)


def test_design_reports_the_worst_of_the_plants_that_it_names(scenario: JointScenario) -> None:
    found, task = design_motors(scenario), JointTask.of(scenario)
    for name in ("robust",):
        command = task.answer(compensator_of(task, name))
        rigs = [with_numbers(scenario.mechanism, {"stiffness": factor}) for factor in (1.0, 0.8, 1.2)]
        errors = [error_percent(scenario, rig, command) for rig in rigs]
        assert found.expectation.worst_percent[name] == close(max(errors))
    fine = error_percent(scenario, scenario.mechanism, found.profiles["inverse"].motor_rad, parts=10)
    assert found.percent(found.profiles["inverse"].rms) == close(fine)


def test_compare_reports_the_same_worst_case_and_the_error_on_other_levels(scenario: JointScenario) -> None:
    found, task = compare(scenario), JointTask.of(scenario)
    assert set(found.expectation.bands) == {"linear", "static", "inverse", "robust"}
    command = task.answer(compensator_of(task, "inverse"))
    softer = error_percent(scenario, with_numbers(scenario.mechanism, {"stiffness": 0.8}), command)
    band = found.bands["inverse", Level.PRESLIDING]
    assert band.scores[1].rmse_percent_of_range == close(softer)
    other = error_percent(scenario, scenario.mechanism, command, masses=None, parts=4, level=Level.ELASTIC)
    assert found.entry("inverse", Level.PRESLIDING, Level.ELASTIC).rmse_percent_of_range == close(other)


def test_a_sweep_reports_each_unit(scenario: JointScenario, tmp_path: Path) -> None:
    found = sweep(scenario, tmp_path / "s", samples=2, compensators=("linear", "inverse"))
    task = JointTask.of(scenario)
    command = task.answer(compensator_of(task, "inverse"))
    for row in found.rows:
        rig = with_numbers(scenario.mechanism, {"stiffness": row.values[0]})
        assert row.percent[1] == close(error_percent(scenario, rig, command))
    assert found.expectation is not None
    assert ". Tracking error up to " in found.headline
    assert " deg RMS" in found.headline


def test_a_grid_designs_anew_at_every_point(tmp_path: Path) -> None:
    scenario, folder = written(tmp_path, *PAIRWISE[0]), tmp_path / "s"
    over = ["--over", "tendon.stiffness_N_per_m=1e4:3e4:2", "--compensators", "inverse"]
    assert run(["sweep", str(scenario.source), *over, "--out", str(folder)]) == 0
    names, soft, _ = (line.split(",") for line in (folder / "samples.csv").read_text("utf-8").splitlines())
    assert names[1:] == ["tendon.stiffness_N_per_m", "inverse_rmse_percent_of_range", "inverse_peak_error_rad"]
    softer = replace(scenario, mechanism=with_numbers(scenario.mechanism, {"tendon.stiffness_N_per_m": 1e4}))
    task = JointTask.of(softer)
    command = task.answer(compensator_of(task, "inverse"))
    assert float(soft[2]) == close(error_percent(softer, softer.mechanism, command))


def test_a_table_is_the_quasi_static_law_and_judged_on_the_same_plants(scenario: JointScenario, tmp_path: Path) -> None:
    found, task = MotorTables.made(scenario), JointTask.of(scenario)
    static = task.expect({"static": task.answer(compensator_of(task, "static"))}).best
    assert found.law.error_rad <= BOUND_SHARE * np.ptp(task.wanted)
    assert found.expectation.worst_percent["table"] == pytest.approx(
        static.worst.rmse_percent_of_range, rel=0.1, abs=0.2
    )
    found.write(tmp_path / "t")
    names, *rows = (tmp_path / "t" / "table.csv").read_text("utf-8").splitlines()
    loop = scenario.mechanism.drive.kind is DriveKind.LOOP
    assert names == ("angle_rad,branch,motor_rad" if loop else "angle_rad,branch,motor_flexor_rad,motor_extensor_rad")
    assert len(rows) == 2 * len(found.law.angle_rad)


def test_a_table_is_refused_where_it_has_no_meaning(tmp_path: Path) -> None:
    text = written(tmp_path, *PAIRWISE[1]).source.read_text("utf-8").replace('joint = "q"', 'joint = "wrist"')
    other = '[joints.wrist]\nkind = "sine"\namplitudes_rad = [0.1]\nfrequencies_Hz = [2.5]\n'
    moved = parse_joint_scenario(text + other, tmp_path / "wrist.toml")
    with pytest.raises(InputError, match="no table can hold a path that other joints move"):
        MotorTables.made(moved)
    assert MotorTables.made(moved, pose_rad={"wrist": 0.05}).nodes > 0
    with pytest.raises(InputError, match="the nodes must reach over the reference"):
        MotorTables.made(moved, pose_rad={"wrist": 0.05}, angles_rad=(0.0, 0.01))


def test_a_table_has_the_nodes_and_speeds_that_are_asked_for(examples: Path, tmp_path: Path) -> None:
    """Damping leans on the side that the joint turns to, the more the faster."""
    scenario = load_scenario(examples / "hand_joint.toml")
    nodes = np.linspace(-0.6, 1.7, 6)
    found = MotorTables.made(scenario, level=Level.ELASTIC, angles_rad=nodes, rates=(0.5, 4.0))
    assert np.array_equal(found.law.angle_rad, nodes)
    assert (found.law.motor_rad["up"][1] > found.law.motor_rad["up"][0]).all()
    assert (found.law.motor_rad["down"][1] < found.law.motor_rad["down"][0]).all()
    found.write(tmp_path / "t")
    names, *rows = (tmp_path / "t" / "table.csv").read_text("utf-8").splitlines()
    assert names == "angle_rad,branch,speed_rad_per_s,motor_rad"
    assert len(rows) == found.nodes == 2 * 2 * 6
    assert "[TFF_JOINT_TABLE_SPEEDS][TFF_JOINT_TABLE_NODES]" in (tmp_path / "t" / "table.h").read_text("utf-8")


def test_comparison_and_sweep_write_their_pages(tmp_path: Path) -> None:
    scenario = written(tmp_path, *PAIRWISE[0])
    assert run(["compare", str(scenario.source), "--out", str(tmp_path / "c")]) == 0
    summary = json.loads((tmp_path / "c" / "summary.json").read_text("utf-8"))
    assert summary["matrix"][0].keys() >= {"peak_error_rad", "rmse_percent_of_range"}
    assert "Largest error [deg]" in (tmp_path / "c" / "report.html").read_text("utf-8")
    assert {path.suffix for path in (tmp_path / "c").iterdir()} >= {".html", ".csv", ".svg", ".json"}


def test_adapt_judges_the_plain_inverse_as_its_plant_does_or_refuses(
    scenario: JointScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = parse_joint_scenario(f'{scenario.text}\n[adaptation]\nsensor = "joint_angle"\n', scenario.source)
    if scenario.mechanism.drive.kind is DriveKind.PAIR:
        with pytest.raises(InputError, match="a pair has none"):
            LoopTrials.run(asked)
        return
    off = study.LoopVariation(name="friction +30 %", mu=1.3)
    monkeypatch.setattr(study, "VARIATIONS", (off,))
    monkeypatch.setattr(study, "SHORTEST_S", 3.0)
    monkeypatch.setattr(study, "SETTLED_S", 2.0)
    found = LoopTrials.run(asked)
    rig = with_numbers(scenario.mechanism, {"mu": 1.3})
    motion = JointMotion(
        names=("q",), time_s=np.append(0.0, found.time_s), angle_rad=np.append([0.0], found.reference_rad)[:, None]
    )
    command = invert_joint(joint_problem(scenario.mechanism, Level.PRESLIDING, motion), motion.angle_rad[:, 0], STEP)
    fine = np.arange(2 * len(found.time_s) + 1) / 2
    motor = np.interp(fine, np.arange(len(command.motor_rad)), command.motor_rad[:, 0])
    reached = simulate_joint(joint_problem(rig, Level.PRESLIDING, motion, segments=MASSES), motor, STEP / 2).require()
    (case,) = found.cases
    assert case.plain_rad == pytest.approx(reached.angle_rad[2::2] - found.reference_rad, abs=1e-9)
    # A cycle that sets out at full speed swings: more is off there than friction.
    most = 1.05 if scenario.reference.periodic else 0.5
    assert case.settled_deg(case.tuned_rad) < most * case.settled_deg(case.plain_rad)
