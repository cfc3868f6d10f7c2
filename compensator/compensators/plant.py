"""The one way to meet a plant: the transmission behind its drive, and its response to a profile.

Force or command behind the servo, from rest or in the steady cycle, with moving joints or without: every number that
is shown of a profile comes from `Plant.respond`.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Actuator, Load, Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.reference.motion import motion_of_tension
from tendonff.ocp.tendon.periodic import Steadiness, steady_response
from tendonff.ocp.tendon.simulate import Outcome, Simulation, simulate

FINE_SEGMENTS = 40
"""Masses of the plants that profiles are judged on."""

CYCLES = 3
"""After which a drive follows a command that repeats in its steady cycle."""

FINE_REFINEMENT = 10
"""Steps to a row of the profile where a design is verified."""

SHAKEN_REFINEMENT = 20
"""Steps to a row of the profile that follow what a rough drive starts between tendon and actuator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slack:
    """Where a tendon went slack.

    Attributes
    ----------
    end : str
        The nearest end, "actuator" or "load", of the link that went slack first.
    message : str
        Time, link and share of samples.
    """

    end: str
    message: str

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """Response of a plant to a profile, at the samples of the reference.

    Attributes
    ----------
    outcome : Outcome
        `FAILED` where a step could not be solved.
    message : str
        How the simulation ended, for the user.
    output_N : ndarray, shape (n,)
        Output tension [N]; NaN from the step on that failed, everywhere where no cycle could be simulated.
    travel_m : ndarray, shape (n,)
        Position of the actuator's end relative to the start [m], NaN as above.
    load_m : ndarray, shape (n,)
        Position of the load relative to the start [m], NaN as above.
    slack : Slack or None
        Where the tendon went slack; None where it stayed taut.
    steadiness : Steadiness or None
        How the search for the steady cycle of a periodic reference ended; None from rest.
    """

    outcome: Outcome
    message: str
    output_N: FloatArray
    travel_m: FloatArray
    load_m: FloatArray
    slack: Slack | None = None
    steadiness: Steadiness | None = None

    def delivered(self, reference: Reference) -> FloatArray:
        """The quantity compared with the reference's `wanted`: the output tension [N], or the load's position [m]."""
        return self.output_N if reference.position_m is None else self.load_m

    def require(self) -> "Response":
        """Return itself, or raise `SolveError` with the message where the simulation failed."""
        if self.outcome is Outcome.FAILED:
            raise SolveError(self.message)
        return self


def delivered_of(load: Load, tension_N: FloatArray, reference: Reference) -> FloatArray:
    """Quantity that an output tension, shape (n,), gives, for a plant that is no chain; see `Response.delivered`."""
    if reference.position_m is None:
        return tension_N
    start = reference.initial_tension_N
    return motion_of_tension(load, tension_N, reference.step_s, start, periodic=reference.periodic)


@dataclass(frozen=True, slots=True)
class Plant:
    """A transmission behind its drive, at a fidelity level: what a profile is tried on.

    Parameters
    ----------
    transmission : Transmission
    level : Level
    segments : int, optional
        Number of masses; default: the path's own.
    refinement : int, optional
        Steps to a row of the profile, which is linear in between, >= 1.
    joints : JointMotion, optional
        Motion of the joints instead of the transmission's.
    method : Method, optional
        How it is simulated.
    """

    transmission: Transmission
    level: Level
    segments: int | None = None
    refinement: int = 1
    joints: JointMotion | None = None
    method: Method = Method.BDF2

    @classmethod
    def fine(cls, transmission: Transmission, level: Level) -> "Plant":
        """The plant that a design is verified on: more masses and a smaller step."""
        return cls(transmission, level, FINE_SEGMENTS, FINE_REFINEMENT)

    @classmethod
    def by_force(cls, transmission: Transmission, level: Level, joints: JointMotion | None = None) -> "Plant":
        """Plant in front of its servo: whatever its drive, its input is a force."""
        return cls(replace(transmission, actuator=without_drive(transmission.actuator)), level, joints=joints)

    @property
    def chain(self) -> Chain:
        """Its chain, without the servo of a position drive."""
        motion = self.transmission.motion if self.joints is None else self.joints
        return Chain.of(replace(self.transmission, motion=motion), self.level, self.segments)

    def respond(self, profile: Profile, reference: Reference) -> Response:
        """Simulate the plant under a profile.

        A position drive takes the profile's command, any other its force. The run starts at rest at the reference's
        initial tension; that of a periodic reference is in its steady cycle.

        Raises
        ------
        SolveError
            If the drive takes a position and the profile has no command.
        """
        own, actuator = self.chain, self.transmission.actuator
        step, start = reference.step_s / self.refinement, reference.initial_tension_N
        setpoint = profile.setpoint(actuator.drive)
        rows, between = len(setpoint), slice(None, None, self.refinement)
        chain, drive = own, followed(actuator, setpoint, reference, self.refinement)
        if actuator.drive is Drive.POSITION:
            chain, drive = behind_servo(own, actuator, start, drive)
        steadiness = None
        if reference.periodic:
            try:
                run, steadiness = steady_response(chain, drive, step, initial_tension_N=start, method=self.method)
            except SolveError as error:
                nothing = np.full(rows, np.nan)
                return Response(
                    outcome=Outcome.FAILED, message=str(error), output_N=nothing, travel_m=nothing, load_m=nothing
                )
        else:
            run = simulate(chain, drive, step, initial_tension_N=start, method=self.method)
        rest = own.rest_state(start)

        def column(values: FloatArray, origin: float = 0.0) -> FloatArray:
            kept = values[between] - origin
            return np.pad(kept, (0, rows - len(kept)), constant_values=np.nan)

        return Response(
            outcome=run.outcome,
            message=run.message,
            output_N=column(run.output_tension_N),
            travel_m=column(run.near_position_m, rest.near_position_m),
            load_m=column(run.far_position_m, rest.far_position_m),
            slack=_slack_of(run),
            steadiness=steadiness,
        )


def without_drive(actuator: Actuator) -> Actuator:
    """The actuator in front of its drive: what is commanded is its force, at once."""
    return replace(
        actuator,
        drive=Drive.FORCE,
        servo_stiffness_N_per_m=None,
        drive_class=None,
        servo_time_s=None,
        delay_s=None,
        command_interval_s=None,
        command_hold=None,
        resolution=None,
        backlash_m=None,
    )


def followed(actuator: Actuator, setpoint: FloatArray, reference: Reference, refinement: int = 1) -> FloatArray:
    """Output of the drive, so many rows to a row of the setpoint, of a periodic reference in its steady cycle."""
    step, servo, rows = reference.step_s, actuator.servo, len(setpoint)
    if servo.is_ideal:
        if refinement == 1:
            return setpoint
        fine = np.arange((rows - 1) * refinement + 1)
        return np.interp(fine / refinement, np.arange(rows), setpoint)
    if not reference.periodic:
        return servo.follow(setpoint, step, refinement)
    cycles = np.concatenate([*(setpoint[:-1] for _ in range(CYCLES - 1)), setpoint])
    return servo.follow(cycles, step, refinement)[-((rows - 1) * refinement + 1) :]


def behind_servo(
    chain: Chain, actuator: Actuator, initial_tension_N: float, command_m: FloatArray
) -> tuple[Chain, FloatArray]:
    """The chain behind the servo of a position drive, and the force on it that represents a command: k_c1 x_c1.

    The command x_c1, shape (n,), counts from the rest under the initial tension [m].
    """
    stiffness = actuator.servo_stiffness_N_per_m or 0.0
    rest = chain.rest_state(initial_tension_N).near_position_m
    drive: FloatArray = initial_tension_N + stiffness * (rest + command_m)
    return chain.with_end_stiffness(stiffness, chain.far.stiffness_N_per_m), drive


def _slack_of(run: Simulation) -> Slack | None:
    if run.outcome is not Outcome.SLACK:
        return None
    slack = run.tension_N <= 0
    first = int(np.argmax(slack[np.argmax(slack.any(axis=1))]))
    return Slack(end="load" if first >= slack.shape[1] / 2 else "actuator", message=run.message)
