"""One profile for a tendon that is not known exactly."""

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.parameters.uncertainty import Objective
from tendonff.ocp.batch import Progress
from tendonff.ocp.inverse import Inversion, invert
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import WORST_POWER, TrackingProblem, TrackOptions
from tendonff.ocp.tracking.result import Tracking
from tendonff.ocp.tracking.track import solve_tracking

POWER = {Objective.WORST: WORST_POWER, Objective.MEAN: 1.0}
"""Order of the mean over the chains that is made small."""


def track_robust(
    chains: tuple[Chain, ...],
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    objective: Objective = Objective.WORST,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    inversion: Inversion | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """One profile that is best in the worst case or on average over some chains; see `track`.

    Parameters
    ----------
    chains : tuple of Chain
        Models of all that the uncertainty admits. The first is the nominal one: its inverse is the starting point, and
        its output is predicted.
    reference_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    objective : Objective, optional
    options : TrackOptions, optional
    initial_tension_N : float, optional
    inversion : Inversion, optional
        Of the nominal chain, where the caller has it already.
    progress : callable, optional

    Returns
    -------
    Tracking
        Its rms error is that of the nominal chain.
    """
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    inverse = invert(chains[0], reference, step_s, initial_tension_N=start) if inversion is None else inversion
    problem = TrackingProblem.of(
        chains,
        reference,
        step_s,
        limits,
        options,
        initial_tension_N=start,
        inverse_N=inverse.force_N,
        power=POWER[objective],
    )
    return solve_tracking(problem, inverse, options, progress)
