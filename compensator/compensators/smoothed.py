"""Hand-built baseline: the capstan law with its sign change smoothed, at the best smoothing time.

The baseline that a model has to beat. The jumps of the inverted law are what a stiff tendon wants and a real one does
not; smoothed, the same law does much better.
"""

from collections.abc import Callable
from itertools import accumulate

import numpy as np

from tendonff.compensator.compensators.base import Compensator, Problem
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.compensators.score import score
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import PURPLE, Style
from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.tracking.search import moving_mean

Smoother = Callable[[FloatArray, float], FloatArray]

_TIMES = 12  # tried between a step and a quarter of the duration, in equal ratios


def lagged(exponent: FloatArray, steps: float) -> FloatArray:
    """First-order lag of ln(force/tension), shape (n,), over `steps`, which a controller can compute as it goes."""
    share = 1 / (1 + steps)
    return np.array(list(accumulate((share * exponent).tolist(), lambda before, now: now + (1 - share) * before)))


def centred(exponent: FloatArray, steps: float) -> FloatArray:
    """Moving mean of ln(force/tension), shape (n,), over `steps` around each row, for a reference known beforehand."""
    return moving_mean(exponent, max(1, round(steps)))


class Smoothed(Compensator):
    """The static inverse of the capstan law, sign change smoothed at best, within the actuator's limits."""

    name = "smoothed"
    label = "capstan law, smoothed"
    style = Style(color=PURPLE, linestyle="-")
    is_fast = False

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer by the best of all smoothing times; see `Compensator.profile`."""
        reference, start = problem.reference, problem.reference.initial_tension_N
        law, drive = CapstanLaw.of(problem.transmission), problem.transmission.actuator.law
        plant = Plant.by_force(problem.transmission, problem.level, problem.chain.motion)
        most = max(2.0, 0.25 * len(reference.tension_N))
        candidates = [(smoother, steps) for smoother in (lagged, centred) for steps in np.geomspace(1, most, _TIMES)]
        forces: list[FloatArray] = []
        errors: list[float] = []
        for k, (smoother, steps) in enumerate(candidates, start=1):

            def smoothed(rows: FloatArray, smoother: Smoother = smoother, steps: float = float(steps)) -> FloatArray:
                lifted = rows + law.adhesion_N
                exponent = np.log((law.force_history_N(rows, drive, start) + law.adhesion_N) / lifted)
                force: FloatArray = lifted * np.exp(smoother(exponent, steps)) - law.adhesion_N
                return force

            forces.append(problem.limited(problem.in_cycle(smoothed, reference.tension_N)))
            response = plant.respond(Profile(force_N=forces[-1]), reference)
            errors.append(score(reference.wanted, response.delivered(reference)).rmse)
            progress(k, len(candidates))
        return Profile(force_N=forces[int(np.argmin(errors))])
