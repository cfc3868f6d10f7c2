"""Friction read off in gross sliding, without any law about histories: it survives data that no law explains.

Between the two ends it is a ratio of tensions. By section, from tensions measured between the ends: the far end moves
only while the whole path slips, and in these rows ln(T + p) falls from cell to cell by mu times the angle between them,
whatever the bristles do before.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record, clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.capstan import Branch


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingRatio:
    """ln(T_in/T_out) in one direction.

    Attributes
    ----------
    branch : Branch
        Direction: pulling or releasing.
    rows : int
        Number of samples in gross sliding.
    log_ratio : float or None
        Median of ln(T_in/T_out) [-]; None where it has no meaning.
    interval : tuple[float, float] or None
        5 and 95 % points: it covers the drift within and between strokes.
    reason : str
        Why there is none; empty where there is one.
    """

    branch: Branch
    rows: int
    log_ratio: float | None
    interval: tuple[float, float] | None
    reason: str


def sliding_ratios(records: Sequence[Record]) -> tuple[SlidingRatio, ...]:
    """Ratios for both directions over all records together."""
    if not all(r.has_input_position for r in records):
        reason = "no input position was measured: which rows slide is not known; measure it"
        return tuple(SlidingRatio(branch=b, rows=0, log_ratio=None, interval=None, reason=reason) for b in Branch)
    return tuple(_ratio(branch, records) for branch in Branch)


def _ratio(branch: Branch, records: Sequence[Record]) -> SlidingRatio:
    pieces = [(p, _sliding(p, r.step_s, branch) & p.good) for r in records for p in r.pieces]
    near, far = (np.concatenate([getattr(p, name)[rows] for p, rows in pieces]) for name in ("input_N", "output_N"))
    positive = (near > 0) & (far > 0)
    total, refused = len(near), int((~positive).sum())
    if total < TUNED.least_sliding_rows:
        reason = (
            f"{total} samples slide fast and far enough from a reversal, {TUNED.least_sliding_rows} are needed; "
            "use longer strokes"
        )
    elif refused > TUNED.most_refused * total:
        reason = (
            f"{100 * refused / total:.3g} % of the sliding rows have a reading at or below zero, where ln(T_in/T_out) "
            "is undefined: a cell with an offset or signed data; zero the cells without tension and measure again"
        )
    else:
        ratios = np.log(near[positive] / far[positive])
        low, middle, high = (float(v) for v in np.percentile(ratios, [5, 50, 95]))
        return SlidingRatio(branch=branch, rows=total, log_ratio=middle, interval=(low, high), reason="")
    return SlidingRatio(branch=branch, rows=total, log_ratio=None, interval=None, reason=reason)


def _sliding(piece: Piece, step_s: float, branch: Branch) -> Mask:
    """Rows in gross sliding in one direction."""
    q = piece.travel_m()
    speed = np.gradient(q, step_s)
    top = float(np.percentile(np.abs(speed), 98))
    sign = 1.0 if branch is Branch.PULL else -1.0
    moving = sign * speed > TUNED.fast_share * top
    travelled = sign * (q - q[last_reversal(q)])
    return np.asarray(moving & (travelled > TUNED.travel_share * float(np.ptp(q))))


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


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionFriction:
    """Friction between two neighbouring tension cells.

    Attributes
    ----------
    start, stop : str
        Columns of the two cells, from the actuator on.
    start_rad, stop_rad : float
        Wrap angle from the actuator to each of them.
    mu, mu_release : float
        Coefficients of the section [-].
    mu_error, mu_release_error : float
        Their standard errors, by the scatter between strokes.
    """

    start: str
    stop: str
    start_rad: float
    stop_rad: float
    mu: float
    mu_release: float
    mu_error: float
    mu_release_error: float

    @property
    def text(self) -> str:
        """Line."""
        return (
            f"{self.start} to {self.stop} ({self.start_rad:.3g} to {self.stop_rad:.3g} rad): mu {self.mu:.4g} "
            f"(+-{2 * self.mu_error:.2g}) pulling, {self.mu_release:.4g} (+-{2 * self.mu_release_error:.2g}) releasing"
        )


def friction_by_section(
    files: Sequence[Path], how: Measurement, theta_rad: float, adhesion_N: float
) -> tuple[SectionFriction, ...]:
    """Friction between each pair of neighbouring cells; none where nothing was measured between the ends.

    Two neighbouring cells do not tell the load-independent tension `adhesion_N`; InputError if a column is missing, or
    too few strokes slip.
    """
    if not how.tension_columns or not how.tension_angles_rad:
        return ()
    between = sorted(zip(how.tension_angles_rad, how.tension_columns, strict=True))
    cells = [(0.0, how.input_column), *between]
    strokes = _slipping_strokes(files, how)
    to_end = [_to_the_end(files, how, column, adhesion_N, strokes) for _, column in cells]
    to_end.append({branch: np.zeros_like(ratios) for branch, ratios in to_end[0].items()})
    cells.append((theta_rad, how.output_column))
    found = []
    for ((start_rad, start), near), ((stop_rad, stop), far) in pairwise(zip(cells, to_end, strict=True)):
        angle = stop_rad - start_rad
        pull, release = (_known(near[b] - far[b], b, (start, stop)) / angle for b in (Branch.PULL, Branch.RELEASE))
        found.append(
            SectionFriction(
                start=start,
                stop=stop,
                start_rad=start_rad,
                stop_rad=stop_rad,
                mu=float(np.median(pull)),
                mu_release=-float(np.median(release)),
                mu_error=_error(pull),
                mu_release_error=_error(release),
            )
        )
    return tuple(found)


def _error(strokes: Array) -> float:
    """Standard error of a coefficient by stroke, with what presliding leaves of gross sliding."""
    scatter = float(strokes.std(ddof=1) / np.sqrt(len(strokes)))
    return float(np.hypot(scatter, TUNED.section_floor * np.median(strokes)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stroke:
    """Rows of a file in which the far end slips."""

    file: Path
    branch: Branch
    start_s: float
    stop_s: float


def _slipping_strokes(files: Sequence[Path], how: Measurement) -> list[_Stroke]:
    """Strokes of the far end, between which all cells are compared."""
    found = []
    for file in files:
        for piece in clean(read_measurement(file, how), how).pieces:
            far = piece.output_N
            turns = last_reversal(far)
            moved = np.abs(far - far[turns])
            enough = TUNED.slipped_share * float(np.ptp(far))
            for turn in np.unique(turns[turns > 0]):
                stroke = np.flatnonzero(turns == turn)
                # At the end of a stroke the far end stands still while the tension before it has turned round.
                last = int(np.argmax(moved[stroke] >= TUNED.nearly_all * moved[stroke].max()))
                rows = stroke[:last][moved[stroke[:last]] > enough]
                if len(rows):
                    branch = Branch.PULL if far[rows[0]] > far[turn] else Branch.RELEASE
                    times = piece.time_s[rows[[0, -1]]].tolist()
                    found.append(_Stroke(file=file, branch=branch, start_s=times[0], stop_s=times[1]))
    return found


def _to_the_end(
    files: Sequence[Path], how: Measurement, column: str, adhesion_N: float, strokes: Sequence[_Stroke]
) -> dict[Branch, Array]:
    """Logarithm of the tension at a cell over that at the far end: its median in each stroke; NaN in one with a gap."""
    own = column == how.input_column
    pair = replace(
        how,
        input_column=column,
        input_offset_N=how.input_offset_N if own else None,
        input_gain=how.input_gain if own else None,
        skip_s=how.skip_s or 0.0,
    )
    pieces = {file: clean(read_measurement(file, pair), pair).pieces for file in files}
    found: dict[Branch, list[float]] = {branch: [] for branch in Branch}
    for stroke in strokes:
        ratio = np.nan
        for piece in pieces[stroke.file]:
            rows = (piece.time_s >= stroke.start_s) & (piece.time_s <= stroke.stop_s)
            if rows.any() and piece.good[rows].mean() > TUNED.least_good:
                ratio = float(np.median((piece.input_N[rows] + adhesion_N) / (piece.output_N[rows] + adhesion_N)))
        found[stroke.branch].append(np.log(ratio) if ratio > 0 else np.nan)
    return {branch: np.array(ratios) for branch, ratios in found.items()}


def _known(strokes: Array, branch: Branch, cells: tuple[str, str]) -> Array:
    """Strokes that both cells measured; InputError where they are too few."""
    known = strokes[np.isfinite(strokes)]
    if len(known) < TUNED.least_files:
        raise InputError(
            f"friction by section: the far end slips in {len(known)} strokes ({branch}) that {cells[0]} and {cells[1]} "
            f"measured without a gap, {TUNED.least_files} are needed; pull and release further"
        )
    return known
