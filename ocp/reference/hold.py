"""Holds: the force is kept where the reference rests, instead of let go as far as its last move asks.

The exact inverse follows a reference down to its last micrometre. Where a move ends, the load's inertia and the links'
damping turn the sliding round for some milliseconds, friction changes sign along the whole path, and the force falls
(or rises) through the deadband, although the output hardly moves. Inside the deadband nothing need move: a kept
force leaves the output within its drift, spares the actuator the way there and back, and a move that goes on in the
same direction finds the path as it was.

What the chain delivers under such a force is a reference of its own, whose exact inverse is that force. So a caller
hands the *followed* reference to whatever it would have given the original one.
"""

from dataclasses import dataclass

import numpy as np

from tendonff.models.tendon.chain import Chain
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

AT_REST = 1e-4
"""Share of the reference's range within which it counts as resting."""
SHORTEST_HOLD_S = 0.02
BLEND_S = 0.1
"""Time in which the drift of a hold is made good by the move after it."""


END_DRIFT = 1e-3
"""Share of the reference's range that the output may drift by at the end under a kept force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptForce:
    """A force that is kept in holds, and what the chain delivers under it."""

    force_N: Array  # shape (n,); force [N]
    followed_N: Array  # shape (n,); output tension of the design's own chain under it [N]
    holds: tuple[tuple[int, int], ...]  # first and last row of each stretch of constant force
    drift_N: float  # largest distance of the followed tension from the reference [N]: the cost of keeping


def find_holds(reference_N: Array, step_s: float) -> tuple[tuple[int, int], ...]:
    """Stretches in which a reference, shape (n,), rests: first and last row of each."""
    near = AT_REST * float(np.ptp(reference_N))
    resting = np.concatenate([[False], np.diff(reference_N) == 0, [False]])
    edges = np.flatnonzero(np.diff(resting.astype(int)))
    found: list[tuple[int, int]] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if (last - first) * step_s < SHORTEST_HOLD_S:
            continue
        away = np.abs(reference_N - reference_N[first]) > near
        before, after = np.flatnonzero(away[:first]), np.flatnonzero(away[last:])
        start = int(before[-1]) + 1 if before.size else 0
        end = int(last + after[0]) - 1 if after.size else len(reference_N) - 1
        if start > 0:  # a run that starts at rest has nothing to keep
            found.append((start, end))
    return tuple(found)


def last_approach(reference_N: Array, step_s: float) -> tuple[int, int] | None:
    """Rows in which a reference creeps up to its last value; None where it ends in a hold, or in full motion.

    A reversal that begins there is cut off by the end: the reference goes on no further, so it is no corner.
    """
    away = np.flatnonzero(np.abs(reference_N - reference_N[-1]) > AT_REST * float(np.ptp(reference_N)))
    start, end = (int(away[-1]) + 1 if away.size else 0), len(reference_N) - 1
    if start == 0 or end - start < 2 or (end - start) * step_s > SHORTEST_HOLD_S:
        return None
    return start, end


def keep_force(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    holds: tuple[tuple[int, int], ...],
    *,
    initial_tension_N: float | None = None,
) -> KeptForce:
    """Exact inverse of a reference, shape (n,) [N], > 0, between its holds, and a constant force in them.

    The chain's near end must act. Holds are first and last rows, in order and apart. The start is at rest under the
    initial tension, by default the first reference [N].

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.
    SolveError
        If a hold cannot be simulated.
    """
    wanted = np.asarray(reference_N, dtype=np.float64)
    tension = float(wanted[0]) if initial_tension_N is None else initial_tension_N
    force = np.empty_like(wanted)
    force[0] = tension
    state, row, drift = chain.rest_state(tension), 0, 0.0
    for start, end in (*holds, (len(wanted) - 1, len(wanted) - 1)):
        if start > row:
            moved = wanted[row : start + 1] + drift * _fade(start - row, step_s)
            found = invert(chain, moved, step_s, state=state)
            force[row + 1 : start + 1] = found.force_N[1:]
            state = found.final
        if end > start:
            force[start : end + 1] = force[start]
            rest = simulate(chain, force[start : end + 1], step_s, state=state).require()
            drift = float(rest.output_tension_N[-1] - wanted[end])
            state = rest.final
        row = end
    followed = simulate(chain, force, step_s, initial_tension_N=tension).require().output_tension_N
    return KeptForce(
        force_N=force, followed_N=followed, holds=tuple(holds), drift_N=float(np.max(np.abs(followed - wanted)))
    )


def keep_force_to_end(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    holds: tuple[tuple[int, int], ...],
    *,
    initial_tension_N: float | None = None,
) -> KeptForce | None:
    """`keep_force` in holds and in the end that the reference creeps up to, which is followed where keeping drifts.

    None where no force is kept. Exceptions as of `keep_force`.
    """
    wanted, kept = np.asarray(reference_N, dtype=np.float64), None
    if (end := last_approach(wanted, step_s)) is not None:
        kept = keep_force(chain, wanted, step_s, (*holds, end), initial_tension_N=initial_tension_N)
        drift = float(np.max(np.abs(kept.followed_N - wanted)[end[0] :]))
        if drift <= END_DRIFT * float(np.ptp(wanted)):
            return kept
    return keep_force(chain, wanted, step_s, holds, initial_tension_N=initial_tension_N) if holds else None


def _fade(rows: int, step_s: float) -> Array:
    """Smooth step from 1 to 0 over BLEND_S or the rows there are."""
    u = np.minimum(np.arange(rows + 1) / min(max(round(BLEND_S / step_s), 1), rows), 1.0)
    result: Array = 1 - u**3 * (10 - 15 * u + 6 * u * u)
    return result
