"""Where features meet, the number reported is the number of a plant.

Drive {force, position} x path {arc, sections, moving joints} x reference {once, periodic}: each command's figure is
compared with a simulation written out here, period after period from rest, with the servo as the spring that it is.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.plant import FINE_REFINEMENT, FINE_SEGMENTS
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.compensators.tuning import tuning_of
from tendonff.compensator.export.judgement import judge, profiles_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.observe.observer import Observer
from tendonff.compensator.scenario.joints import SineJoint
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation, Run
from tendonff.compensator.studies.adapt.result import Scheme, Variation
from tendonff.compensator.studies.adapt.tension import TensionTrials, _case, _extended
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.run import design
from tendonff.compensator.studies.design.sweep.run import sweep
from tendonff.compensator.studies.tables.force import ForceTables
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.compiler import find_compiler
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulator, simulate

STEP = 4e-3
SERVO_N_PER_M = 5e4
PERIODS = 12
NAMES = ("none", "frictionless", "capstan", "inverse")
COMPENSATORS = tuple(compensator(name) for name in NAMES)
PATHS = {
    "arc": TendonPath(total_angle_rad=2.4, segments=4),
    "sections": TendonPath(
        total_angle_rad=2.4,
        segments=4,
        sections=(
            Section(name="sheath", angle_rad=1.5, length_m=0.2),
            Section(name="guide", angle_rad=0.9, length_m=0.1, mu_dynamic=0.12, mu_static=0.12),
        ),
    ),
    "moving": TendonPath(
        total_angle_rad=2.4,
        segments=4,
        sections=(
            Section(name="sheath", angle_rad=1.5, length_m=0.2),
            Section(name="knuckle", angle_rad=0.9, length_m=0.1, joint="k", angle_per_rad=1.0, length_per_rad_m=0.004),
        ),
    ),
}
ONCE = SineReference(
    initial_tension_N=30.0, amplitudes_N=(10.0,), frequencies_Hz=(1.25,), duration_s=0.8, fade_in_s=0.2
)
CYCLE = WaypointReference(times_s=(0.0, 0.3, 0.8), tensions_N=(20.0, 42.0, 20.0), shape=Shape.SMOOTH, periodic=True)
MOTION = SineJoint(amplitudes_rad=(0.3,), frequencies_Hz=(1.25,))


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((drive, path, reference), marks=marks, id=f"{drive}-{path}-{reference}")
        for drive in Drive
        for path in PATHS
        for reference, marks in (("once", ()), ("periodic", pytest.mark.compiler))  # two minutes each without
    ],
)
def scenario(request: pytest.FixtureRequest, generic: Transmission) -> Scenario:
    drive, path, reference = request.param
    servo = SERVO_N_PER_M if drive is Drive.POSITION else None
    friction = replace(generic.friction, mu_static=generic.friction.mu_dynamic, mu_static_release=None)
    transmission = replace(
        generic,
        path=PATHS[path],
        friction=replace(friction, mu_dynamic_release=None),
        actuator=replace(generic.actuator, drive=drive, servo_stiffness_N_per_m=servo, coulomb_N=0.5),
    )
    return Scenario(
        name="crossing",
        transmission=transmission,
        reference=ONCE if reference == "once" else CYCLE,
        run=Run(step_s=STEP, level=Level.PRESLIDING),
        joints={"k": MOTION} if path == "moving" else {},
    )


def rig(scenario: Scenario, mu: float = 1.0) -> Transmission:
    """The scenario's transmission in motion, with all friction coefficients times a factor."""
    whole = moved(scenario, 0.8, periodic=scenario.reference.periodic)
    friction, path = whole.friction, whole.path
    sections = tuple(
        s if s.mu_dynamic is None else replace(s, mu_dynamic=mu * s.mu_dynamic, mu_static=mu * s.mu_dynamic)
        for s in path.sections
    )
    changed = replace(friction, mu_dynamic=mu * friction.mu_dynamic, mu_static=mu * friction.mu_static)
    return replace(whole, friction=changed, path=replace(path, sections=sections))


def error_percent(
    whole: Transmission,
    profile: Profile,
    problem: Problem,
    *,
    level: Level = Level.PRESLIDING,
    masses: int | None = FINE_SEGMENTS,
    parts: int = 1,
) -> float:
    """RMS error on a plant that starts at rest; of a cycle in its last period."""
    reference, start = problem.reference, problem.reference.initial_tension_N
    chain = Chain.of(whole, level, masses)
    rest = chain.rest_state(start)
    is_servo = whole.actuator.drive is Drive.POSITION
    given = profile.command_m if is_servo else profile.force_N
    assert given is not None
    periods = PERIODS if reference.periodic else 1
    once = np.interp(np.arange((len(given) - 1) * parts) / parts, np.arange(len(given)), given)
    rows = np.append(np.tile(once, periods), given[-1])
    inputs = ChainInputs.of(len(rows), near_force_N=rows)
    if is_servo:  # the spring k_c1 carries the start tension where the command is zero
        chain = chain.with_end_stiffness(SERVO_N_PER_M, chain.far.stiffness_N_per_m)
        held = rest.near_position_m + start / SERVO_N_PER_M
        inputs = ChainInputs.of(len(rows), near_rest_m=held + rows)
    simulator = Simulator(chain, reference.step_s / parts, rest, inputs[:1])
    output = np.append(start, simulator.advance(inputs[1:]).tension_N[:, -1])[::parts][-len(given) :]
    error = output - reference.tension_N
    if reference.periodic:
        error = error[1:]  # row 0 is the last row once more
    return 100 * float(np.sqrt(np.mean(error**2))) / float(np.ptp(reference.tension_N))


def profile_of(problem: Problem, name: str) -> Profile:
    return with_motion(problem, name, compensator(name).profile(problem))


def close(value: float) -> object:
    """The steady state is found to a millionth of the range; the mean over a cycle has one row more or less."""
    return pytest.approx(value, rel=0.01, abs=2e-3)


def test_design_reports_the_worst_of_the_plants_that_it_names(scenario: Scenario) -> None:
    found = design(scenario, compensators=COMPENSATORS)
    problem = Problem.of(scenario)
    for name in ("none", "inverse"):
        profile = profile_of(problem, name)
        errors = [error_percent(rig(scenario, mu), profile, problem) for mu in (1.0, 0.9, 1.1)]
        assert found.expectation.worst_percent[name] == close(max(errors))
        own = error_percent(rig(scenario), profile, problem, masses=None)
        assert found.on_level(name, Level.PRESLIDING).score.rmse_percent_of_range == close(own)
        fine = error_percent(rig(scenario), profile, problem, parts=FINE_REFINEMENT)
        assert found.on_proof(name).score.rmse_percent_of_range == close(fine)


def test_compare_reports_the_same_worst_case_and_the_error_on_other_levels(scenario: Scenario) -> None:
    found = compare(scenario, compensators=COMPENSATORS)
    problem = Problem.of(scenario)
    profile = profile_of(problem, "inverse")
    worst = max(error_percent(rig(scenario, mu), profile, problem) for mu in (1.0, 0.9, 1.1))
    assert found.bands["inverse", Level.PRESLIDING].worst.rmse_percent_of_range == close(worst)
    other = error_percent(rig(scenario), profile, problem, level=Level.VISCOELASTIC, masses=None, parts=4)
    entry = found.entry("inverse", Level.PRESLIDING, Level.VISCOELASTIC)
    assert entry.rmse_percent_of_range == close(other)


def test_a_table_is_judged_on_the_plants_or_refused_where_joints_move(scenario: Scenario) -> None:
    if scenario.joints:
        with pytest.raises(InputError, match="no table can hold a path that moves"):
            ForceTables.made(scenario)
        found = design(scenario, compensators=(*COMPENSATORS, CompensationTable()))
        assert "table" not in found.profiles
        assert any(text.startswith("table: no table can hold") for text in found.warnings)
        return
    found, problem = ForceTables.made(scenario), Problem.of(scenario)
    exported = CompensationTable(found.tables[0].built.table)
    profile = with_motion(problem, "table", exported.profile(problem))
    worst = max(error_percent(rig(scenario, mu), profile, problem) for mu in (1.0, 0.9, 1.1))
    assert found.expectation.worst_percent["table"] == close(worst)


def test_a_sweep_reports_each_unit_and_the_worst_case_of_a_design(scenario: Scenario, tmp_path: Path) -> None:
    unsure = replace(scenario, robust=Uncertainty(mu=0.2, samples=3))
    found = sweep(unsure, tmp_path / "s", samples=2, compensators=("none", "inverse"))
    problem = Problem.of(unsure)
    profile = profile_of(problem, "inverse")
    for row in found.rows:
        assert row.percent[1] == close(error_percent(rig(scenario, row.values[0]), profile, problem))
    worst = max(error_percent(rig(scenario, mu), profile, problem) for mu in (1.0, 0.8, 1.2))
    assert found.expectation is not None
    assert found.expectation.worst_percent["inverse"] == close(worst)


def test_exported_modules_are_judged_by_what_they_do_to_the_finer_plant(scenario: Scenario) -> None:
    problem = Problem.of(scenario)
    profiles = profiles_of(problem, None, names=("inverse",))
    judged = {each.module: each.score for each in judge(problem, profiles)}
    for name, profile in (("inverse", profiles["inverse"]), ("none", profile_of(problem, "none"))):
        fine = error_percent(rig(scenario), profile, problem, parts=FINE_REFINEMENT)
        assert judged[name].rmse_percent_of_range == close(fine)


@pytest.mark.compiler
def test_an_observer_sees_the_output_of_the_finer_plant_in_its_bounds(scenario: Scenario) -> None:
    problem = Problem.of(scenario)
    chain = Chain.of(rig(scenario), Level.PRESLIDING, FINE_SEGMENTS).led_by_tension()
    start, step = problem.reference.initial_tension_N, problem.reference.step_s
    given = np.tile(invert(chain, problem.reference.tension_N, step, initial_tension_N=start).force_N, 2)
    given[len(given) // 2 :] = given[len(given) // 2 - 1]  # and a hold
    given = np.maximum(given, 1.0)
    plant = simulate(chain, given, step, initial_tension_N=start).require()
    motion = problem.chain.motion
    angles = np.zeros((len(given), 0)) if motion is None else motion.at(plant.time_s)
    observer = Observer(scenario)
    rows = [observer.step(tension_N=float(t), joints=angle).tension_N for t, angle in zip(given, angles, strict=True)]
    value, low, high = np.array([(row.value, row.low, row.high) for row in rows]).T
    error = 100 * float(np.sqrt(np.mean((value - plant.output_tension_N) ** 2))) / float(np.ptp(plant.output_tension_N))
    assert error <= 2.0
    assert np.all((low <= plant.output_tension_N + 1e-9) & (plant.output_tension_N <= high + 1e-9))


@pytest.mark.compiler
def test_adapt_judges_the_plain_inverse_as_its_plant_does_or_refuses(scenario: Scenario) -> None:
    if find_compiler() is None:
        pytest.skip("no C compiler")
    settings = Adaptation(sensor=Sensor.OUTPUT_TENSION)
    asked = replace(scenario, adaptation=settings)
    if scenario.transmission.actuator.drive is Drive.POSITION:
        with pytest.raises(InputError, match="self-tuning needs a force drive"):
            TensionTrials.run(asked)
        return
    problem = Problem.of(asked)
    if problem.reference.periodic:  # a longer run repeats the cycle
        rows = len(problem.reference.tension_N) - 1
        _, longer = _extended(problem, 2.5 * rows * STEP)
        assert np.array_equal(longer[rows : 2 * rows], problem.reference.tension_N[:-1])
    tuning = tuning_of(problem, settings)
    case = _case(problem, tuning, None, Variation(name="own", mu=1.2, duration_s=0.1), (Scheme.FEEDFORWARD,))
    plain = case.traces[Scheme.FEEDFORWARD].rmse_percent
    live = replace(problem, live=True, reference=replace(problem.reference, periodic=False))
    force = compensator("inverse").profile(live).force_N
    expected = error_percent(rig(scenario, 1.2), Profile(force_N=force), live, parts=4)
    assert plain == pytest.approx(expected, rel=0.03)
    assert plain > 1
    assert math.isfinite(case.traces[Scheme.FEEDFORWARD].settled_percent)
