"""Tension ratios in gross sliding, read off without any law about histories: they survive data that no law explains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.models.capstan import Branch

FAST_SHARE, TRAVEL_SHARE = 0.5, 0.4
"""Gross sliding: faster than a share of the usual top speed, further from the reversal than a share of the stroke."""

LEAST_ROWS = 50
MOST_REFUSED = 0.05
"""A direction with more than this share of readings at or below zero has no ratio."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingRatio:
    """ln(T_in/T_out) in one direction."""

    branch: Branch
    rows: int  # rows in gross sliding
    log_ratio: float | None  # median of ln(T_in/T_out); None where it has no meaning
    interval: tuple[float, float] | None  # 5 and 95 % points: it covers the drift within and between strokes
    reason: str  # why there is none; empty where there is one


def sliding_ratios(records: Sequence[Record]) -> tuple[SlidingRatio, ...]:
    """Ratios for both directions over all records together."""
    if not all(r.has_input_position for r in records):
        reason = "no input position was measured: which rows slide is not known; measure it"
        return tuple(SlidingRatio(branch=b, rows=0, log_ratio=None, interval=None, reason=reason) for b in Branch)
    found = []
    for branch in Branch:
        ratios = []
        total = refused = 0
        for record in records:
            for piece in record.pieces:
                rows = _sliding(piece, record.step_s, branch) & piece.good
                near, far = piece.input_N[rows], piece.output_N[rows]
                positive = (near > 0) & (far > 0)
                total += len(near)
                refused += int((~positive).sum())
                ratios.append(np.log(near[positive] / far[positive]))
        found.append(_judge(branch, np.concatenate(ratios), total, refused))
    return tuple(found)


def _judge(branch: Branch, ratios: Array, total: int, refused: int) -> SlidingRatio:
    if total < LEAST_ROWS:
        reason = f"{total} rows slide fast and far enough from a reversal, {LEAST_ROWS} are needed; use longer strokes"
    elif refused > MOST_REFUSED * total:
        reason = (
            f"{100 * refused / total:.3g} % of the sliding rows have a reading at or below zero, where ln(T_in/T_out) "
            "is undefined: a biased cell or signed data; zero the cells without tension and measure again"
        )
    else:
        low, middle, high = (float(v) for v in np.percentile(ratios, [5, 50, 95]))
        return SlidingRatio(branch=branch, rows=total, log_ratio=middle, interval=(low, high), reason="")
    return SlidingRatio(branch=branch, rows=total, log_ratio=None, interval=None, reason=reason)


def _sliding(piece: Piece, step_s: float, branch: Branch) -> Mask:
    """Rows in gross sliding in one direction."""
    q = piece.travel_m()
    speed = np.gradient(q, step_s)
    top = float(np.percentile(np.abs(speed), 98))
    sign = 1.0 if branch is Branch.PULL else -1.0
    moving = sign * speed > FAST_SHARE * top
    travelled = sign * (q - q[last_reversal(q)])
    return np.asarray(moving & (travelled > TRAVEL_SHARE * float(np.ptp(q))))


def last_reversal(q: Array) -> NDArray[np.int64]:
    """Row of the last reversal of a motion, shape (n,); chatter below 2 % of the stroke does not count."""
    dead = 0.02 * float(np.ptp(q))
    rows = np.zeros(len(q), dtype=np.int64)
    extreme, direction, start = 0, 0, 0
    for k in range(1, len(q)):
        if direction == 0:
            if abs(q[k] - q[0]) > dead:
                direction = 1 if q[k] > q[0] else -1
                extreme = k
        elif direction * (q[k] - q[extreme]) >= 0:
            extreme = k
        elif direction * (q[extreme] - q[k]) > dead:
            start, extreme, direction = extreme, k, -direction
        rows[k] = start
    return rows
