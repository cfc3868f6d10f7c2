"""What is said of profiles under which the tendon goes slack."""

from dataclasses import replace

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Inverse
from tendonff.compensator.compensators.profile import ProfileStatus
from tendonff.compensator.compensators.score import Slack, slack_warnings
from tendonff.compensator.scenario.reference import Shape, WaypointReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level


def test_slack_is_one_line_a_cause_that_names_every_profile_once_and_one_finding_on_the_most_detailed_level():
    near, far = Slack(end="actuator", message="link 1"), Slack(end="load", message="link 9")
    found = {
        ("none", "elastic"): near,
        ("none", "presliding"): Slack(end="actuator", message="link 2"),
        ("table", "elastic"): far,
        ("capstan", "elastic"): near,
    }
    first, second = slack_warnings(found)
    assert first.startswith("the tendon goes slack at the actuator's end under none, capstan: ")
    assert first.endswith("; none on presliding: link 2")
    assert second.startswith("the tendon goes slack at the load's end under table: ")
    assert second.endswith("; table on elastic: link 9")
    assert slack_warnings({}) == []


def test_a_tendon_that_no_force_makes_follow_is_said_to_push_and_not_that_the_reference_falls_to_zero(examples):
    """The kept force at the end of the reference is then never reached: the chain goes slack before."""
    finger = load_scenario(examples / "finger.toml")
    heavy = replace(finger.transmission.tendon, mass_kg=1.0, stiffness_N_per_m=1000.0)
    course = WaypointReference(
        times_s=(0.0, 0.2, 0.3, 0.5, 0.7), tensions_N=(10.0, 40.0, 40.0, 15.0, 10.0), shape=Shape.SMOOTH
    )
    scenario = replace(finger, reference=course, transmission=replace(finger.transmission, tendon=heavy))
    found = Inverse().profile(Problem.of(scenario, level=Level.ELASTIC))
    assert found.status is ProfileStatus.DOUBTFUL
    assert "the reference asks the tendon to push at t = 0.003 s" in found.message
