"""What is said of profiles under which the tendon goes slack."""

from tendonff.compensator.compensators.score import Slack, slack_warnings


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
