"""No compensation: the wanted tension itself as force."""

from tendonff.compensator.compensators.base import Compensator, Problem, Profile, Style
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import GREY


class Uncompensated(Compensator):
    """The wanted tension itself as force."""

    name = "none"
    label = "no compensation"
    style = Style(color=GREY, linestyle=":")
    knows_the_level = False

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer with the reference; see `Compensator.profile`."""
        return Profile(force_N=problem.reference.tension_N)
