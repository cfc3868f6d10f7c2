"""Errors of a profile on a plant, and what they say against its use."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.plant import Plant, Response, Slack
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.files.notices import Remark
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.unit import NEWTON, Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Error of what is delivered against the reference.

    Attributes
    ----------
    rmse : float
        Root mean square error, in the unit of the reference (N, rad or N m).
    rmse_percent_of_range : float
        The same over the range of the reference [%].
    peak_error : float
        Largest absolute error, in that unit.
    """

    rmse: float
    rmse_percent_of_range: float
    peak_error: float

    @property
    def percent(self) -> str:
        """Error in % of range with three digits; below 0.001 % it is rounding and printed as such."""
        value = self.rmse_percent_of_range
        return f"{value:.3g}" if value >= 1e-3 else "< 0.001"

    def named(self, unit: Unit = NEWTON) -> dict[str, float]:
        """Its numbers by name, with their unit, as files have them."""
        return {
            f"rmse_{unit.key}": self.rmse,
            "rmse_percent_of_range": self.rmse_percent_of_range,
            f"peak_error_{unit.key}": self.peak_error,
        }


def scale_of(reference: FloatArray) -> float:
    """Scale of percentages of a reference, in its unit: its range, or the value of a constant one."""
    span = float(np.ptp(reference))
    return span if span > 0 else float(np.max(np.abs(reference)))


def score(reference: FloatArray, output: FloatArray) -> Score:
    """Compare what is delivered with the reference, shape (n,), rows at the same times, in the same unit.

    Errors are infinite where the output is not known everywhere, because a simulation failed.
    """
    error = np.nan_to_num(output - reference, nan=np.inf)
    rmse = float(np.sqrt(np.mean(error**2)))
    return Score(
        rmse=rmse, rmse_percent_of_range=100 * rmse / scale_of(reference), peak_error=float(np.max(np.abs(error)))
    )


def is_worse(score: Score, uncompensated: Score, wanted: FloatArray) -> bool:
    """Whether a compensator does harm: its error is above that of the reference itself as force, by more than 1 %.

    A millionth of the range of the reference is rounding.
    """
    return score.rmse > 1.01 * uncompensated.rmse + 1e-6 * scale_of(wanted)


def harm_warnings(scores: Mapping[str, Score], wanted: FloatArray, recommended: str) -> list[str]:
    """Compensators, by name, that do harm, all but the recommended one in one remark.

    "none" is what they are compared with, and without it there are none.
    """
    nothing = scores.get("none")
    if nothing is None:
        return []
    worse = {name: score for name, score in scores.items() if is_worse(score, nothing, wanted)}
    own = worse.pop(recommended, None)
    than = f"more than the reference applied directly ({nothing.percent} %)"
    found = [] if own is None else [f"{recommended}: RMS error {own.percent} % of range, {than}: do not use it here"]
    if worse:
        errors = ", ".join(f"{name} {score.percent} %" for name, score in worse.items())
        found.append(Remark(f"not to be used here, RMS error in % of range {than}: {errors}"))
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """Profile of a compensator simulated on a plant.

    Attributes
    ----------
    compensator : str
        Name of the compensator.
    plant : Plant
    response : Response
        What the plant does.
    score : Score
        Error of what is delivered.
    delivered : ndarray, shape (n,)
        Output tension [N] at the rows of the reference, or the load's position [m] where that is the reference.
    """

    compensator: str
    plant: Plant
    response: Response
    score: Score
    delivered: FloatArray

    @property
    def output_N(self) -> FloatArray:
        """Output tension at the rows of the reference, shape (n,) [N]."""
        return self.response.output_N

    @property
    def travel_m(self) -> FloatArray:
        """Position of the actuator's end relative to the start, shape (n,) [m]."""
        return self.response.travel_m

    @property
    def slack(self) -> Slack | None:
        """Where the tendon went slack; None where it stayed taut."""
        return self.response.slack


def verify(plant: Plant, compensator: str, profile: Profile, reference: Reference) -> Verified:
    """Simulate a plant under a profile and score what arrives; SolveError if the simulation fails."""
    response = plant.respond(profile, reference).require()
    delivered = response.delivered(reference)
    return Verified(
        compensator=compensator,
        plant=plant,
        response=response,
        score=score(reference.wanted, delivered),
        delivered=delivered,
    )


_CAUSES = {
    "actuator": "the force falls faster than mass and friction of the drive let its end follow",
    "load": "the load's end gives way faster than the tendon is taken in",
}


def slack_warnings(slack: Mapping[tuple[str, str], Slack], recommended: str = "") -> list[str]:
    """Messages for each cause of slack, by compensator and plant, naming all profiles that cause it.

    A remark where the recommended profile, if one is named, is not among them.
    """
    lines = []
    for end, cause in _CAUSES.items():
        those = {key: one for key, one in slack.items() if one.end == end}
        if not those:
            continue
        names = list(dict.fromkeys(compensator for compensator, _ in those))
        plant, found = [(plant, one) for (name, plant), one in those.items() if name == names[0]][-1]
        text = (
            f"the tendon goes slack at the {end}'s end under {', '.join(names)}: {cause}; "
            f"{names[0]} on {plant}: {found.message}"
        )
        lines.append(Remark(text) if recommended and recommended not in names else text)
    return lines
