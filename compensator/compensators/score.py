"""How well a force does: simulated on a chain and scored, and on all chains that may be the real one."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem, Profile, servo
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.path import JointMotion
from tendonff.ocp.inverse import invert
from tendonff.ocp.periodic import steady_response
from tendonff.ocp.simulate import Outcome, Simulation, simulate
from tendonff.ocp.tracking.robust import ErrorBand, Sample, error_band, sample_transmissions

K = TypeVar("K", bound=Hashable)

ASSUMED = Uncertainty(mu=0.1, samples=3)
"""What is assumed where the scenario states no uncertainty: friction known to 10 % either way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How far the delivered tension is from the wanted one."""

    rmse_N: float  # root mean square error [N]
    rmse_percent_of_range: float  # the same over the range of the reference [%]
    peak_error_N: float  # largest absolute error [N]

    @property
    def percent(self) -> str:
        """Error in % of range with three digits; what is below 0.001 % is rounding and said to be so."""
        value = self.rmse_percent_of_range
        return f"{value:.3g}" if value >= 1e-3 else "< 0.001"


def scale_N(reference_N: FloatArray) -> float:
    """What percentages of a reference refer to: its range, or the height of a constant one [N]."""
    span = float(np.ptp(reference_N))
    return span if span > 0 else float(np.max(np.abs(reference_N)))


def score(reference_N: FloatArray, output_N: FloatArray) -> Score:
    """Compare a delivered tension with the wanted one, shape (n,), rows at the same times [N]."""
    error = output_N - reference_N
    rmse = float(np.sqrt(np.mean(error**2)))
    return Score(
        rmse_N=rmse, rmse_percent_of_range=100 * rmse / scale_N(reference_N), peak_error_N=float(np.max(np.abs(error)))
    )


def is_worse(score: Score, uncompensated: Score, reference_N: FloatArray) -> bool:
    """Whether a compensator does harm: its error is above that of the reference itself as force, by more than 1 %.

    A millionth of the range of the reference is rounding.
    """
    return score.rmse_N > 1.01 * uncompensated.rmse_N + 1e-6 * scale_N(reference_N)


def harm_warnings(scores: Mapping[str, Score], reference_N: FloatArray) -> list[str]:
    """Compensators, by name, that do harm; "none" is what they are compared with, and without it there are none."""
    nothing = scores.get("none")
    if nothing is None:
        return []
    return [
        f"{name}: RMS error {score.rmse_percent_of_range:.3g} % of range, more than without compensation "
        f"({nothing.rmse_percent_of_range:.3g} %): do not use it for this reference and these limits"
        for name, score in scores.items()
        if is_worse(score, nothing, reference_N)
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedPlant:
    """The chain that a force is tried on."""

    level: Level
    segments: int | None = None  # masses; default: the path's own
    refinement: int = 1  # steps per row of the profile; the force is linear in between


def simulate_profile(
    transmission: Transmission, plant: SimulatedPlant, profile: Profile, reference: Reference
) -> Simulation:
    """Simulate a plant under a profile, from rest at the reference's initial tension; a cycle in its steady state.

    The profile's command counts where it has one, else its force. The result is on the plant's own grid, every
    `refinement`-th row of which is a row of the reference.
    """
    chain = Chain.of(transmission, plant.level, plant.segments)
    drive = profile.force_N
    if profile.command_m is not None:
        chain, drive = servo(chain, transmission.actuator, reference.initial_tension_N, profile.command_m)
    if plant.refinement > 1:
        rows = (len(drive) - 1) * plant.refinement + 1
        drive = np.interp(np.arange(rows) / plant.refinement, np.arange(len(drive)), drive)
    step, start = reference.step_s / plant.refinement, reference.initial_tension_N
    if reference.periodic:
        return steady_response(chain, drive, step, initial_tension_N=start)[0]
    return simulate(chain, drive, step, initial_tension_N=start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slack:
    """Where a tendon went slack."""

    end: str  # the nearest end, "actuator" or "load", of the link that went slack first
    message: str  # what the simulation says

    @classmethod
    def of(cls, run: Simulation) -> "Slack | None":
        """Of a simulation; None where the tendon stayed taut."""
        if run.outcome is not Outcome.SLACK:
            return None
        slack = run.tension_N <= 0
        first = int(np.argmax(slack[np.argmax(slack.any(axis=1))]))
        return cls(end="load" if first >= slack.shape[1] / 2 else "actuator", message=run.message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """One compensator's profile on one plant."""

    compensator: str  # name of the compensator
    plant: SimulatedPlant
    output_N: FloatArray  # shape (n,); delivered tension at the rows of the reference [N]
    travel_m: FloatArray  # shape (n,); position of the actuator's end relative to the start [m]
    score: Score
    # root mean square and largest error of the load's position [m], where that is wanted
    position_error_m: tuple[float, float] | None
    slack: Slack | None  # where the tendon went slack; None where it stayed taut


def verify(
    transmission: Transmission, plant: SimulatedPlant, compensator: str, profile: Profile, reference: Reference
) -> Verified:
    """Simulate a plant under a profile and score what arrives; SolveError if the simulation fails."""
    run = simulate_profile(transmission, plant, profile, reference).require()
    output = run.output_tension_N[:: plant.refinement]
    rest = Chain.of(transmission, plant.level, plant.segments).rest_state(reference.initial_tension_N)
    travel = run.near_position_m[:: plant.refinement] - rest.near_position_m
    load = run.far_position_m[:: plant.refinement] - rest.far_position_m
    off = None if reference.position_m is None else load - reference.position_m
    return Verified(
        compensator=compensator,
        plant=plant,
        output_N=output,
        travel_m=travel,
        score=score(reference.tension_N, output),
        position_error_m=None if off is None else (float(np.sqrt(np.mean(off**2))), float(np.max(np.abs(off)))),
        slack=Slack.of(run),
    )


_CAUSES = {
    "actuator": "the force falls faster than mass and friction of the drive let its end follow",
    "load": "the load's end gives way faster than the tendon is taken in",
}


def slack_warnings(slack: Mapping[tuple[str, str], Slack]) -> list[str]:
    """One line for each cause of slack, by compensator and plant, on all profiles under which it comes about."""
    lines = []
    for end, cause in _CAUSES.items():
        those = {key: one for key, one in slack.items() if one.end == end}
        if not those:
            continue
        names = list(dict.fromkeys(compensator for compensator, _ in those))
        plant, found = [(plant, one) for (name, plant), one in those.items() if name == names[0]][-1]
        lines.append(
            f"the tendon goes slack at the {end}'s end under {', '.join(names)}: {cause}; "
            f"{names[0]} on {plant}: {found.message}"
        )
    return lines


@dataclass(frozen=True, slots=True, kw_only=True)
class IgnoredMotion:
    """What it costs to design for the mean pose of joints that move."""

    motion: JointMotion
    # known, ignored: of the exact inverse that knows the motion, and of the one for the mean pose, both on the moving
    # path
    known: Score
    ignored: Score

    @property
    def text(self) -> str:
        """The finding in words."""
        joints = ", ".join(
            f"{name} by {np.ptp(angle):.2f} rad around {angle.mean() + 0.0:.2f} rad"
            for name, angle in zip(self.motion.names, self.motion.angle_rad.T, strict=True)
        )
        return (
            f"The joints move: {joints}. Ignoring that would leave an RMS error of "
            f"{self.ignored.percent} % of range: the exact inverse for the mean pose, on the moving path. The one that "
            f"knows the motion leaves {self.known.percent} %."
        )


def ignored_motion(problem: Problem) -> IgnoredMotion | None:
    """Play the exact inverse for the mean pose on the moving path; None where nothing moves."""
    motion, reference = problem.transmission.motion, problem.reference
    if motion is None or not motion.moves:
        return None
    still = problem.chain.at_rest(motion.angle_rad.mean(axis=0))
    start = reference.initial_tension_N
    forces = (
        problem.inversion.force_N,
        invert(still, reference.tension_N, reference.step_s, initial_tension_N=start).force_N,
    )
    plant = SimulatedPlant(level=problem.level)
    known, ignored = (
        verify(problem.transmission, plant, "inverse", Profile(force_N=problem.limited(force)), reference).score
        for force in forces
    )
    return IgnoredMotion(motion=motion, known=known, ignored=ignored)


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """Transmissions that may be the real one."""

    samples: tuple[Sample, ...]  # the first is the nominal one
    is_assumed: bool  # the scenario states no uncertainty
    widths: str  # in words: "mu ±10 %"

    def __str__(self) -> str:
        source = "an assumption: [robust] states nothing" if self.is_assumed else "as [robust] states"
        return f"{self.widths} ({source})"


def doubt(transmission: Transmission, uncertainty: Uncertainty) -> Doubt:
    """What may be the real transmission, by the scenario's uncertainty.

    Where that says that all is certain, or takes a single sample, it is `ASSUMED` instead.
    """
    is_assumed = uncertainty.is_certain or uncertainty.samples == 1
    stated = ASSUMED if is_assumed else uncertainty
    widths = (("mu", stated.mu), ("stiffness", stated.stiffness), ("bristle stiffness", stated.bristle_stiffness))
    return Doubt(
        samples=sample_transmissions(transmission, stated),
        is_assumed=is_assumed,
        widths=", ".join(f"{name} ±{100 * width:.3g} %" for name, width in widths if width > 0),
    )


def error_bands(
    samples: tuple[Sample, ...], level: Level, forces_N: Mapping[K, FloatArray], reference: Reference
) -> dict[K, ErrorBand]:
    """Errors of each force, shape (n,), over samples of the transmission; equal forces are tried once."""
    tension, step, start = reference.tension_N, reference.step_s, reference.initial_tension_N
    unique = {force.tobytes(): force for force in forces_N.values()}
    seen = {
        key: error_band(samples, level, force, tension, step, initial_tension_N=start, periodic=reference.periodic)
        for key, force in unique.items()
    }
    return {name: seen[force.tobytes()] for name, force in forces_N.items()}
