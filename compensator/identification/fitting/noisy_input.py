"""The measured input is estimated together with the values: what its noise does to the answer is taken out.

The model is driven by a measurement. Its noise is rectified by the play of friction and looks like friction that does
not depend on the load, and the filter against it rounds the extremes that friction remembers. So the true input is
taken for the smoothed one and a correction, linear between knots in time, that costs what the cell's noise makes it
cost. Where output and elongation speak of the input, as they do after each reversal, they contribute to it. A
Gauss-Newton step over values and knots, the knots eliminated window by window, is what moves the values; the slopes are
those of a coarse chain, the residuals those of the fine one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.fitting.residuals import ChainResiduals, FitPiece
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.smoothing import low_pass_piece
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.chain import Drive, InputWindow, input_windows
from tendonff.ocp.fits.least_squares import Blocks, Residuals, Solution

D = Parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class InputSlopes:
    """Slopes of the fitted rows of one window over the knots of the input, and what a correction there costs.

    Laws that are compared may share them: they follow from where the tendon sticks.
    """

    number: int  # of the piece
    first_s: float  # where the window itself begins in the piece; what is before belongs to the window before
    knots_s: Array
    rows: Mask  # among the fitted ones of the piece
    time_s: Array  # of these rows
    by_knots: Array  # shape (m, k); of the explained channel and then the elongation, the zero of positions the last
    price: Array  # of the knots, shape (k, k): what the cell's noise makes a correction cost
    asked: Array  # correction that the readings ask for, times its price, shape (k,)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Rows of one window in units of their noise: residuals, slopes over values and over knots."""

    window: InputSlopes
    size: Array  # noise of each row
    residuals: Array
    by_values: Array
    blocks: Blocks
    knot_blocks: Blocks

    def over_knots(self, change: Array) -> Array:
        """Change of the rows with changes of the knots, shape (k, ...)."""
        return np.asarray((self.window.by_knots @ change).T / self.size).T


def with_input_estimated(
    task: ChainResiduals,
    solution: Solution,
    *,
    slopes: Sequence[InputSlopes] | None = None,
    rounds: int = TUNED.rounds,
    signed: bool = False,
) -> tuple[Solution, Sequence[InputSlopes]]:
    """Values with the input estimated besides, their covariance that of values and input together.

    The task is on many masses; `slopes` over the input are those of another law, or follow from the values in each
    round, and those of the last are returned too. With `signed`, what may vanish may fall below nothing: its scatter
    shows then.
    SolveError if the chain fails on the way, or values and input are not separately identifiable.
    """
    moved, own = solution, slopes or ()
    for _ in range(rounds):
        try:
            own = input_slopes(task, moved) if slopes is None else slopes
            step, covariance = _step(task, moved, own, signed=signed)
        except np.linalg.LinAlgError as error:
            raise SolveError(f"values and input cannot be separated: {error}") from error
        values = {name: moved.values[name] + float(by) for name, by in zip(moved.values, step, strict=True)}
        moved = replace(moved, values=values, covariance=covariance, residuals=residuals_of(task, values))
        if np.all(np.abs(step) < np.sqrt(np.diag(covariance))):
            break
    return moved, own


def residuals_of(task: ChainResiduals, values: Mapping[str, float]) -> Residuals:
    """Residuals without slopes, which cost most; SolveError if the chain fails."""
    return replace(task, free=()).differences(values)


def _step(
    task: ChainResiduals, solution: Solution, slopes: Sequence[InputSlopes], *, signed: bool
) -> tuple[Array, Array]:
    """Change of the values, and their covariance."""
    count = len(solution.values)
    normal, wanted = np.zeros((count, count)), np.zeros(count)
    scores: dict[int, Array] = {}
    eliminated = []
    for rows in _windows(task, solution, slopes):
        weight, coupling, solved = _eliminated(rows)
        normal += rows.by_values.T @ (weight[:, None] * rows.by_values) - coupling[:, :-1].T @ solved[:, :-1]
        wanted -= rows.by_values.T @ (weight * rows.residuals) + coupling[:, :-1].T @ solved[:, -1]
        eliminated.append((rows, weight, solved))
    scale = np.sqrt(np.diag(normal))
    if not np.all(scale > 0):
        raise SolveError("the residuals are insensitive to one of the values")
    inverse = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    step = _feasible(normal, wanted, inverse @ wanted, _least(solution, signed=signed))
    for rows, weight, solved in eliminated:
        knots = solved[:, -1] - solved[:, :-1] @ step
        left = weight * (rows.residuals + rows.by_values @ step + rows.over_knots(knots))
        by_values = rows.by_values - rows.over_knots(solved[:, :-1])
        asked = rows.window.asked - rows.window.price @ knots
        for block in np.unique(rows.blocks):
            at, near = rows.blocks == block, rows.knot_blocks == block
            own = by_values[at].T @ left[at] + solved[near, :-1].T @ asked[near]
            scores[block] = scores.get(block, 0.0) + own
    return step, _clustered(inverse, np.array(list(scores.values())))


def _eliminated(rows: _Rows) -> tuple[Array, Array, Array]:
    """Weights of a window's rows, coupling of its knots with values and residuals, and the knots that both imply.

    The last column is that of the residuals: the correction of the input where the values stay.
    """
    size = max(1.0, 1.4826 * float(np.median(np.abs(rows.residuals)))) * TUNED.large_residual
    weight: Array = 1 / np.sqrt(1 + (rows.residuals / size) ** 2)
    root = np.sqrt(weight)
    by_knots = (root / rows.size)[:, None] * rows.window.by_knots
    inner = by_knots.T @ by_knots + rows.window.price
    inner[np.diag_indices(len(inner))] *= 1 + 1e-9
    wanted = rows.window.asked - by_knots.T @ (root * rows.residuals)
    coupling = np.column_stack([by_knots.T @ (root[:, None] * rows.by_values), wanted])
    return weight, coupling, np.asarray(np.linalg.solve(inner, coupling))


def with_implied_input(task: ChainResiduals, solution: Solution) -> ChainResiduals:
    """The task with the input that the values of a solution imply; SolveError if the chain fails."""
    inputs = [run.drive.input_N.copy() for run in task.pieces]
    for rows in _windows(replace(task, free=()), solution, input_slopes(task, solution)):
        knots_s, number = rows.window.knots_s, rows.window.number
        if not len(knots_s):
            continue
        knots, drive = _eliminated(rows)[2][:, -1], task.pieces[number].drive
        clock = np.arange(len(drive.input_N)) * drive.step_s
        own = (clock >= rows.window.first_s) & (clock <= knots_s[-1])
        inputs[number][own] = drive.input_N[own] + np.interp(clock[own], knots_s, knots[: len(knots_s)])
    pieces = [
        replace(run, drive=replace(run.drive, input_N=given)) for run, given in zip(task.pieces, inputs, strict=True)
    ]
    return replace(task, pieces=pieces)


def misfit(
    task: ChainResiduals, solution: Solution, usual: tuple[float, float], slopes: Sequence[InputSlopes]
) -> float:
    """Squared residuals with the input that the values imply, in units of their noise, and what its correction costs.

    Laws that are compared share `usual`, the size of residuals by channel, as `ChainResiduals.channel_rms` has it, and
    `slopes`.
    """
    total = 0.0
    for rows in _windows(replace(task, free=()), solution, slopes, usual):
        weight, _, solved = _eliminated(rows)
        knots, window = solved[:, -1], rows.window
        left = rows.residuals + rows.over_knots(knots)
        total += float(weight @ left**2 + knots @ (window.price @ knots - 2 * window.asked))
    return total


def _clustered(inverse: Array, scores: Array) -> Array:
    """Covariance by the scatter of blocks, but not below that of independent noise."""
    blocks, count = scores.shape
    scatter = inverse @ (scores.T @ scores) @ inverse * blocks / max(blocks - count, 1)
    excess = np.sqrt(np.maximum(np.diag(scatter) / np.diag(inverse), 1.0))
    return np.asarray(inverse * np.outer(excess, excess))


def _least(solution: Solution, *, signed: bool) -> Array:
    """Largest steps downwards."""
    values = np.array(list(solution.values.values()))
    free = [D(n) for n in solution.values]
    least = np.where([p.tensions.may_vanish for p in free], -values, (TUNED.least_step_share - 1) * values)
    least[[p.tensions.signed or (signed and p.tensions.may_vanish) for p in free]] = -np.inf
    return least


def _feasible(normal: Array, wanted: Array, step: Array, least: Array) -> Array:
    """The step, or the best one that goes no further down than the least."""
    held = np.zeros(len(step), dtype=bool)
    step = step.copy()
    for _ in least:
        below = ~held & (step < least)
        if not below.any():
            break
        held |= below
        step[held] = least[held]
        if (~held).any():
            rest = wanted[~held] - normal[np.ix_(~held, held)] @ step[held]
            step[~held] = np.linalg.solve(normal[np.ix_(~held, ~held)], rest)
    return step


def _windows(
    task: ChainResiduals,
    solution: Solution,
    slopes: Sequence[InputSlopes],
    usual: tuple[float, float] | None = None,
) -> Iterator[_Rows]:
    """Rows of the windows that have slopes over the input."""
    full, found = task.complete(solution.values), solution.residuals
    usual = usual or task.channel_rms(found)
    lefts, every_block = task.by_channel(found.values), task.by_channel(found.blocks)
    for number, own in groupby(slopes, lambda window: window.number):
        run, left, blocks = task.pieces[number], lefts[number], every_block[number][0]
        noise = run.record.travel_noise_m if run.explain is Explain.POSITION else run.record.output_noise_N
        units, noises = (task.output_unit, task.elongation_unit_m), (noise, run.record.elongation_noise_m)
        sizes: Array = np.hypot(np.array(noises) / np.sqrt(run.thin), TUNED.misfit_share * np.array(usual))
        step_s, by_values = _over_values(task, run, full)
        for window in own:
            channels = []
            for k, residuals in enumerate(left if run.with_elongation else left[:1]):
                values = _sampled(by_values[k], 0.0, step_s, window.time_s)
                size = np.full(len(values), sizes[k])
                channels.append((size, residuals[window.rows] * units[k] / sizes[k], values / sizes[k]))
            size, residuals, values = (np.concatenate(x) for x in zip(*channels, strict=True))
            near = np.searchsorted(window.time_s, np.append(window.knots_s, np.inf)).clip(max=len(window.time_s) - 1)
            yield _Rows(
                window=window,
                size=size,
                residuals=residuals,
                by_values=values,
                blocks=np.concatenate([blocks[window.rows]] * len(channels)),
                knot_blocks=blocks[window.rows][near],
            )


def _coarse(task: ChainResiduals, run: FitPiece) -> tuple[ParametricChain, Drive]:
    """The chain that gives slopes, and its drive."""
    model = replace(task.model, count=TUNED.coarse_masses, longest_step_s=TUNED.coarse_step_s)
    every = max(1, round(TUNED.coarse_step_s / run.record.step_s))
    return model, replace(run.drive, input_N=run.drive.input_N[::every], step_s=run.record.step_s * every)


def _over_values(task: ChainResiduals, run: FitPiece, full: Mapping[Parameter, float]) -> tuple[float, list[Array]]:
    """Slopes of the explained channel and of the elongation over the free values, with the step of their rows [s]."""
    model, drive = _coarse(task, run)
    if not task.free:
        return drive.step_s, [np.zeros((len(drive.input_N), 0))] * 2
    response = model.predict(full, drive, task.free)
    slopes = run.predicted(response)[1], response.elongation_slopes
    return drive.step_s, [low_pass_piece(x, drive.step_s, run.record.cutoff_Hz) for x in slopes]


def input_slopes(task: ChainResiduals, solution: Solution) -> tuple[InputSlopes, ...]:
    """Slopes over the input at the values of a solution; SolveError if the chain fails."""
    full = task.complete(solution.values)
    return tuple(
        window
        for number, run in enumerate(task.pieces)
        if run.good.any()
        for window in _input_slopes_of(task, number, run, full)
    )


def _input_slopes_of(
    task: ChainResiduals, number: int, run: FitPiece, full: Mapping[Parameter, float]
) -> Iterator[InputSlopes]:
    model, drive = _coarse(task, run)
    proximal = run.explain is Explain.POSITION
    fitted = np.flatnonzero(run.good) * run.thin * run.record.step_s
    clock = np.arange(len(run.piece.read_N)) * run.record.step_s
    off, noise_N = run.piece.read_N - run.drive.input_N, run.record.input_noise_N
    knot_s = max(TUNED.knot_s, TUNED.least_knot_rows * run.record.step_s)
    window_s, before_s = TUNED.window_knots * knot_s, TUNED.window_knots / 2 * knot_s
    numbers = model.numbers_of(full)
    windows = input_windows(model, numbers, drive, knot_s=knot_s, window_s=window_s, before_s=before_s)
    grid_s = np.asarray(np.arange(len(drive.input_N)) * drive.step_s, dtype=np.float64)
    for window in windows if noise_N > 0 else (_without_knots(grid_s),):
        at = (fitted >= window.first_s) & (fitted < window.time_s[-1])
        inside = (clock >= window.time_s[0]) & (clock < window.time_s[-1]) & run.piece.good
        if not at.any():
            continue
        by_knots = [window.near_slopes if proximal else window.output_slopes, window.elongation_slopes]
        channels = []
        for k, slopes in enumerate(by_knots if run.with_elongation else by_knots[:1]):
            first_s, step_s = float(window.time_s[0]), float(window.time_s[1] - window.time_s[0])
            knots = _sampled(low_pass_piece(slopes, step_s, run.record.cutoff_Hz), first_s, step_s, fitted[at])
            # The zero of positions is arbitrary, in every window anew.
            zero = np.full((int(at.sum()), 1), float(k > 0 or proximal))
            channels.append(np.hstack([knots, zero]))
        price, asked = _price(window.knots_s, clock[inside], off[inside], noise_N)
        yield InputSlopes(
            number=number,
            first_s=window.first_s,
            knots_s=window.knots_s,
            rows=at,
            time_s=fitted[at],
            by_knots=np.concatenate(channels),
            price=price,
            asked=asked,
        )


def _without_knots(time_s: Array) -> InputWindow:
    """A window of a whole piece whose input has no noise: nothing of it is estimated."""
    none = np.zeros((len(time_s), 0))
    return InputWindow(
        time_s=time_s,
        first_s=0.0,
        knots_s=np.zeros(0),
        output_slopes=none,
        near_slopes=none,
        elongation_slopes=none,
    )


def _price(knots_s: Array, time_s: Array, off: Array, noise_N: float) -> tuple[Array, Array]:
    """Cost of a correction at the knots by the cell's noise, and the correction implied by its readings.

    The last row and column are those of the positions' zero, which costs nothing.
    """
    count = len(knots_s)
    if not count:
        return np.full((1, 1), 1e-12), np.zeros(1)
    before = np.clip(np.searchsorted(knots_s, time_s, side="right") - 1, 0, count - 2)
    share = (time_s - knots_s[before]) / (knots_s[before + 1] - knots_s[before])
    off = off / noise_N
    price, asked = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    for left, x in ((0, 1 - share), (1, share)):
        np.add.at(asked, before + left, x * off / noise_N)
        for right, y in ((0, 1 - share), (1, share)):
            np.add.at(price, (before + left, before + right), x * y / noise_N**2)
    price[np.diag_indices(count)] += 1 / (TUNED.widest_correction * noise_N) ** 2
    price[-1, -1] = 1e-12
    return price, asked


def _sampled(slopes: Array, first_s: float, step_s: float, at_s: Array) -> Array:
    """Slopes at other times, shape (n, k)."""
    place = (at_s - first_s) / step_s
    before = np.clip(place.astype(np.int64), 0, len(slopes) - 2)
    share = (place - before)[:, None]
    return np.asarray((1 - share) * slopes[before] + share * slopes[before + 1])
