"""The exact inverse of the chain, within the actuator's limits."""

from tendonff.compensator.compensators.base import (
    CModule,
    Compensator,
    Problem,
    Profile,
    ProfileStatus,
    Style,
    limit_warnings,
)
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import BLUE
from tendonff.ocp.inverse import InverseStatus


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
