"""Where the search starts and where its knots go, and how a long horizon is cut into pieces.

What decides how good the answer is: how early the force leaves the inverse at each reversal. So the search starts from
the exact inverse with its jumps spread over several times, within the limits, and takes the best of them between each
two reversals. Where a limit of the actuator's motion binds, its best motion is searched first (`led_start`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from tendonff.models.layout import ChainInputs
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.batch import Progress
from tendonff.ocp.tendon.simulate import Simulator, simulate
from tendonff.ocp.tracking.cost import Knots, evaluate
from tendonff.ocp.tracking.diagnosis import reversals
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import INSIDE
from tendonff.ocp.tracking.problem import MotionBound, TrackingProblem
from tendonff.ocp.tracking.sqp import Profile, SqpResult, best_of_blocks, solve_sqp

_PER_SWING = 24  # knots between two reversals of the reference
_LEAST = 120  # knots of the whole horizon
_AT_LIMIT = 1e-3  # a row counts as limited within this share of the limit
_KNOTS_KEPT, _KNOTS_SEEN = 144, 36  # of a piece: that it keeps, and that it sees beyond
_KNOTS_ALONE = 300  # of a horizon that is one piece
_WIDTHS = 8  # over which jumps are spread, between 2 rows and ...
_WIDEST = 24  # ... so many knots: a swing
_TRUST = 0.1  # of the reference's range: largest change of the first step
_LEAD = 300.0  # stiffness of the leading spring over that of tendon and load in series
_CORNER_S = 0.008  # half the time in which the end may change its speed at a limit
_FREE = 100.0  # times what the inverse needs: no limit
_ABOVE = (0.0, 0.25, 0.5, 0.75, 1.0)  # shares between two motions within the limit of the speed
_SHARES = (0.95, 0.8, 0.6, 0.4, 0.2, 0.0)  # of a start's changes, tried in turn where all of them go slack


def search(
    problem: TrackingProblem, wanted_N: Sequence[Array], iterations: int, progress: Progress | None = None
) -> tuple[Array, tuple[SqpResult, ...]]:
    """Search for the best profile, piece by piece; the plants keep moving on what was kept.

    Parameters
    ----------
    problem : TrackingProblem
    wanted_N : sequence of ndarray, shape (n,)
        Profiles to start from, whatever the limits [N]; see `starts`.
    iterations : int
        Most quadratic programs of a piece.
    progress : callable, optional
        Callback(completed, total), in iterations.

    Returns
    -------
    force_N : ndarray, shape (n,)
    results : tuple of SqpResult
        Of each piece.
    """
    spacing, rows = knot_spacing(problem.reference_N), len(problem.reference_N)
    length = rows if rows <= _KNOTS_ALONE * spacing else _KNOTS_KEPT * spacing
    pieces = list(windows(rows, length, _KNOTS_SEEN * spacing))
    counted, total = 0, iterations * len(pieces)

    def tell() -> None:
        nonlocal counted
        counted += 1
        if progress is not None:
            progress(counted, total)

    start = ChainInputs.of_force(np.array([problem.start_N]))
    simulators = [Simulator(p.chain, problem.step_s, p.state, start) for p in problem.plants]
    force, results = np.array([problem.start_N]), []
    for first, keep, end in pieces:
        here = slice(first, end + 1)
        part = problem.piece(here, tuple(s.state for s in simulators), float(force[-1]))
        results.append(_search_piece(part, [wanted[here] for wanted in wanted_N], spacing, iterations, tell))
        kept = results[-1].force_N[1 : keep - first + 1]
        force = np.concatenate([force, kept])
        if end > keep:
            for simulator in simulators:
                simulator.advance(ChainInputs.of_force(kept))
    if progress is not None:
        progress(total, total)
    return force, tuple(results)


def windows(rows: int, length: int, overlap: int) -> Iterator[tuple[int, int, int]]:
    """First row, last row kept and last row seen of pieces that keep `length` rows and see `overlap` rows beyond."""
    start = 0
    while start < rows - 1:
        # A last piece shorter than the overlap is not worth a piece of its own.
        keep = rows - 1 if start + length + overlap >= rows - 1 else start + length
        yield start, keep, min(keep + overlap, rows - 1)
        start = keep


def _search_piece(
    problem: TrackingProblem, wanted_N: list[Array], spacing: int, iterations: int, tell: Callable[[], None]
) -> SqpResult:
    """The best start, and the descent from there."""
    best = best_start(problem, wanted_N)
    knots, trust = even_knots(len(problem.reference_N), spacing), _TRUST * float(np.ptp(problem.reference_N)) + 1e-6
    force = straightened(best[1], knots, problem.limits, problem.step_s)
    straight = (evaluate(problem, force), force)
    begun = straight if straight[0].beyond_N <= best[0].beyond_N else best
    found = solve_sqp(problem, begun, knots, iterations, trust, tell)
    return replace(found, force_N=best[1], evaluation=best[0]) if best[0].merit < found.evaluation.merit else found


def best_start(problem: TrackingProblem, wanted_N: Sequence[Array]) -> Profile:
    """The best of some profiles within the limits, between each two reversals of the reference."""
    return best_of_blocks(problem, [_taut(problem, problem.clipped(wanted)) for wanted in wanted_N])


def starts(problem: TrackingProblem, inverse_N: Array, law_N: Array) -> tuple[Array, ...]:
    """Profiles to start from: exact inverse, capstan law, the inverse early, the inverse with its jumps spread.

    `inverse_N` and `law_N` have the shape (n,) and are without limits [N].
    """
    early = problem.limits.apply(inverse_N[::-1], problem.step_s, float(inverse_N[-1]))[::-1]
    adhesion = problem.plants[0].chain.elements.piece.adhesion_N
    lifted = problem.reference_N + adhesion
    exponent = np.log(np.maximum(inverse_N + adhesion, 1e-3 * lifted) / lifted)
    widths = np.geomspace(2, max(_WIDEST * knot_spacing(problem.reference_N), 3), _WIDTHS)
    spread = [lifted * np.exp(moving_mean(exponent, round(w))) - adhesion for w in widths]
    return inverse_N, law_N, early, *spread


def moving_mean(values: Array, rows: int) -> Array:
    """Mean over so many rows around each one, shape (n,), the ends repeated; scipy.ndimage is slow to import."""
    padded = np.pad(values, (rows // 2, rows - 1 - rows // 2), mode="edge")
    return np.convolve(padded, np.full(rows, 1 / rows), "valid")


def led_start(problem: TrackingProblem, inverse_N: Array, iterations: int) -> Array:
    """The force that moves the nominal plant's end along the best motion within its limits, shape (n,) [N].

    The end is led by a stiff spring, and the drive of that spring is searched. There a limit of the speed is one of a
    rate, and the output follows the position smoothly where by the force it sticks and slips. The rate of the force is
    not limited yet. SolveError if a simulation fails.
    """
    plant, limits, motion, step_s = problem.plants[0], problem.limits, problem.limits.motion, problem.step_s
    free_m = simulate(plant.chain, inverse_N, step_s, state=plant.state).require().near_position_m
    lead = _LEAD * problem.rest_N / plant.origin_m
    chain = plant.chain.with_end_stiffness(lead, plant.chain.far.stiffness_N_per_m)
    drive, at_rest = inverse_N + lead * free_m, lead * plant.origin_m
    drive[0] = problem.start_N + lead * plant.state.near_position_m
    span, rate = float(np.ptp(drive)), float(np.max(np.abs(np.diff(drive)))) / step_s
    of_force = MotionBound(per_force=1.0, low=limits.minimum_N, high=limits.maximum_N, newtons=1.0)
    bounds = [
        replace(
            bound,
            per_travel_per_m=bound.per_travel_per_m - lead * bound.per_force,
            low=bound.low + at_rest * bound.per_force,
            high=bound.high + at_rest * bound.per_force,
        )
        for bound in (*plant.bounds, of_force)
        if bound.per_force or bound.per_travel_per_m
    ]
    fastest = lead * motion.speed_m_per_s * (1 - INSIDE) if math.isfinite(motion.speed_m_per_s) else _FREE * rate
    led = replace(
        problem,
        plants=(replace(plant, chain=chain, bounds=tuple(bounds)),),
        chains=1,
        limits=ForceLimits(
            minimum_N=float(drive.min()) - _FREE * span,
            maximum_N=float(drive.max()) + _FREE * span,
            rate_N_per_s=fastest,
        ),
        start_N=float(drive[0]),
        effort_weight=0.0,
        travel_weight=0.0,
    )
    found, _ = search(led, _within_speed(drive, fastest * step_s), iterations)
    found = _rounded_off(found, step_s)
    run = simulate(chain, found, step_s, state=plant.state).require()
    force: Array = found - lead * run.near_position_m
    return force


def _within_speed(drive_N: Array, most_N: float) -> list[Array]:
    """The drive, and what follows it in steps of at most `most_N`, between the lowest above and the highest below."""
    ramp = most_N * np.arange(len(drive_N))
    below = np.minimum.accumulate(drive_N - ramp) + ramp
    below = (np.minimum.accumulate((below + ramp)[::-1]))[::-1] - ramp
    above = np.maximum.accumulate(drive_N + ramp) - ramp
    above = (np.maximum.accumulate((above - ramp)[::-1]))[::-1] + ramp
    return [drive_N, *(share * above + (1 - share) * below for share in _ABOVE)]


def _rounded_off(drive_N: Array, step_s: float) -> Array:
    """The drive without the corners of a limited rate, where the mass would need an impulse; its start stays."""
    rows = max(round(_CORNER_S / step_s), 1)
    box = np.full(2 * rows + 1, 1 / (2 * rows + 1))
    for _ in range(2):
        rest = np.pad(drive_N, (rows, 0), mode="reflect", reflect_type="odd")
        drive_N = np.convolve(np.pad(rest, (0, rows), mode="edge"), box, "valid")
    return drive_N


def _taut(problem: TrackingProblem, force_N: Array) -> Profile:
    """The profile, or the largest share of its changes that breaks no bound: a slack tendon shows no slope."""
    first = (evaluate(problem, force_N), force_N)
    for share in _SHARES if first[0].beyond_N > 0 else ():
        mixed = problem.start_N + share * (force_N - problem.start_N)
        evaluation = evaluate(problem, mixed)
        if evaluation.beyond_N == 0:
            return evaluation, mixed
    return first


def knot_spacing(reference_N: Array) -> int:
    """Rows between knots."""
    n, swings = len(reference_N), len(reversals(reference_N)) + 1
    return int(np.clip(n / (_PER_SWING * swings), 1, max(n // _LEAST, 1)))


def even_knots(rows: int, spacing: int) -> Knots:
    """Knots every `spacing` rows, and at the last row."""
    return np.unique(np.append(np.arange(0, rows - 1, spacing), rows - 1))


def limited_rows(force_N: Array, step_s: float, limits: ForceLimits) -> np.typing.NDArray[np.bool_]:
    """Whether the step into each row 1 .. n - 1 is at a limit, shape (n - 1,)."""
    rate, force = np.abs(np.diff(force_N)) / step_s, force_N[1:]
    margin = _AT_LIMIT * min(limits.maximum_N - limits.minimum_N, float(np.ptp(force_N)) + 1e-12)
    return np.asarray(
        (rate > (1 - _AT_LIMIT) * limits.rate_N_per_s)
        | (force > limits.maximum_N - margin)
        | (force < limits.minimum_N + margin)
    )


def straightened(force_N: Array, knots: Knots, limits: ForceLimits, step_s: float) -> Array:
    """The profile made linear between knots in and next to the intervals where a limit binds.

    So a ramp may begin and end at a knot; elsewhere the profile keeps its fine structure.
    """
    hit = np.logical_or.reduceat(limited_rows(force_N, step_s, limits), knots[:-1])
    near = hit.copy()
    near[1:] |= hit[:-1]
    near[:-1] |= hit[1:]
    inside = np.append(False, np.repeat(near, np.diff(knots)))
    return np.where(inside, np.interp(np.arange(len(force_N)), knots, force_N[knots]), force_N)
