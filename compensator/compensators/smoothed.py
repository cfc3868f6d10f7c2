"""What a practitioner builds: the capstan law with its sign change smoothed, over the smoothing time that does best.

The baseline that a model has to beat. The jumps of the inverted law are what a stiff tendon wants and a real one does
not; smoothed, the same law does much better.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from tendonff.compensator.compensators.base import Compensator, FloatArray, Problem, Profile, Style
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import PURPLE
from tendonff.models.capstan import CapstanLaw
from tendonff.models.layout import ChainInputs
from tendonff.ocp.simulate import Simulator

_TIMES = 12  # tried between a step and a quarter of the duration, in equal ratios


def lagged(exponent: FloatArray, steps: float) -> FloatArray:
    """First-order lag of ln(force/tension), shape (n,), over `steps`, which a controller can compute as it goes."""
    share = 1 / (1 + steps)
    smooth: FloatArray = lfilter([share], [1, share - 1], exponent)
    return smooth


def centred(exponent: FloatArray, steps: float) -> FloatArray:
    """Moving mean of ln(force/tension), shape (n,), over `steps` around each row, for a reference known beforehand."""
    smooth: FloatArray = uniform_filter1d(exponent, max(1, round(steps)), mode="nearest")
    return smooth


class Smoothed(Compensator):
    """The static inverse of the capstan law, sign change smoothed at best, within the actuator's limits."""

    name = "smoothed"
    label = "capstan law, smoothed"
    style = Style(color=PURPLE, linestyle="-")
    is_fast = False

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer by the best of all smoothing times; see `Compensator.profile`."""
        reference = problem.reference
        law = CapstanLaw.of(problem.transmission)
        lifted = reference.tension_N + law.adhesion_N
        jumping = law.input_history_N(reference.tension_N, reference.initial_tension_N)
        exponent = np.log((jumping + law.adhesion_N) / lifted)
        most = max(2.0, 0.25 * len(exponent))
        candidates = [(smoother, steps) for smoother in (lagged, centred) for steps in np.geomspace(1, most, _TIMES)]
        forces: list[FloatArray] = []
        errors: list[float] = []
        errors_of = _errors(problem)
        for k, (smoother, steps) in enumerate(candidates, start=1):
            force = lifted * np.exp(smoother(exponent, float(steps))) - law.adhesion_N
            forces.append(problem.limited(force))
            errors.append(errors_of(forces[-1]))
            progress(k, len(candidates))
        return Profile(force_N=forces[int(np.argmin(errors))])


def _errors(problem: Problem) -> Callable[[FloatArray], float]:
    """Mean squared error of a force on the design model, which is set up once for all [N^2]."""
    reference, chain = problem.reference, problem.chain
    rest = chain.rest_state(reference.initial_tension_N)
    simulator = Simulator(chain, reference.step_s, rest, ChainInputs.of_force(np.array([reference.initial_tension_N])))
    fresh = simulator.checkpoint()

    def error(force_N: FloatArray) -> float:
        inputs = ChainInputs.of_force(force_N)
        simulator.restore(replace(fresh, inputs=inputs[:1]))
        output = simulator.advance(inputs[1:]).tension_N[:, -1]
        wanted = reference.tension_N[1:]
        return float(np.mean((output - wanted) ** 2)) if len(output) == len(wanted) else float("inf")

    return error
