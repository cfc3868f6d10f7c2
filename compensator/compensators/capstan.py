"""The static inverse of the capstan law, within the actuator's limits."""

from tendonff.compensator.compensators.base import CModule, Compensator, Problem, Profile, Style
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import ORANGE
from tendonff.models.capstan import CapstanLaw


class Capstan(Compensator):
    """The static inverse of the capstan law, within the actuator's limits."""

    name = "capstan"
    label = "static capstan law"
    style = Style(color=ORANGE, linestyle="-.")
    knows_the_level = False
    c_module = CModule(name="capstan", content="static capstan law", knows_joints=False)

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer by the static law; see `Compensator.profile`."""
        reference = problem.reference
        law = CapstanLaw.of(problem.transmission)
        start = reference.initial_tension_N
        wanted = problem.in_cycle(lambda rows: law.input_history_N(rows, start), reference.tension_N)
        return Profile(force_N=problem.limited(wanted))
