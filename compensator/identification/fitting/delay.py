"""A delay between the channels: the output is read later than the input, or earlier."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.dynamic import CoarseFit, fit_coarse
from tendonff.compensator.identification.fitting.uncertainty import slopes_over_all
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.identification.pace import UNHURRIED, Pace
from tendonff.compensator.identification.parameters import Parameter
from tendonff.models.parameters import Transmission
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import gauss_newton_step


@dataclass(frozen=True, slots=True, kw_only=True)
class Delay:
    """Delay of the output channel against the input.

    Parameters
    ----------
    seconds, error_s : float
        Delay and its standard error.
    identified : bool
        Beyond doubt, and more than a part of a sampling step: it was taken out.
    """

    seconds: float
    error_s: float
    identified: bool


def most_delay_s(records: Sequence[Record]) -> float:
    """Longest delay that a logger is believed [s]."""
    longest = max(float(np.ptp(p.time_s)) for r in records for p in r.pieces)
    return min(TUNED.most_delay_s, TUNED.most_delay_share * longest)


def align(
    records: Sequence[Record], coarse: CoarseFit, transmission: Transmission, pace: Pace = UNHURRIED
) -> tuple[Delay, CoarseFit, tuple[Record, ...]]:
    """Find the delay of the output channels, and take it out where it is beyond doubt.

    A delay looks like viscous friction and hides adhesion, so it is found before the law is chosen.
    """
    step = TUNED.least_delay_steps * max(r.step_s for r in records)
    most = most_delay_s(records)
    # Without positions the tendon's values are kept, and an error of theirs imitates a delay.
    sure = TUNED.sure_of_positions if all(r.has_positions for r in records) else TUNED.very_sure
    found, shifted, total = coarse, tuple(records), 0.0
    seconds, error = at_first = _left_in(coarse)
    for _ in range(TUNED.rounds + 1):
        if not step < abs(seconds) or not abs(total + seconds) <= most:
            break
        total += seconds
        shifted = tuple(earlier(r, total) for r in records)
        found = fit_coarse(shifted, transmission, found.task.complete(found.solution.values), several=False, pace=pace)
        seconds, error = _left_in(found)
    if abs(total) > max(sure * error, step) and abs(total + seconds) <= most and _cost(found) < _cost(coarse):
        return Delay(seconds=total + seconds, error_s=error, identified=True), found, shifted
    seconds, error = at_first
    return Delay(seconds=seconds, error_s=error, identified=False), coarse, tuple(records)


def _cost(fit: CoarseFit) -> float:
    """Cost of a fit per row: the elongation tells more of a delay than the tension does."""
    return fit.solution.cost / max(len(fit.solution.residuals.values), 1)


def earlier(record: Record, seconds: float) -> Record:
    """A record whose output is read that much earlier; rows that it does not reach are no longer good."""
    return replace(record, pieces=tuple(_shifted(p, seconds) for p in record.pieces)) if seconds else record


def _shifted(piece: Piece, seconds: float) -> Piece:
    at = piece.time_s + seconds
    inside = (at >= piece.time_s[0]) & (at <= piece.time_s[-1])

    def moved(x: Array) -> Array:
        return np.interp(at, piece.time_s, x)

    return replace(
        piece,
        output_N=moved(piece.output_N),
        output_m=None if piece.output_m is None else moved(piece.output_m),
        good=inside & (moved(piece.good.astype(np.float64)) > 0.99),
    )


def _left_in(fit: CoarseFit) -> tuple[float, float]:
    """Delay that the residuals of a fit still hold, found together with its values and adhesion, and its error."""
    task = replace(fit.task, fixed=fit.task.complete(fit.solution.values))
    found = slopes_over_all(task, (*task.free, Parameter.ADHESION))
    rates: list[Array] = []
    for run in task.pieces:
        response = task.model.predict(task.fixed, run.drive)
        step = run.record.step_s * run.thin
        rates.append(-np.gradient(run.shaped(run.predicted(response)[0]), step)[run.good] / task.output_unit)
        if run.with_elongation:  # the output's position is read by the same clock
            far = run.shaped(response.near_m - response.elongation_m)
            rate = np.gradient(far, step)[run.good] / task.elongation_unit_m
            rates.append(rate - rate.mean())
    slopes = np.column_stack([found.slopes, np.concatenate(rates)])
    if not np.isfinite(slopes).all() or not np.ptp(slopes[:, -1]) > 0:
        raise SolveError("the delay of the output cannot be identified: the first fit does not move")
    seconds = float(gauss_newton_step(found.values, slopes)[-1])
    weight = 1 / np.sqrt(1 + found.values**2)
    scale = np.maximum(np.sqrt((slopes**2).sum(axis=0)), 1e-300)
    inverse = np.linalg.pinv((slopes / scale).T @ (slopes / scale * weight[:, None]), rcond=1e-12)
    # Rows that are independent of each other count: a delay shows at every stroke alike.
    share = float((weight * found.values**2).sum()) / task.independent_rows(found)
    return seconds, float(np.sqrt(max(inverse[-1, -1], 0.0) * share) / scale[-1])
