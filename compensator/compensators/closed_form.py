"""Compensators in closed form: none, the inverse without friction or with it, and the static inverse."""

from dataclasses import replace

from tendonff.compensator.compensators.base import CModule, Compensator, Problem, limit_warnings, with_motion
from tendonff.compensator.compensators.expectation import FRICTIONLESS
from tendonff.compensator.compensators.profile import Profile, ProfileStatus
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import BLUE, GREY, ORANGE, Style
from tendonff.models.capstan import CapstanLaw
from tendonff.models.parameters.numbers import without_friction
from tendonff.ocp.tendon.inverse import InverseStatus


class Uncompensated(Compensator):
    """The reference itself as force, within the actuator's limits."""

    name = "none"
    label = "reference applied directly"
    style = Style(color=GREY, linestyle=":")
    knows_the_level = False

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer with the reference; see `Compensator.profile`."""
        return Profile(force_N=problem.limited(problem.reference.tension_N))


class Frictionless(Compensator):
    """The exact inverse with mu = 0 and no load-independent friction, within the actuator's limits.

    What is left of its error is friction alone: inertia, elasticity and relaxation are compensated.
    """

    name = FRICTIONLESS
    label = "inverse without friction"
    style = Style(color=GREY, linestyle="--")

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer by the exact inverse of the frictionless chain; see `Compensator.profile`."""
        bare = replace(problem, transmission=without_friction(problem.transmission), model=None)
        found = with_motion(bare, self.name, Inverse().profile(bare, progress=progress))
        return replace(found, status=ProfileStatus.GOOD, message="", warnings=())


class Capstan(Compensator):
    """The static inverse of the capstan law, within the actuator's limits."""

    name = "capstan"
    label = "capstan law"
    style = Style(color=ORANGE, linestyle="-.")
    knows_the_level = False
    c_module = CModule(name="capstan", content="capstan law", knows_joints=False)

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer by the capstan law; see `Compensator.profile`."""
        reference = problem.reference
        law = CapstanLaw.of(problem.transmission)
        start = reference.initial_tension_N
        drive = problem.transmission.actuator.law
        wanted = problem.in_cycle(lambda rows: law.force_history_N(rows, drive, start), reference.tension_N)
        return Profile(force_N=problem.limited(wanted))


class Inverse(Compensator):
    """The exact inverse of the chain, within the actuator's limits."""

    name = "inverse"
    label = "exact inverse"
    style = Style(color=BLUE, linestyle="-")
    c_module = CModule(name="inverse", content="exact inverse of the chain")

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer by the exact inverse; see `Compensator.profile`."""
        inversion = problem.inversion
        exact = inversion.status is InverseStatus.EXACT
        force = problem.limited(inversion.force_N)
        limits = limit_warnings(self.name, inversion.force_N, force)
        travel = None  # where the limits change the force, the end moves otherwise than in the inverse
        if inversion.states is not None and not limits:
            rest = problem.chain.rest_state(problem.reference.initial_tension_N)
            travel = inversion.states[:, -2] - rest.near_position_m
        return Profile(
            force_N=force,
            travel_m=travel,
            status=ProfileStatus.GOOD if exact else ProfileStatus.DOUBTFUL,
            message="" if exact else inversion.message,
            warnings=(*(() if exact else (f"{self.name}: {inversion.message}",)), *limits),
        )
