"""A loop whose numbers are hidden, behind the independent plant and a motor read as servos are."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.identify_joint import measured, truth, with_effects
from tendonff.compensator.identification.answer.result import AnyIdentification
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.first_look import look
from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.motors.run import design_motors
from tests.hidden_loop import FINE_S, hidden, scenario, write_log

pytestmark = [pytest.mark.compiler, pytest.mark.slow]
LOOP = hidden(2)
COARSE = {"masses": 16, "step_s": 5e-6}


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    return write_log(LOOP, tmp_path_factory.mktemp("hidden") / "log.csv", encoder=True, **COARSE)


@pytest.fixture(scope="module")
def found(log) -> AnyIdentification:
    return identify(scenario(), [log])


def test_exponent_ratio_lost_motion_and_friction_are_those_of_the_plant_and_inside_their_intervals(found):
    true, seen = truth(LOOP), measured(LOOP)
    for name, most in (
        ("mu_theta", 1.5),
        ("tension_over_stiffness_m", 1.5),
        ("lost_motion_rad", 1.5),
        ("drive_torque_N_m", 4),
    ):
        estimate = found.estimate(name)
        assert estimate.identifiable
        assert 100 * abs(estimate.value / seen[name] - 1) <= most, name
        assert estimate.interval[0] <= true[name] <= estimate.interval[1], name
    assert abs(LOOP.scale - 1) > 0.03
    for name in ("pretension_N", "stiffness_N_per_m"):  # whose torque constant is not the scenario's
        low, high = found.estimate(name).interval
        assert low <= true[name] <= high, name


def test_the_motor_alone_predicts_torque_and_joint(found):
    [file] = found.files
    assert found.fit_percent < 1.5
    assert file.named("joint_rms_deg")["knuckle"] < 0.25


def test_straight_lines_are_a_first_look_only(log):
    """The bend of presliding and the stop that gives way leave up to a factor of about two."""
    [one] = read_logs(scenario(), [log], Measurement())
    first = look(one, scenario().mechanism)
    [push] = first.pushes
    assert push.way == 1
    for value, name in ((first.exponent, "mu_theta"), (first.tension_over_stiffness_m, "tension_over_stiffness_m")):
        assert 1.0 < value / truth(LOOP)[name] < 2.2, name


@pytest.mark.usefixtures("unpainted")
def test_a_design_from_the_file_tracks_on_the_plant(found, tmp_path, record_property):
    found.write(tmp_path / "fit")
    fitted = load_scenario(tmp_path / "fit" / "fitted.toml")
    assert fitted.mechanism.tendons[0].friction.mu_dynamic == found.estimate("mu_dynamic").value
    spread = {each.name: each.half_width for each in fitted.robust.spread}
    assert set(spread) == {
        "friction.mu_dynamic",
        "drive.pretension_N",
        "tendon.stiffness_N_per_m",
        "joints.knuckle.gravity_N_m",
    }
    low, high = found.estimate("pretension_N").interval_as_measured  # all forces off alike move no joint
    assert spread["drive.pretension_N"] == pytest.approx((high - low) / (high + low), abs=1e-4)
    design = design_motors(fitted)
    time = design.task.target_time_s
    fine = np.arange(round(time[-1] / FINE_S) + 1) * FINE_S
    wanted = np.interp(fine, time, design.task.wanted)

    def rms_deg(name: str) -> float:
        motor = np.interp(fine, time, design.profiles[name].motor_rad[:, 0])
        return math.degrees(float(np.sqrt(np.mean((LOOP.follow(motor, **COARSE).angle_rad - wanted) ** 2))))

    own, ratio = rms_deg("inverse"), rms_deg("linear")
    record_property("figure", f"tracking after identify: {own:.3f} deg, by the ratio {ratio:.2f}")
    assert own <= 0.25 < ratio
    names = {path.name for path in (tmp_path / "fit").iterdir()}
    assert {"fitted.toml", "fit.json", "report.html", "suggested_motor.csv"} <= names
    assert tomllib.loads((tmp_path / "fit" / "fitted.toml").read_text("utf-8"))["run"]["level"] == "presliding"


@pytest.mark.parametrize(("seed", "relaxing"), [pytest.param(304, 0.0, marks=pytest.mark.nightly), (332, 0.3)])
def test_effects_that_others_stand_in_for_are_found_together(seed, relaxing, tmp_path):
    """Counts of the motor took the place of an efficiency; friction of the gear, that of both: mu came out 95 % low."""
    loop = with_effects(hidden(seed), relaxing, 0.0)
    found = identify(scenario(), [write_log(loop, tmp_path / "log.csv", encoder=False, **COARSE)])
    assert found.estimate("mu_theta").value == pytest.approx(truth(loop)["mu_theta"], rel=0.03)
    assert "efficiency of the gear" in found.law
    assert "counts" not in found.law
