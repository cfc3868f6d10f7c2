"""What the optimal profile adds to the warnings of its reference."""

from types import SimpleNamespace
from typing import Any, cast

from tendonff.compensator.compensators.optimal import tracking_warnings
from tendonff.compensator.files.notices import Danger
from tendonff.ocp.tracking.diagnosis import PeakBeyond
from tendonff.ocp.tracking.result import TrackStatus


def test_a_peak_out_of_reach_is_said_by_the_reference_alone() -> None:
    """Before, three warnings stated it, which pushed the first figure of a report off a small screen."""
    tracking = cast(
        Any,
        SimpleNamespace(
            status=TrackStatus.BEST_ACHIEVABLE,
            message="out of reach",
            reasons=(PeakBeyond("peak"), "rate"),
            departures=(),
        ),
    )
    said, silent = (cast(Any, SimpleNamespace(warnings=each)) for each in ((Danger("peak"),), ()))
    assert tracking_warnings(tracking, said) == ("rate",)
    assert tracking_warnings(tracking, silent) == ("optimal: out of reach", "peak", "rate")
