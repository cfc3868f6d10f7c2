"""What is said of profiles under which the tendon goes slack."""

from tendonff.compensator.compensators.score import slack_warnings


def test_slack_is_one_line_that_names_every_profile_once_and_one_finding_on_the_most_detailed_level():
    found = {("none", "elastic"): "link 1", ("none", "presliding"): "link 2", ("table", "elastic"): "link 3"}
    assert slack_warnings(found) == ["the tendon goes slack under none, table; none on presliding: link 2"]
    assert slack_warnings({}) == []
