"""The steady state of a cycle: the state that a period leads back to.

Friction forgets within a period or two, since every full stroke wipes its memory out; relaxation forgets with its own
time constant, which may be many periods. So cycles are run until they repeat, with Anderson's acceleration of the
state at their start: what decays slowly and linearly is found from a few cycles instead of some dozens. A step of the
acceleration that does not pay is taken back, so the search is never worse than running cycles.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.layout import ChainState, StateLayout
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.tendon.simulate import Simulation, simulate

MOST_CYCLES = 40
TOLERANCE = 1e-6
"""Two cycles are the same that differ by less than this share of the signal's range."""

_DEPTH = 4  # cycles that an acceleration looks back on


@dataclass(frozen=True, slots=True, kw_only=True)
class Steadiness:
    """Outcome of a search for a steady cycle.

    Attributes
    ----------
    cycles : int
        Cycles that were run.
    change_N : float
        Largest difference between the last cycle and the one before [N].
    converged : bool
        The difference is below the tolerance.
    """

    cycles: int
    change_N: float
    converged: bool

    def __str__(self) -> str:
        """In words."""
        state = "repeats" if self.converged else "still changes"
        return f"after {self.cycles} cycles the state {state}: {self.change_N:.2g} N from one cycle to the next"


@in_turn
def steady_inverse(chain: Chain, cycle_N: Array, step_s: float) -> tuple[Inversion, Steadiness]:
    """Exact inverse of a reference that repeats, in its steady state; the near end of the chain must act.

    The cycle, shape (n,) [N], is one period, its last row the first of the next. So is what is returned, with its
    states; row 0 is that of the steady cycle and not of a rest.
    """

    def run(state: ChainState) -> tuple[Array, ChainState]:
        found = invert(chain, cycle_N, step_s, state=state)
        return found.force_N[1:], replace(found.final, time_s=0.0)

    rest = chain.rest_state(float(cycle_N[0]))
    state, steadiness = _steady(run, rest, chain.layout, float(np.ptp(cycle_N)))
    # Two periods, of which the second has no seam: the first step of a run is of first order.
    twice = invert(chain, np.concatenate([cycle_N[:-1], cycle_N]), step_s, state=state, record=True)
    second = slice(len(cycle_N) - 1, None)
    least = twice.least_tension_N[second]
    whole = bool(np.all(least > 0))
    return replace(
        twice,
        status=InverseStatus.EXACT if whole else InverseStatus.WOULD_PUSH,
        message=f"{len(cycle_N)} rows, least tension {least.min():.4g} N" if whole else twice.message,
        time_s=np.arange(len(cycle_N), dtype=np.float64) * step_s,
        force_N=twice.force_N[second],
        least_tension_N=least,
        states=None if twice.states is None else twice.states[second],
    ), steadiness


@in_turn
def steady_response(
    chain: Chain, cycle_N: Array, step_s: float, *, initial_tension_N: float, method: Method = Method.BDF2
) -> tuple[Simulation, Steadiness]:
    """Response to a force that repeats, in its steady state; SolveError if a simulation fails.

    The cycle, shape (n,) [N], is one period, its last row the first of the next. The search starts from rest under the
    initial tension [N].
    """
    force = np.asarray(cycle_N, dtype=np.float64)

    def run(state: ChainState) -> tuple[Array, ChainState]:
        found = simulate(chain, force, step_s, state=state, method=method).require()
        return found.output_tension_N[1:], found.final

    state, steadiness = _steady(run, chain.rest_state(initial_tension_N), chain.layout, float(np.ptp(force)))
    twice = simulate(chain, np.concatenate([force[:-1], force]), step_s, state=state, method=method).require()
    second = slice(len(force) - 1, None)
    return replace(
        twice,
        time_s=np.arange(len(force), dtype=np.float64) * step_s,
        tension_N=twice.tension_N[second],
        near_position_m=twice.near_position_m[second],
        far_position_m=twice.far_position_m[second],
    ), steadiness


def _steady(
    run: Callable[[ChainState], tuple[Array, ChainState]], start: ChainState, layout: StateLayout, span: float
) -> tuple[ChainState, Steadiness]:
    """Iterate the map of the period, accelerated, until two cycles are the same."""
    limit = TOLERANCE * max(span, 1e-9)
    starts: list[Array] = []
    ends: list[Array] = []
    state, before, change, previous = start, None, np.inf, np.inf
    for cycle in range(1, MOST_CYCLES + 1):
        signal, end = run(state)
        change = np.inf if before is None else float(np.max(np.abs(signal - before)))
        if change <= limit:
            return end, Steadiness(cycles=cycle, change_N=change, converged=True)
        before = signal
        if change > 2 * previous:  # the last extrapolation led astray
            starts, ends = [], []
        previous = change
        starts, ends = [*starts[1 - _DEPTH :], state.vector()], [*ends[1 - _DEPTH :], end.vector()]
        # The first cycles wipe out what friction remembers of the start; only then is the map smooth.
        state = end if cycle < 3 else ChainState.from_vector(_accelerated(starts, ends), layout)
    return state, Steadiness(cycles=MOST_CYCLES, change_N=change, converged=False)


def _accelerated(starts: list[Array], ends: list[Array]) -> Array:
    """Combination of the last ends whose residuals cancel best (Anderson 1965), in units of each state's size."""
    if len(starts) < 2:
        return ends[-1]
    residuals = np.array([end - start for start, end in zip(starts, ends, strict=True)])
    scale = np.max(np.abs(np.array(ends)), axis=0) + 1e-12
    differences = np.diff(residuals / scale, axis=0).T
    weights = np.linalg.lstsq(differences, residuals[-1] / scale, rcond=1e-8)[0]
    result: Array = ends[-1] - np.diff(np.array(ends), axis=0).T @ weights
    return result
