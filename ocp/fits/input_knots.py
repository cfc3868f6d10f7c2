"""How the chain's answer follows small changes of its measured input: slopes over knots in time, window by window.

Friction forgets: what a change of the input did is wiped out by the next full sweep. So windows of many seconds, each
with knots from some seconds before it on, say nearly all of it at a cost that grows with the length only.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tendonff.models.layout import ChainState
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.chain import Array, ChainModel, Drive, DynamicParameter
from tendonff.ocp.sensitivity import force_sensitivity
from tendonff.ocp.simulate import simulate


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWindow:
    """Slopes over the input at knots, linear between them."""

    time_s: Array  # shape (n,); from the first sample of the drive
    first_s: float  # where the window itself begins; what is before belongs to the window before
    knots_s: Array  # shape (k,)
    output_slopes: Array  # shape (n, k) [N/N]
    # near_slopes, elongation_slopes: shape (n, k) [m/N]
    near_slopes: Array
    elongation_slopes: Array


def input_windows(
    model: ChainModel,
    values: Mapping[DynamicParameter, float],
    drive: Drive,
    *,
    knot_s: float,
    window_s: float,
    before_s: float,
) -> Iterator[InputWindow]:
    """Windows of a drive, one after the other.

    Parameters
    ----------
    values : mapping of DynamicParameter to float
        All of them.
    knot_s, window_s, before_s : float
        Distance of knots, length of windows, and how much earlier their knots begin, about.

    Raises
    ------
    SolveError
        If the simulation fails.
    """
    run_up = model.with_lead_in(values, drive)
    chain = model.chain(model.whole(values), run_up.motion)
    run = simulate(chain, run_up.force_N, run_up.step_s, initial_tension_N=run_up.rest_N, record=True).require()
    if run.states is None:
        raise SolveError("the run did not keep its states")
    last, step = len(run_up.force_N) - 1, run_up.step_s
    edges = np.linspace(0, last, max(1, round((last - run_up.lead) * step / window_s)) + 1).astype(int)
    stride = max(1, round(knot_s / step))
    for first, stop in pairwise(edges.tolist()):
        start = max(first - round(before_s / step), 0)
        knots = np.unique(np.append(np.arange(0, stop - start, stride), stop - start))
        state = ChainState.from_vector(run.states[start], chain.layout, start * step)
        found = force_sensitivity(chain, run_up.force_N[start : stop + 1], step, knots, state=state, ends=True)
        if found.ends_slopes is None:
            raise SolveError("the sensitivities of the ends' positions are missing")
        near, far = found.ends_slopes[:, 0], found.ends_slopes[:, 1]
        yield InputWindow(
            time_s=(np.arange(start, stop + 1) - run_up.lead) * step,
            first_s=(first - run_up.lead) * step,
            knots_s=(start + knots - run_up.lead) * step,
            output_slopes=found.tension_slopes[:, 0],
            near_slopes=near,
            elongation_slopes=near - far,
        )
