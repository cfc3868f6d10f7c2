"""Compensators: maps from a reference tension to the force of the actuator.

A further compensator is one file beside this one and one line in `registry`; design, compare, explore and the exports
then know it. `export-c` also needs its C template, named by `c_module`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from tendonff.compensator.compensators.expectation import (
    FRICTIONLESS,
    Behind,
    ErrorBand,
    Expectation,
    behind_drives,
    error_bands,
    expectation_of,
)
from tendonff.compensator.compensators.next_step import within_reach
from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant, Slack, delivered_of, followed
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.score import Score, slack_warnings, verify
from tendonff.compensator.compensators.sent import sent
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.text import InputError
from tendonff.compensator.reporting.colours import SKY, Style
from tendonff.compensator.scenario.doubts import reach_notes
from tendonff.compensator.scenario.goal import Given
from tendonff.compensator.scenario.kind import Kind
from tendonff.compensator.scenario.reference import Hold
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.unit import Unit
from tendonff.models.cached import cached_property
from tendonff.models.capstan import CapstanLaw, behind_drive_N
from tendonff.models.errors import ParameterError, TendonffError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.reference.hold import KeptForce, find_holds, keep_force_to_end
from tendonff.ocp.tendon.inverse import Inversion, invert
from tendonff.ocp.tendon.periodic import Steadiness, steady_inverse
from tendonff.ocp.tendon.simulate import Outcome
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import limit_motion
from tendonff.ocp.tracking.options import TrackOptions

K = TypeVar("K", bound=Hashable)

CAPSTAN_PLANT = "capstan"
"""Name of the capstan law as a plant."""


@dataclass(frozen=True, kw_only=True)  # without slots: what is computed once is kept in the instance
class Problem:
    """Reference tension, the transmission that shall deliver it, and its uncertainty.

    Parameters
    ----------
    transmission, level : Transmission, Level
        Of the design model.
    uncertainty : Uncertainty, optional
        What is not known of the transmission, and which error over what is possible counts; default: all is certain.
    options : TrackOptions, optional
        What the optimal profile is optimised for.
    live : bool, optional
        The reference comes sample by sample, as on a controller: nothing is known ahead, no force is kept, and the
        limits are those of the force.
    model : Chain, optional
        The design model where it is cut already; default: made of the transmission.
    reference : Reference
        What was to be delivered, sampled.
    """

    kind: ClassVar[Kind] = Kind.TENSION
    given_as: ClassVar[Given] = Given(title="Force profile", label="force [N]", loop="Tendon hysteresis")
    plain: ClassVar[str] = FRICTIONLESS  # compensator that others are compared with
    tunes_itself: ClassVar[bool] = True  # an inverse of it can tune itself on its plant
    transmission: Transmission
    level: Level
    reference: Reference
    uncertainty: Uncertainty = Uncertainty()  # noqa: RUF009 - frozen
    options: TrackOptions = TrackOptions()  # noqa: RUF009 - frozen
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
        return cls(
            transmission=transmission,
            level=level or scenario.run.level,
            reference=reference,
            uncertainty=scenario.robust,
            options=options or scenario.optimal,
        )

    @property
    def system(self) -> Transmission:
        """The transmission."""
        return self.transmission

    @property
    def wanted(self) -> FloatArray:
        """Values that the output is compared with, shape (n,)."""
        return self.reference.wanted

    @property
    def unit(self) -> Unit:
        """Unit of what is wanted."""
        return self.reference.unit

    @property
    def share_of(self) -> str:
        """The range, in words, that relative errors are a share of."""
        return self.reference.share_of

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the reference was changed."""
        return self.reference.warnings

    @property
    def time_s(self) -> FloatArray:
        """Instants of `wanted`, shape (n,) [s]."""
        return self.reference.time_s

    @property
    def plants(self) -> tuple[str, ...]:
        """Names of what profiles are compared on: the levels, then the capstan law."""
        return (*(level.value for level in Level), CAPSTAN_PLANT)

    def answer(self, compensator: "Compensator") -> Profile:
        """Profile of a compensator, with travel and command; SolveError where it has none."""
        if reason := compensator.refusal(self):
            raise SolveError(f"{compensator.name}: {reason}")
        return self.tried(compensator).require()

    def inverse_of(self, system: Transmission) -> Profile:
        """Profile of the exact inverse of another transmission, within the limits."""
        other = replace(self, transmission=system, model=None)
        return Profile(force_N=self.limited(other.inversion.force_N))

    def tried(self, compensator: "Compensator", progress: Progress = silent) -> Profile:
        """Profile of a compensator, with travel and command; its status may be that it failed."""
        profile = _answer(compensator.profile(self, progress=progress), self)
        return with_motion(self, compensator.name, profile)

    def answer_live(self, compensator: "Compensator") -> Profile:
        """Profile of a compensator where the reference arrives live, as applied by the actuator."""
        return self.applied(compensator.name, compensator.profile(replace(self, live=True)))

    def applied(self, name: str, profile: Profile) -> Profile:
        """Profile of a module as applied by the actuator, within the limits of its motion, which modules leave out.

        Lag, delay and hold of the drive remain, as in the exported code; a position drive takes the command unchanged.
        """
        if self.transmission.actuator.drive is Drive.POSITION:
            return profile if profile.command_m is not None else with_travel(self, name, profile)
        return replace(profile, force_N=self.limited(profile.force_N), travel_m=None)

    def on_rig(self, scenario: Scenario) -> "Problem":
        """The same reference on what another scenario describes, with its uncertainty."""
        return Problem.of(scenario, level=self.level, reference=self.reference, options=self.options)

    @property
    def nominal(self) -> "Problem":
        """The same, all being certain: an optimal profile for many plants takes too long for some uses."""
        return replace(self, uncertainty=Uncertainty())

    def check_reach(self) -> None:
        """Refuse a reference above the largest tension that the actuator reaches through the friction; InputError."""
        if beyond := reach_notes(self.transmission, self.time_s, self.reference.tension_N, ""):
            raise InputError("; ".join(beyond).strip())

    def given_of(self, profile: Profile) -> FloatArray:
        """Given to the drive, at the rows of `wanted`, as `given_as` says, shape (n,)."""
        return profile.force_N

    def given(self, profile: Profile) -> bytes:
        """Identity of what a profile commands."""
        return profile.force_N.tobytes() + profile.given.tobytes()

    def fault(self, profile: Profile) -> str:
        """Message of a profile whose status is not good."""
        return "" if profile.status is ProfileStatus.GOOD else profile.message

    def is_usable(self, profile: Profile) -> bool:
        """The profile may be sent to an actuator."""
        return profile.status is not ProfileStatus.FAILED

    def output_on(
        self, plant: str, profile: Profile, *, refinement: int = 1, factor: float = 1.0
    ) -> tuple[FloatArray, Slack | None]:
        """Output on a plant, shape (n,), and where the tendon goes slack; commands times a factor.

        SolveError if the simulation fails.
        """
        reference, start = self.reference, self.reference.initial_tension_N
        if plant == CAPSTAN_PLANT:  # exact for a force that is linear between rows: nothing to refine
            return self._output_by_capstan(profile), None
        if factor != 1.0:
            profile = replace(
                profile,
                force_N=start + (profile.force_N - start) * factor,
                command_m=None if profile.command_m is None else profile.command_m * factor,
                command_N=None if profile.command_N is None else start + (profile.command_N - start) * factor,
            )
        found = Plant(self.transmission, Level(plant), refinement=refinement).respond(profile, reference).require()
        return found.delivered(reference), found.slack

    def _output_by_capstan(self, profile: Profile) -> FloatArray:
        actuator, reference = self.transmission.actuator, self.reference
        start, force = reference.initial_tension_N, profile.command_N is not None
        rows = followed(actuator, profile.given, reference) if force else profile.force_N
        if reference.periodic:  # the second period is that of the steady state
            rows = np.concatenate([rows[:-1], rows])
        pulled = behind_drive_N(actuator.law, rows, start)
        tension = CapstanLaw.of(self.transmission).output_history_N(pulled, start)[-len(profile.force_N) :]
        return delivered_of(self.transmission.load, tension, reference)

    def slack_notes(self, slack: Mapping[tuple[str, str], Slack], recommended: str) -> list[str]:
        """Messages on slack by compensator and plant."""
        return slack_warnings(slack, recommended)

    def score(self, profile: Profile) -> Score:
        """Error of a profile on the plant that profiles are judged on; SolveError if the simulation fails."""
        plant = Plant(self.transmission, self.level, FINE_SEGMENTS)
        return verify(plant, "", profile, self.reference).score

    def bands(self, profiles: Mapping[K, Profile]) -> dict[K, ErrorBand]:
        """Errors of profiles on all transmissions that may be the real one."""
        return error_bands(self.doubt, self.level, profiles, self.reference, self._known_bands)

    def expect(self, profiles: Mapping[str, Profile], recommended: str | None = None) -> Expectation:
        """Try profiles, by name of the compensator, on all transmissions that may be the real one."""
        bands, unit = self.bands(profiles), self.unit
        found = expectation_of(self.doubt, self.level, bands, self.share_of, unit, recommended, change=self.change)
        return replace(found, behind=self.behind(found.best))

    def behind(self, band: ErrorBand) -> tuple[Behind, ...]:
        """Errors of a profile behind drives of each class, where lag and delay are not stated."""
        reference = self.reference
        return behind_drives(self.doubt, reference.wanted, band, reference.step_s, periodic=reference.periodic)

    @property
    def change(self) -> str:
        """Change with which the reference comes into the actuator's reach; empty where it is."""
        return within_reach(self.transmission, float(self.reference.tension_N.max()))

    @cached_property
    def chain(self) -> Chain:
        """The design model."""
        return self.model or Chain.of(self.transmission, self.level)

    @cached_property
    def doubt(self) -> Doubt[Transmission]:
        """Transmissions that may be the real one, by the uncertainty or, where none is stated, an assumed one."""
        return Doubt.of(self.transmission, self.uncertainty)

    @cached_property
    def _known_bands(self) -> dict[bytes, ErrorBand]:
        return {}

    @property
    def is_robust(self) -> bool:
        """The scenario states an uncertainty."""
        return not self.doubt.is_assumed

    @cached_property
    def limits(self) -> ForceLimits:
        """Limits of the actuator."""
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
        # A chain that no force lets follow goes slack before: the inverse of the reference then gives the reason.
        return kept if kept is not None and np.all(kept.followed_N > 0) else None

    @cached_property
    def followed_N(self) -> FloatArray:
        """Tension that inverse and optimisation follow: the reference, except where the force is kept [N]."""
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
    def notes(self) -> tuple[str, ...]:
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
        """Output of a causal map for rows, shape (n,), from rest or, for a periodic reference, in its steady cycle."""
        if not self.reference.periodic:
            return causal(rows)
        # Friction and limits forget within a cycle: the third period is that of the steady state.
        result: FloatArray = causal(np.concatenate([rows[:-1], rows[:-1], rows]))[-len(rows) :].copy()
        result[0] = result[-1]
        return result


@dataclass(frozen=True, slots=True, kw_only=True)
class CModule:
    """Form of a compensator in `export-c`."""

    name: str  # of the template, and of the C module after the prefix
    content: str  # what it is, in words
    headers: tuple[str, ...] = ()  # further templates of headers
    plays_back: bool = False  # the module plays the profile that was computed beforehand, and takes no reference
    knows_joints: bool = True  # it has a meaning on a path that joints move


class Compensator(ABC):
    """Map from a reference tension to a force.

    Attributes
    ----------
    kinds : tuple of Kind
        Kinds of scenario that it is for.
    name, label : str
        Key in files and on the command line, and name for people, by default the same.
    style : Style, optional
        How figures draw it.
    knows_the_level : bool
        The profile depends on the fidelity level of the design model.
    knows_the_drive : bool
        Of driven joints: servo lag and gear backlash are taken back.
    is_fast : bool
        Fast enough to follow a slider.
    is_swept : bool
        Tried by a sweep by default.
    is_compared : bool
        Tried by a comparison by default: on every level in less time than all the others.
    is_refusal_stated : bool
        A comparison states why it has no answer; False where that is no finding, but what the file describes.
    """

    kinds: ClassVar[tuple[Kind, ...]] = (Kind.TENSION,)
    name: str
    label: str
    style: Style = Style(color=SKY, linestyle="--")
    knows_the_level: bool = True
    knows_the_drive: bool = True
    is_fast: bool = True
    is_swept: bool = True
    is_compared: bool = True
    is_refusal_stated: bool = True
    c_module: CModule | None = None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if hasattr(cls, "name") and not hasattr(cls, "label"):
            cls.label = cls.name

    @abstractmethod
    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer a problem."""

    def refusal(self, problem: Problem) -> str:  # noqa: ARG002
        """Why it has no answer to a problem; empty where it has one."""
        return ""

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """Profiles of several compensators for one problem.

    Attributes
    ----------
    profiles : dict of str to Profile, or to commands of motors
        By name of the compensator; only of those that have an answer.
    refused : dict of str to str
        Why others have none for a problem of this kind, by name.
    failed : dict of str to str
        What ended the computation of others, by name.
    """

    profiles: dict[str, Any]
    refused: dict[str, str]
    failed: dict[str, str]

    def warnings(self, recommended: str) -> list[str]:
        """Warnings of all of them; those of profiles that are not recommended ask for no action."""
        notes = [
            note if name == recommended else Remark(note)
            for name, profile in self.profiles.items()
            for note in profile.warnings
        ]
        refused = [Remark(f"{name}: {reason}") for name, reason in self.refused.items()]
        return [*notes, *(f"{name}: {reason}" for name, reason in self.failed.items()), *refused]


def answers_of(problem: Any, compensators: Sequence[Any], parts: Parts) -> Answers:
    """Profiles of all compensators that have an answer to a Problem or MotorTask; one that fails ends no other.

    A slow compensator counts as `SLOW_PARTS` of the progress. SolveError where none has an answer.
    """
    found = Answers(profiles={}, refused={}, failed={})
    for each in compensators:
        share = 1 if each.is_fast else SLOW_PARTS
        if reason := each.refusal(problem):
            found.refused[each.name] = reason
        else:
            try:
                found.profiles[each.name] = problem.tried(each, parts.inside(share))
            except (TendonffError, ArithmeticError, np.linalg.LinAlgError) as error:
                reason = str(error) if isinstance(error, TendonffError) else f"{type(error).__name__}: {error}"
                found.failed[each.name] = f"failed: {reason}"
        parts.done(share)
    if not found.profiles:
        raise SolveError("; ".join(f"{name}: {reason}" for name, reason in (found.refused | found.failed).items()))
    return found


def _answer(profile: object, problem: Problem) -> Profile:
    """Answer of a compensator, perhaps the user's own; ParameterError if it does not fit the problem."""
    rows = problem.reference.tension_N.shape
    if not isinstance(profile, Profile):
        raise ParameterError(
            f"profile() must give a tf.Profile, got {type(profile).__name__}; write Profile(force_N=...)"
        )
    if np.shape(profile.force_N) != rows:
        raise ParameterError(
            f"force_N must have a value per row of the reference, {rows}, got {np.shape(profile.force_N)}"
        )
    return profile


FOLLOWED = ("inverse", "optimal")
"""Compensators whose held commands are improved on the design model, which takes seconds."""

SLOW_PARTS = 8
"""A slow compensator takes about as long as so many other parts of a design."""


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
    """A profile with the travel on the design model and the command, from which what the drive adds is taken back.

    "none" knows of no drive either: it commands the reference.
    """
    moved, actuator = with_travel(problem, name, profile), problem.transmission.actuator
    if actuator.servo.is_ideal or (actuator.drive is Drive.POSITION and moved.command_m is None):
        return moved
    if name == "none":
        return moved if actuator.drive is Drive.POSITION else replace(moved, command_N=moved.force_N)
    plant = Plant(problem.transmission, problem.level, joints=problem.chain.motion)
    return sent(plant, moved, problem.reference, live=problem.live, improve=name in FOLLOWED)


def with_travel(problem: Problem, name: str, profile: Profile) -> Profile:
    """A profile with the travel on the design model and, for a position drive, the command if that is ideal.

    A force F and a command x_c1 behind the servo's stiffness k_c1 are two names of one motion, x_c1 = q_a + F/k_c1: so
    every compensator returns a force, and here it becomes the command, relative to the start at rest. "none" knows
    of no friction: its command is that of springs in series.
    """
    actuator, start = problem.transmission.actuator, problem.reference.initial_tension_N
    travel = profile.travel_m
    if travel is None:
        plant = Plant.by_force(problem.transmission, problem.level, problem.chain.motion)
        response = plant.respond(profile, problem.reference)
        travel = None if response.outcome is Outcome.FAILED else response.travel_m
    if actuator.servo_stiffness_N_per_m is None or travel is None:
        return replace(profile, travel_m=travel)
    moved = travel
    if name == "none":
        moved = (profile.force_N - start) * problem.chain.rest_state(1.0).near_position_m
    command = moved + (profile.force_N - start) / actuator.servo_stiffness_N_per_m
    return replace(profile, travel_m=travel, command_m=command)
