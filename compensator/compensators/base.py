"""What a compensator is: a way from a wanted tension to the force of the actuator.

A further compensator is one file beside this one and one line in `registry`; design, compare, explore and the exports
then know it. `export-c` also needs its C template, named by `c_module`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.scenario.reference import Hold
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import OptimalSettings
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Actuator, Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Objective
from tendonff.ocp.errors import SolveError
from tendonff.ocp.inverse import Inversion, invert
from tendonff.ocp.periodic import Steadiness, steady_inverse, steady_response
from tendonff.ocp.reference.hold import KeptForce, find_holds, keep_force_to_end
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import limit_motion, travel_of
from tendonff.ocp.tracking.problem import TrackOptions
from tendonff.ocp.tracking.result import Tracking
from tendonff.ocp.tracking.robust import Sample, sample_transmissions

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)  # without slots: what is computed once is kept in the instance
class Problem:
    """A wanted tension, the transmission that shall deliver it, and what is known of it.

    Parameters
    ----------
    transmission, level : Transmission, Level
        Of the design model.
    samples : tuple of Sample, optional
        Transmissions that the uncertainty admits, the nominal one first; empty where all is certain.
    objective : Objective, optional
        Which error over the samples counts.
    options, asked : TrackOptions, OptimalSettings, optional
        What the optimal profile is optimised for, and whether it is to follow the reference, or what else.
    live : bool, optional
        The reference comes sample by sample, as on a controller: nothing is known ahead, no force is kept, and the
        limits are those of the force.
    model : Chain, optional
        The design model where it is cut already; default: made of the transmission.
    """

    transmission: Transmission
    level: Level
    reference: Reference
    samples: tuple[Sample, ...] = ()
    objective: Objective = Objective.WORST
    options: TrackOptions = TrackOptions()  # noqa: RUF009 - frozen
    asked: OptimalSettings = OptimalSettings()  # noqa: RUF009 - frozen
    live: bool = False
    model: Chain | None = None

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        *,
        level: Level | None = None,
        reference: Reference | None = None,
        options: TrackOptions | None = None,
    ) -> "Problem":
        """The problem that a scenario poses, with its uncertainty; level, reference and options by default its own."""
        reference = sample_reference(scenario) if reference is None else reference
        transmission = moved(scenario, float(reference.time_s[-1]), periodic=scenario.reference.periodic)
        samples = sample_transmissions(transmission, scenario.robust)
        return cls(
            transmission=transmission,
            level=level or scenario.run.level,
            reference=reference,
            samples=samples if len(samples) > 1 else (),
            objective=scenario.robust.objective,
            options=options or TrackOptions(**scenario.optimal.given),  # type: ignore[arg-type]
            asked=scenario.optimal,
        )

    @cached_property
    def chain(self) -> Chain:
        """The design model."""
        return self.model or Chain.of(self.transmission, self.level)

    @cached_property
    def limits(self) -> ForceLimits:
        """What the actuator can do."""
        return ForceLimits.of(self.transmission.actuator)

    @cached_property
    def kept(self) -> KeptForce | None:
        """Holds, and an end of the reference under which the output stays; None where no force is kept."""
        reference = self.reference
        if reference.periodic or self.live:
            return None
        wanted, step = reference.tension_N, reference.step_s
        holds = find_holds(wanted, step) if reference.hold is Hold.KEEP else ()
        kept = keep_force_to_end(self.chain, wanted, step, holds, initial_tension_N=reference.initial_tension_N)
        # A chain that no force lets follow goes slack before: the inverse of the wanted tension then says why.
        return kept if kept is not None and np.all(kept.followed_N > 0) else None

    @cached_property
    def followed_N(self) -> FloatArray:
        """What inverse and optimisation follow: the wanted tension, but for stretches where the force is kept [N]."""
        return self.reference.tension_N if self.kept is None else self.kept.followed_N

    @cached_property
    def inversion(self) -> Inversion:
        """The exact inverse before the limits, with its states: computed once for all that need it."""
        reference = self.reference
        if reference.periodic:
            return self._steady_inverse[0]
        start = reference.initial_tension_N
        return invert(self.chain, self.followed_N, reference.step_s, initial_tension_N=start, record=True)

    @cached_property
    def _steady_inverse(self) -> tuple[Inversion, Steadiness]:
        return steady_inverse(self.chain, self.reference.tension_N, self.reference.step_s)

    @property
    def unsettled(self) -> tuple[str, ...]:
        """A warning where the exact inverse of a reference that repeats does not repeat itself."""
        if not self.reference.periodic or self._steady_inverse[1].converged:
            return ()
        steadiness = self._steady_inverse[1]
        return (
            f"no steady cycle of the inverse was found: {steadiness}; profile and scores are those of the last one",
        )

    def limited(self, force_N: FloatArray) -> FloatArray:
        """A force, shape (n,), within the actuator's limits, of its motion too, from the initial tension on [N]."""
        step, start = self.reference.step_s, self.reference.initial_tension_N

        def limit(force: FloatArray) -> FloatArray:
            given = self.limits.apply(force, step, start)
            return given if self.live else limit_motion(self.chain, given, step, self.limits, start)

        return self.in_cycle(limit, force_N)

    def in_cycle(self, causal: Callable[[FloatArray], FloatArray], rows: FloatArray) -> FloatArray:
        """What a causal map makes of rows, shape (n,), from rest or, of a periodic reference, in its steady cycle."""
        if not self.reference.periodic:
            return causal(rows)
        # Friction and limits forget within a cycle: the third period is that of the steady state.
        result: FloatArray = causal(np.concatenate([rows[:-1], rows[:-1], rows]))[-len(rows) :].copy()
        result[0] = result[-1]
        return result


class ProfileStatus(StrEnum):
    """What a profile is worth."""

    GOOD = "good"  # what the compensator is meant to give
    DOUBTFUL = "doubtful"  # usable, but the message says what is missing
    FAILED = "failed"  # not to be sent to an actuator; the message says why


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """The answer of a compensator.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
        Force of the actuator at the rows of the reference [N].
    travel_m, command_m : ndarray, shape (n,), or None
        Travel of the actuator's end from rest that belongs to the force, where the compensator knows it, and command of
        a position drive relative to the start [m].
    message : str
        Why the status is not good; empty where it is.
    warnings : tuple of str
        All that the user should know of this profile, the message included.
    tracking : Tracking or None
        How an optimisation ended; None where nothing was optimised.
    """

    force_N: FloatArray
    travel_m: FloatArray | None = None
    command_m: FloatArray | None = None
    status: ProfileStatus = ProfileStatus.GOOD
    message: str = ""
    warnings: tuple[str, ...] = ()
    tracking: Tracking | None = None

    def require(self) -> "Profile":
        """Return itself, or raise `SolveError` with the diagnosis where it must not be used."""
        if self.status is ProfileStatus.FAILED:
            raise SolveError(" ".join([self.message, *(w for w in self.warnings if self.message not in w)]))
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class CModule:
    """What `export-c` makes of a compensator."""

    name: str  # of the template, and of the C module after the prefix
    content: str  # what it is, in words
    headers: tuple[str, ...] = ()  # further templates of headers
    plays_back: bool = False  # the module plays the profile that was computed beforehand, and takes no reference
    knows_joints: bool = True  # it has a meaning on a path that joints move


class Compensator(ABC):
    """A way from a wanted tension to a force.

    Attributes
    ----------
    name, label : str
        Key in files and on the command line, and name for people.
    knows_the_level : bool
        The profile depends on the fidelity level of the design model.
    is_fast : bool
        Fast enough to follow a slider.
    """

    name: str
    label: str
    style: Style
    knows_the_level: bool = True
    is_fast: bool = True
    c_module: CModule | None = None

    @abstractmethod
    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer a problem."""

    def __str__(self) -> str:
        return self.name


def limit_warnings(name: str, before_N: FloatArray, after_N: FloatArray) -> tuple[str, ...]:
    """For how long and by how much the actuator's limits changed a force, shape (n,); nothing where they did not."""
    difference = np.abs(before_N - after_N)
    changed = difference > 1e-6 * max(float(np.max(np.abs(before_N))), 1e-3)  # less is rounding, or a cycle's closing
    if not changed.any():
        return ()
    share, most = 100 * float(changed.mean()), float(np.max(difference))
    active = f"actuator limits are active in {share:.3g} % of the samples"
    return (f"{name}: {active} and change the force by up to {most:.3g} N",)


def with_motion(problem: Problem, name: str, profile: Profile) -> Profile:
    """A profile with the travel on the design model and, for a position drive, the command.

    A force F and a command x_c1 behind the servo's stiffness k_c1 are two names of one motion, x_c1 = q_a + F/k_c1: so
    every compensator answers with a force, and here it becomes the command, relative to the start at rest. "none" knows
    of no friction: its command is that of springs in series.
    """
    reference, actuator = problem.reference, problem.transmission.actuator
    start = reference.initial_tension_N
    travel = profile.travel_m
    if travel is None and reference.periodic:
        run, _ = steady_response(problem.chain, profile.force_N, reference.step_s, initial_tension_N=start)
        travel = run.near_position_m - problem.chain.rest_state(start).near_position_m
    elif travel is None:
        travel = travel_of(problem.chain, profile.force_N, reference.step_s, start)
    if actuator.drive is not Drive.POSITION or actuator.servo_stiffness_N_per_m is None or travel is None:
        return replace(profile, travel_m=travel)
    moved = travel
    if name == "none":
        moved = (profile.force_N - start) * problem.chain.rest_state(1.0).near_position_m
    command = moved + (profile.force_N - start) / actuator.servo_stiffness_N_per_m
    return replace(profile, travel_m=travel, command_m=command)


def servo(
    chain: Chain, actuator: Actuator, initial_tension_N: float, command_m: FloatArray
) -> tuple[Chain, FloatArray]:
    """The chain behind the servo of a position drive, and the force on it that stands for a command: k_c1 x_c1.

    The command x_c1, shape (n,), counts from the rest under the initial tension [m].
    """
    stiffness = actuator.servo_stiffness_N_per_m or 0.0
    rest = chain.rest_state(initial_tension_N).near_position_m
    drive: FloatArray = initial_tension_N + stiffness * (rest + command_m)
    return chain.with_end_stiffness(stiffness, chain.far.stiffness_N_per_m), drive
