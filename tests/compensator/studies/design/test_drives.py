"""Drives: travel, commands, limits of the motion, cycles and positions, on a plant that shares no code with them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import verify
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.joints import SineJoint
from tendonff.compensator.scenario.reference import Hold, Quantity, Shape, WaypointReference
from tendonff.compensator.scenario.settings import Run
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.drive_use import DriveUse
from tendonff.compensator.studies.design.run import design
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive, Motor
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.ocp.tendon import periodic
from tests.independent_plant import respond

pytestmark = pytest.mark.compiler
REFERENCE = WaypointReference(times_s=(0, 0.3, 0.45, 0.7), tensions_N=(40.0, 140.0, 140.0, 70.0), shape=Shape.SMOOTH)


@pytest.fixture(scope="module")
def cable(examples):
    scenario = load_scenario(examples / "bowden.toml")
    return replace(scenario, reference=REFERENCE, run=Run(step_s=1e-3, level=Level.PRESLIDING))


@pytest.fixture(scope="module")
def coarse(cable):
    """For profiles that are searched."""
    return replace(cable, run=Run(step_s=2e-3, level=Level.PRESLIDING))


def answer(scenario, name="inverse"):
    problem = Problem.of(scenario)
    return problem, with_motion(problem, name, compensator(name).profile(problem))


def actuated(scenario, **values):
    rig = scenario.transmission
    return replace(scenario, transmission=replace(rig, actuator=replace(rig.actuator, **values)))


def percent(error, reference):
    return 100 * float(np.sqrt(np.mean(error**2))) / reference.range_N


def test_the_travel_of_the_inverse_is_that_of_an_independent_plant(cable, record_property):
    problem, profile = answer(cable)
    seen = respond(cable.transmission, problem.reference.time_s, profile.force_N, 40.0, masses=16)
    error = np.abs(seen.actuator_m - profile.travel_m).max() / np.ptp(profile.travel_m)
    record_property("figure", f"travel of the inverse on an independent plant: {100 * error:.2g} % of the stroke")
    assert error < 5e-3
    assert percent(seen.output_N - problem.reference.tension_N, problem.reference) < 0.5


def test_a_servo_driven_by_the_command_delivers_the_reference_on_an_independent_plant(cable, record_property):
    servo = actuated(cable, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    problem, profile = answer(servo)
    seen = respond(servo.transmission, problem.reference.time_s, profile.command_m, 40.0, masses=16, position=True)
    error = percent(seen.output_N - problem.reference.tension_N, problem.reference)
    record_property("figure", f"command of the inverse on an independent servo: {error:.2g} % of range")
    assert error < 0.5
    at_rest = profile.travel_m + (profile.force_N - 40.0) / 2e5
    assert profile.command_m == pytest.approx(at_rest, abs=1e-12)


def test_command_and_force_are_two_names_of_one_motion(cable):
    servo = actuated(cable, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    for name in ("inverse", "capstan"):
        problem, profile = answer(servo, name)
        commanded = verify(Plant(servo.transmission, Level.PRESLIDING), name, profile, problem.reference)
        forced = verify(Plant(cable.transmission, Level.PRESLIDING), name, profile, problem.reference)
        assert commanded.output_N == pytest.approx(forced.output_N, abs=1e-5)


def test_without_friction_the_uncompensated_command_is_that_of_springs_in_series(cable):
    """x = (T - T0) (1/k_l + 1/k1 + 1/k_c1): load, tendon and servo."""
    servo = actuated(cable, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    problem, profile = answer(servo, "none")
    rig = cable.transmission
    series = 1 / rig.load.stiffness_N_per_m + 1 / rig.tendon.stiffness_N_per_m + 1 / 2e5
    assert profile.command_m == pytest.approx((problem.reference.tension_N - 40.0) * series, rel=1e-9, abs=1e-12)


def seen_under(scenario, names):
    """Error and motion of profiles on the independent plant: by name, error in percent of range, speed, force."""
    found = {}
    for name in names:
        problem, profile = answer(scenario, name)
        reference = problem.reference
        seen = respond(scenario.transmission, reference.time_s, profile.force_N, 40.0, masses=16)
        speed = np.diff(seen.actuator_m, prepend=seen.actuator_m[0]) / scenario.run.step_s
        found[name] = percent(seen.output_N - reference.tension_N, reference), speed, profile.force_N
    return found


@pytest.mark.parametrize(
    ("share", "most"), [*(pytest.param(share, 0.6, marks=pytest.mark.nightly) for share in (0.85, 0.6)), (0.4, None)]
)
def test_a_speed_limit_is_kept_on_an_independent_plant_and_costs_less_than_clipping(
    cable, share, most, record_property
):
    """At 40 % of the need no profile can have 0.6 of the clipped inverse's error: a lower bound stands in for it."""
    problem, free = answer(cable)
    speed = share * float(np.abs(np.diff(free.travel_m)).max()) / 1e-3
    names = ("inverse", "optimal") if most else ("inverse", "capstan", "optimal")
    seen = seen_under(actuated(cable, speed_max_m_per_s=speed), names)
    for _, found, _ in seen.values():
        assert np.abs(found).max() < 1.01 * speed
    clipped, best = seen["inverse"][0], seen["optimal"][0]
    record_property("figure", f"speed limit at {100 * share:g} %: clipped {clipped:.3g}, optimal {best:.3g} %")
    assert best < (most or 0.9) * clipped
    if most:
        return
    servo = actuated(cable, drive=Drive.POSITION, servo_stiffness_N_per_m=1e7)
    time_s = problem.reference.time_s
    fastest = respond(servo.transmission, time_s, speed * time_s, 40.0, masses=16, position=True).output_N
    missed = percent(np.maximum(problem.reference.tension_N - fastest, 0.0), problem.reference)
    assert 0.6 * clipped < missed < best < 1.25 * missed  # at full speed from the start the rise is missed by so much


def test_a_torque_speed_line_is_kept_on_an_independent_plant_and_costs_less_than_clipping(coarse, record_property):
    _, free = answer(coarse)
    speed = np.diff(free.travel_m, prepend=0.0) / coarse.run.step_s
    top_N, top = free.force_N.max(), np.abs(speed).max()
    less = 0.85 * float(np.max(free.force_N / top_N + speed / top))
    stall_N, no_load, radius = less * top_N, less * top, 0.02
    motor = Motor(
        drum_radius_m=radius,
        gear_ratio=1.0,
        inertia_kg_m2=0.8 * radius**2,
        torque_max_N_m=600 * radius,
        speed_max_rad_per_s=10 * top / radius,
        stall_torque_N_m=stall_N * radius,
        no_load_speed_rad_per_s=no_load / radius,
    )
    seen = seen_under(actuated(coarse, motor=motor, **motor.at_the_drum), ("inverse", "optimal"))
    for _, found, force in seen.values():
        assert np.max(force / stall_N + found / no_load) < 1.01
    clipped, best = seen["inverse"][0], seen["optimal"][0]
    record_property("figure", f"torque-speed line at 85 %: clipped {clipped:.3g}, optimal {best:.3g} %")
    assert best < 0.65 * clipped


def test_a_travel_limit_is_kept(coarse):
    _, free = answer(coarse)
    short = actuated(coarse, travel_max_m=0.9 * float(free.travel_m.max()))
    for name in ("inverse", "optimal"):
        _, kept = answer(short, name)
        assert kept.travel_m.max() < 1.01 * 0.9 * free.travel_m.max()


CYCLE = WaypointReference(
    times_s=(0, 0.2, 0.45, 0.6), tensions_N=(0.0, 150.0, 0.0, 0.0), shape=Shape.SMOOTH, periodic=True
)


@pytest.mark.parametrize("drive", Drive)
def test_a_cycle_repeats_on_the_plant_and_holds_a_least_tension(cable, drive):
    stiffness = 2e5 if drive is Drive.POSITION else None
    scenario = actuated(replace(cable, reference=CYCLE), drive=drive, servo_stiffness_N_per_m=stiffness)
    problem, profile = answer(scenario)
    assert "raised to" in problem.reference.warnings[0]
    assert problem.reference.tension_N.min() == pytest.approx(0.02 * 150, rel=0.1)
    assert profile.force_N[0] == pytest.approx(profile.force_N[-1], abs=1e-6)
    found = verify(Plant(scenario.transmission, Level.PRESLIDING), "inverse", profile, problem.reference)
    assert found.score.rmse_percent_of_range < 0.02
    assert found.slack is None


def test_an_inverse_that_does_not_repeat_is_said(cable, monkeypatch):
    scenario = replace(cable, reference=CYCLE)
    assert Problem.of(scenario).notes == ()
    monkeypatch.setattr(periodic, "MOST_CYCLES", 2)  # from rest, relaxation needs more
    (warning,) = Problem.of(scenario).notes
    assert "after 2 cycles the state still changes" in warning
    assert design(scenario, compensators=(compensator("inverse"),)).warnings.count(warning) == 1
    compared = compare(scenario, compensators=[compensator(name) for name in ("none", "capstan", "inverse")])
    assert f"designed on presliding: {warning}" in compared.warnings


def test_a_cycle_is_reached_by_an_independent_plant_that_starts_at_rest(cable):
    problem, profile = answer(replace(cable, reference=CYCLE))
    force = np.concatenate([profile.force_N[:-1], profile.force_N])
    time = np.arange(len(force)) * 1e-3
    seen = respond(cable.transmission, time, force, problem.reference.initial_tension_N, masses=16)
    second = seen.output_N[-len(profile.force_N) :]
    assert percent(second - problem.reference.tension_N, problem.reference) < 0.5


LIFT = WaypointReference(
    times_s=(0, 0.3, 0.5),
    positions_m=(0.0, 0.015, 0.005),
    shape=Shape.SMOOTH,
    quantity=Quantity.POSITION,
    initial_tension_N=40.0,
)


def test_a_wanted_position_arrives_at_the_load(cable):
    problem, profile = answer(replace(cable, reference=LIFT))
    own = verify(Plant(cable.transmission, Level.PRESLIDING), "inverse", profile, problem.reference)
    assert own.score.peak_error < 1e-8  # m
    seen = respond(cable.transmission, problem.reference.time_s, profile.force_N, 40.0, masses=16)
    assert np.abs(seen.load_m - problem.reference.position_m).max() < 5e-3 * 0.015


def softer_or_stiffer(scenario, **values):
    """The same, its load known to 15 %."""
    spread = Uncertainty(mu=0.05, samples=5, spread=(Spread(keys=("load.stiffness_N_per_m",), half_width=0.15),))
    return replace(scenario, robust=spread, **values)


@pytest.mark.parametrize("stiffness", [None, 2e5], ids=["force", "servo"])
def test_a_position_is_expected_as_far_off_as_the_load_of_an_independent_plant(coarse, stiffness, record_property):
    """What is promised is the error of the position, not of the tension that it takes."""
    lift = softer_or_stiffer(coarse, reference=LIFT)
    if stiffness is not None:
        lift = actuated(lift, drive=Drive.POSITION, servo_stiffness_N_per_m=stiffness)
    problem, profile = answer(lift)
    found = problem.expect({"inverse": profile})
    at = found.best.worst_sample.system
    servo = {} if stiffness is None else {"position": True}
    given = profile.setpoint(lift.transmission.actuator.drive)
    seen = respond(at, problem.reference.time_s, given, 40.0, masses=16, **servo)
    off = (
        100 * np.sqrt(np.mean((seen.load_m - problem.reference.position_m) ** 2)) / np.ptp(problem.reference.position_m)
    )
    said = found.best.worst.rmse_percent_of_range
    record_property("figure", f"position: expected {said:.3g} %, independent plant {off:.3g} % of its range")
    assert said == pytest.approx(off, rel=0.1)
    assert " mm RMS" in found.headline("inverse", "next")


def test_a_design_of_a_position_is_scored_recommended_and_written_as_one(coarse, tmp_path):
    slow = actuated(softer_or_stiffer(coarse, reference=LIFT), force_rate_max_N_per_s=2000.0)
    result = design(slow, compensators=[compensator(name) for name in ("none", "inverse", "optimal")])
    wanted = result.reference.position_m
    off = result.on_proof("inverse").response.load_m - wanted
    assert result.on_proof("inverse").score.rmse == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-12)
    worst = {name: band.worst.rmse for name, band in result.expectation.bands.items()}
    assert worst["optimal"] < worst["inverse"]  # made for the position over all loads
    result.write(tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["reference_range_m"] == pytest.approx(0.015)
    assert summary["expectation"]["rmse_m"] == pytest.approx(worst["optimal"])
    assert {each["key"] for each in summary["expectation"]["contributions"]} == {"mu", "load.stiffness_N_per_m"}
    columns = np.genfromtxt(tmp_path / "profile.csv", delimiter=",", names=True)
    assert columns["reference_m"] == pytest.approx(wanted, abs=1e-9)


def test_a_kept_hold_is_named_with_its_cost_and_a_live_inverse_knows_none(cable):
    holding = replace(cable, reference=replace(REFERENCE, hold=Hold.KEEP))
    problem, profile = answer(holding)
    assert np.ptp(profile.force_N[305:445]) < 1e-9
    assert problem.kept.drift_N < 0.02 * problem.reference.range_N
    exact, live = Problem.of(cable), replace(problem, live=True)
    assert live.kept is None
    assert np.ptp(live.inversion.force_N[305:445]) > 10.0
    assert live.inversion.force_N[:690] == pytest.approx(exact.inversion.force_N[:690], abs=1e-6)


def test_a_cycle_whose_seam_is_a_reversal_is_designed(coarse):
    """The force of its first row balances a state in motion: no tension of a rest, and below 0 here."""
    triangle = WaypointReference(times_s=(0, 0.2, 0.4), tensions_N=(5.0, 130.0, 5.0), shape=Shape.LINEAR, periodic=True)
    result = design(replace(coarse, reference=triangle), compensators=[compensator("none"), compensator("inverse")])
    assert Problem.of(result.scenario).inversion.force_N[0] < 0
    assert np.isfinite(result.stick_slip.expected_error_N)


def test_a_hold_is_not_kept_in_a_cycle():
    with pytest.raises(ParameterError, match='hold = "keep" is for references that come to rest'):
        replace(CYCLE, hold=Hold.KEEP)


def test_the_motor_gets_force_times_radius_over_gear():
    motor = Motor(drum_radius_m=0.02, gear_ratio=4.0, inertia_kg_m2=1e-5, torque_max_N_m=1.0, speed_max_rad_per_s=100.0)
    use = DriveUse(
        name="inverse",
        travel_m=np.array([0.0, 0.01]),
        speed_m_per_s=np.array([0.0, 0.1]),
        force_N=np.array([100.0, 160.0]),
    )
    assert use.torque_N_m(motor) == pytest.approx([0.5, 0.8])
    assert use.angle_rad(motor) == pytest.approx([0.0, 2.0])
    assert use.power_W == pytest.approx([0.0, 16.0])
    assert use.load_of_the_line(motor) == pytest.approx(0.8)


def test_a_cycle_that_fits_uncertain_friction_is_better_in_the_worst_case(cable):
    """[robust] on a cycle: every sample in its own steady state."""
    slow = actuated(replace(cable, reference=CYCLE), force_rate_max_N_per_s=3000.0)
    uncertain = replace(slow, robust=replace(slow.robust, mu=0.2, samples=3))
    problem = Problem.of(uncertain)
    assert len(problem.doubt.samples) == 3
    profiles = {name: compensator(name).profile(problem) for name in ("inverse", "optimal")}
    forces = {name: profile.force_N for name, profile in profiles.items()}
    assert all(departure.end_s <= 0.6 for departure in profiles["optimal"].tracking.departures)
    assert profiles["optimal"].tracking.departures
    nominal = compensator("optimal").profile(Problem.of(slow))
    bands = problem.expect(profiles | {"nominal": nominal}).bands
    assert bands["optimal"].worst.rmse < 0.8 * bands["inverse"].worst.rmse
    assert bands["optimal"].worst.rmse < bands["nominal"].worst.rmse
    assert forces["optimal"][0] == pytest.approx(forces["optimal"][-1], abs=1e-9)


@pytest.fixture(scope="module")
def exosuit(examples):
    return load_scenario(examples / "exosuit.toml")


def test_a_joint_with_the_period_of_the_cycle_is_followed(exosuit, record_property):
    scenario = actuated(exosuit, force_rate_max_N_per_s=1e5)
    problem = Problem.of(scenario)
    profile = compensator("inverse").profile(problem)
    path = problem.chain.path_at(np.array([0.3, 1.3, -0.7]))
    assert np.ptp(path.gained_m, axis=0).max() < 1e-12  # it repeats
    errors = [
        verify(plant, "inverse", profile, problem.reference).score.rmse_percent_of_range
        for plant in (
            Plant(problem.transmission, Level.PRESLIDING),
            Plant(problem.transmission, Level.PRESLIDING, 40, 4),
        )
    ]
    record_property(
        "figure", f"exosuit cycle with its joints: {errors[0]:.2g} %, on 40 masses {errors[1]:.2g} % of range"
    )
    assert errors[0] < 0.01
    assert errors[1] < 0.2
    still = replace(problem.transmission, motion=problem.transmission.motion.held(np.zeros(2)))
    ignorant = compensator("inverse").profile(replace(problem, transmission=still))
    plant = Plant(problem.transmission, Level.PRESLIDING)
    assert verify(plant, "", ignorant, problem.reference).score.rmse_percent_of_range > 2


@pytest.mark.usefixtures("unpainted")
@pytest.mark.nightly
def test_the_motor_of_the_exosuit_is_sized(exosuit, tmp_path):
    assert run(["design", str(exosuit.source), "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    slack = [text for text in summary["warnings"] if "slack" in text]
    assert len(slack) == 1  # of all profiles together
    assert "slack at the actuator's end under none, capstan, smoothed: " in slack[0]
    page = (tmp_path / "report.html").read_text()
    assert "The drive suffices for these profiles; smallest margin:" in page
    assert "Not judged, since not given: the torque-speed line" in page
    assert "Inside the deadband nothing need move" not in page  # the ankle moves
    drive = summary["drive"]["inverse"]
    motor = exosuit.transmission.actuator.motor
    assert 0.5 * motor.torque_max_N_m < drive["peak_torque_N_m"] <= motor.torque_max_N_m
    assert drive["peak_speed_m_per_s"] < motor.speed_max_m_per_s
    table = np.genfromtxt(tmp_path / "profile.csv", delimiter=",", names=True)
    assert {"joint_knee_rad", "joint_ankle_rad", "travel_inverse_m", "motor_torque_inverse_N_m"} <= set(
        table.dtype.names
    )
    torque = table["force_inverse_N"] * motor.drum_radius_m / motor.gear_ratio
    assert table["motor_torque_inverse_N_m"] == pytest.approx(torque, rel=1e-6)
    assert table["motor_angle_inverse_rad"] == pytest.approx(
        table["travel_inverse_m"] / motor.travel_per_rad_m, abs=1e-9
    )


def test_a_joint_that_does_not_repeat_with_the_cycle_is_refused(exosuit):
    knee = replace(exosuit.joints["knee"], angles_rad=(0.1, 0.35, 0.1, 1.05, 0.2))
    with pytest.raises(
        InputError, match=r"\[joints.knee\]: the reference repeats after 1 s, the joint starts at 0.1 rad"
    ):
        Problem.of(replace(exosuit, joints={**exosuit.joints, "knee": knee}))
    fading = SineJoint(amplitudes_rad=(0.2,), frequencies_Hz=(1.0,), fade_in_s=0.2)
    with pytest.raises(InputError, match="whole periods and fade_in_s = 0"):
        Problem.of(replace(exosuit, joints={**exosuit.joints, "knee": fading}))
