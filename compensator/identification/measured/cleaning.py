"""From usable rows to evenly sampled pieces: gaps, spikes, signs, noise, low-pass."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.ndimage import median_filter, percentile_filter

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import LEAST_ROWS, Array, Mask
from tendonff.compensator.identification.measured.reading import DataIssue, Finding, Findings, RawMeasurement
from tendonff.compensator.identification.measured.smoothing import (
    RESOLVED,
    adaptive_low_pass,
    even_times,
    find_cutoff_Hz,
    low_pass_piece,
    noise_of,
    thinned,
)
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.path import JointMotion

SHORT_GAP_STEPS = 10.5
"""A gap of at most so many steps is bridged by a straight line, a longer one by a polynomial over both sides."""

LONGEST_BRIDGE_S = 1.0
"""A longer gap splits the file: the history that friction remembers is lost there."""

BRIDGE_DEGREE, BRIDGE_SIDES, BRIDGE_ROWS, BRIDGE_ROOM = 5, 2.0, 20, 0.1
"""Degree of the polynomial; how far from the middle of the gap it is fitted, in lengths of the gap; the rows that it
needs; and how far it may leave their values, as a share of their range."""

SPIKE, SPIKE_ROWS, SPIKE_RANGE, SPIKE_WINDOW_ROWS = 15.0, 2, 0.02, 101
"""A spike leaves the running median by so many times what three of four rows around do, for so many rows at most, and
by at least a share of the range: what rings or chatters for longer is the measurement's own."""

CHANNELS = {"input_N": "input", "output_N": "output", "input_m": "input position", "output_m": "output position"}
MISSING = 2.5
"""Neighbours that are so many steps apart have several rows missing between them."""

NOISE_SHARE, SIGNED_SHARE = 0.005, 0.05
"""Readings below zero by less than the first share of the range are the scatter of a slack cell around its zero, by
more than the second signed data, not a slack cell's offset."""

BIASED_PERCENT = 10.0
"""A cell reads below zero for longer than it overshoots."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Evenly sampled rows without a gap; tensions and positions after the low-pass."""

    time_s: Array  # shape (n,)
    # input_N, output_N: shape (n,)
    input_N: Array
    output_N: Array
    # input_m, output_m: shape (n,)
    input_m: Array | None
    output_m: Array | None
    good: Mask  # shape (n,); False where a value was bridged or a spike replaced
    read_N: Array  # shape (n,); the input as it was read; smoothed harder where nothing happens, it drives the models
    # read_m, read_output_m: the positions as they were read
    read_m: Array | None
    read_output_m: Array | None
    motion: JointMotion | None = None  # joint angles after the low-pass, where the path has joints

    def travel_m(self, *, as_read: bool = False) -> Array:
        """Measured position of the near end, shape (n,) [m]."""
        travel = self.read_m if as_read else self.input_m
        if travel is None:
            raise InputError("the position of the near end was not measured; name it with --input-position-column")
        return travel

    def elongation_m(self) -> Array:
        """Measured elongation with an unknown zero, shape (n,) [m]."""
        if self.output_m is None:
            raise InputError("the position of the far end was not measured; name it with --output-position-column")
        return np.asarray(self.travel_m() - self.output_m)

    def motion_from_start(self) -> JointMotion | None:
        """Joint angles, their time counted from the first row."""
        return None if self.motion is None else replace(self.motion, time_s=self.motion.time_s - self.time_s[0])

    def joint_rad(self) -> dict[str, Array]:
        """Joint angles by name, shape (n,) [rad]."""
        return {} if self.motion is None else dict(zip(self.motion.names, self.motion.at(self.time_s).T, strict=True))

    def part(self, rows: slice) -> "Piece":
        """Some of the rows."""
        channels = {field.name: getattr(self, field.name) for field in fields(self)}
        cut: dict[str, Any] = {name: x[rows] for name, x in channels.items() if isinstance(x, np.ndarray)}
        return replace(self, **cut)

    def decimated(self, every: int, step_s: float) -> "Piece":
        """Every so many rows; the input alone has frequencies above the low-pass, which would fold."""
        return replace(self.part(slice(None, None, every)), input_N=thinned(self.input_N, step_s, every))


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Measured file, cleaned."""

    name: str
    step_s: float  # sampling step of every piece [s]
    cutoff_Hz: float  # of the zero-phase low-pass [Hz]
    pieces: tuple[Piece, ...]
    # input_noise_N, output_noise_N: standard deviation of the white noise before the low-pass [N]
    input_noise_N: float
    output_noise_N: float
    # travel_noise_m, elongation_noise_m: the same of the near end's position, and of the difference of both positions
    # [m]
    travel_noise_m: float
    elongation_noise_m: float
    signed: bool  # readings far below zero: torques of a pre-tensioned loop, or the like
    unread: tuple[str, ...]  # columns of the file that have no use
    started_s: float | None  # seconds from 1970 to its first row, where its time stamps are dates
    findings: tuple[Finding, ...]

    @property
    def zeroed(self) -> bool:
        """Whether the zero of the cells was subtracted."""
        return any(f.issue is DataIssue.OFFSET for f in self.findings)

    @property
    def has_output(self) -> bool:
        """The output tension was measured; else it is NaN."""
        return bool(np.isfinite(self.pieces[0].output_N).all())

    @property
    def has_positions(self) -> bool:
        """Both ends' positions were measured."""
        return self.has_input_position and self.pieces[0].output_m is not None

    @property
    def has_input_position(self) -> bool:
        """The near end's position was measured."""
        return self.pieces[0].input_m is not None

    def decimated(self, longest_step_s: float) -> "Record":
        """The record at a multiple of its step, at most this one, that still resolves its low-pass."""
        every = int(min(longest_step_s, RESOLVED / self.cutoff_Hz) / self.step_s * (1 + 1e-9))
        if every < 2:
            return self
        pieces = tuple(p.decimated(every, self.step_s) for p in self.pieces)
        return replace(self, step_s=every * self.step_s, pieces=pieces)

    def joined(self, name: str) -> Array:
        """A channel over all pieces, shape (rows,)."""
        return np.concatenate([getattr(p, name) for p in self.pieces])


def joints_of(records: Sequence[Record]) -> dict[str, Array]:
    """Angles of each joint over all rows of all records [rad]."""
    every = [piece.joint_rad() for record in records for piece in record.pieces]
    return {name: np.concatenate([angles[name] for angles in every]) for name in every[0]}


def mean_pose(records: Sequence[Record]) -> dict[str, float]:
    """Mean angle of each joint [rad]."""
    return {name: float(angle.mean()) for name, angle in joints_of(records).items()}


def spikes(x: Array) -> Mask:
    """Rows that stand alone, far off their neighbours."""
    off = np.abs(x - median_filter(x, size=2 * SPIKE_ROWS + 1, mode="nearest"))
    low, high = np.percentile(x, [1, 99])
    # The upper quartile: small in quiet surroundings, large where the signal itself rings or jumps.
    around = percentile_filter(off, 75, size=min(SPIKE_WINDOW_ROWS, len(x)), mode="nearest")
    return np.asarray(off > np.maximum(SPIKE * around, SPIKE_RANGE * (high - low)))


def clean(raw: RawMeasurement, how: Measurement) -> Record:
    """Evenly sampled, filtered pieces of one file, with all that was found; InputError if no piece is long enough."""
    findings = Findings(raw.findings)
    intervals = np.diff(raw.time_s)
    step = float(f"{np.median(intervals):.6g}")
    _note_clock(raw, intervals, step, findings)
    starts = sorted({0, *raw.breaks, *(int(k) + 1 for k in np.flatnonzero(intervals > longest_bridge_s(step)))})
    replaced = _spikes_of(raw, starts, findings)
    short: list[float] = []
    grids: list[tuple[dict[str, Array], Mask]] = []
    for start, stop in zip(starts, [*starts[1:], len(raw.time_s)], strict=True):
        rows = slice(start, stop)
        if stop - start < LEAST_ROWS:
            short.append(float(raw.time_s[start]))
        else:
            grids.append(_on_grid(raw, rows, replaced[rows], step))
    if short:
        findings.note(DataIssue.SHORT, "too short to use, left out", short)
    if not grids:
        raise InputError(f"{raw.name}: no piece of {LEAST_ROWS} rows without a gap; nothing to fit")
    longest, _ = max(grids, key=lambda pair: len(pair[1]))
    judged = [longest[name] for name in ("input_N", "output_N") if np.isfinite(longest[name]).all()]
    cutoff = how.cutoff_Hz or find_cutoff_Hz(judged, step)
    pieces = [_smoothed(grid, good, raw.motion, step, cutoff) for grid, good in grids]
    signed = _judge_signs(pieces, findings)
    noises = [[noise_of(grid[name]) if name in grid else 0.0 for name in CHANNELS] for grid, _ in grids]
    input_noise, output_noise, near_noise, far_noise = np.average(
        noises, axis=0, weights=[len(good) for _, good in grids]
    )
    return Record(
        name=raw.name,
        step_s=step,
        cutoff_Hz=cutoff,
        pieces=tuple(pieces),
        input_noise_N=float(input_noise),
        output_noise_N=float(output_noise),
        travel_noise_m=float(near_noise),
        elongation_noise_m=float(np.hypot(near_noise, far_noise)),
        signed=signed,
        unread=raw.unread,
        started_s=raw.started_s,
        findings=tuple(findings),
    )


def _smoothed(grid: dict[str, Array], good: Mask, motion: JointMotion | None, step: float, cutoff_Hz: float) -> Piece:
    """A piece whose channels went through the low-pass, joint angles included; what drives the models, its own one."""
    smooth = {name: low_pass_piece(x, step, cutoff_Hz) for name, x in grid.items() if name not in ("time_s", "input_N")}
    time = grid["time_s"]
    if motion is not None:
        columns = [low_pass_piece(column, step, cutoff_Hz) for column in motion.at(time).T]
        motion = JointMotion(names=motion.names, time_s=time, angle_rad=np.column_stack(columns))
    return Piece(
        time_s=time,
        input_N=adaptive_low_pass(grid["input_N"], step),
        output_N=smooth["output_N"],
        input_m=smooth.get("input_m"),
        output_m=smooth.get("output_m"),
        good=good,
        read_N=grid["input_N"],
        read_m=grid.get("input_m"),
        read_output_m=grid.get("output_m"),
        motion=motion,
    )


def longest_bridge_s(step_s: float) -> float:
    """Longest interval between rows that is bridged [s]."""
    return max(LONGEST_BRIDGE_S, SHORT_GAP_STEPS * step_s)


def _bridge(grid_time: Array, filled: Array, time: Array, values: Array, longest_line_s: float) -> Array:
    """Replace straight lines across longer gaps by a polynomial that fits what was measured on both sides."""
    for k in np.flatnonzero(np.diff(time) > longest_line_s):
        start, stop = time[k], time[k + 1]
        near = np.abs(time - (start + stop) / 2) <= BRIDGE_SIDES * (stop - start)
        if near.sum() < BRIDGE_ROWS:
            continue
        shape = np.polynomial.Polynomial.fit(time[near], values[near], BRIDGE_DEGREE)
        inside = (grid_time > start) & (grid_time < stop)
        room = BRIDGE_ROOM * np.ptp(values[near])
        filled[inside] = np.clip(shape(grid_time[inside]), values[near].min() - room, values[near].max() + room)
    return filled


def _note_clock(raw: RawMeasurement, intervals: Array, step: float, findings: Findings) -> None:
    line, longest = SHORT_GAP_STEPS * step, longest_bridge_s(step)
    for wide, action in (
        (
            (intervals > (MISSING - 1) * step) & (intervals <= line),
            "bridged by straight lines, and not fitted where several rows are missing",
        ),
        ((intervals > line) & (intervals <= longest), "bridged by a smooth curve and not fitted"),
        (intervals > longest, "a new piece starts after each"),
    ):
        if wide.any():
            findings.note(DataIssue.GAP, f"up to {intervals[wide].max():.3g} s, {action}", raw.time_s[:-1][wide])


def _spikes_of(raw: RawMeasurement, starts: list[int], findings: Findings) -> Mask:
    """Rows with a spike in any channel."""
    marked = np.zeros(len(raw.time_s), dtype=bool)
    for channel, name in CHANNELS.items():
        values = getattr(raw, channel)
        if values is None or np.isnan(values).any():
            continue
        found = np.concatenate([spikes(part) for part in np.split(values, starts[1:])])
        if found.any():
            action = f"in the {name}, replaced by a straight line and not fitted"
            findings.note(DataIssue.SPIKE, action, raw.time_s[found])
        marked |= found
    return marked


def _on_grid(raw: RawMeasurement, rows: slice, replaced: Mask, step: float) -> tuple[dict[str, Array], Mask]:
    """Channels of one piece on an even grid, and which grid rows lie on measured ones."""
    time, keep = raw.time_s[rows], ~replaced
    grid_time = even_times(time, step)
    grid = {"time_s": grid_time}
    for name in CHANNELS:
        values = getattr(raw, name)
        if values is not None:
            line = np.interp(grid_time, time[keep], values[rows][keep])
            grid[name] = _bridge(grid_time, line, time[keep], values[rows][keep], SHORT_GAP_STEPS * step)
    good_time = time[keep]
    nearest = np.clip(np.searchsorted(good_time, grid_time), 1, len(good_time) - 1)
    width = good_time[nearest] - good_time[nearest - 1]
    good = np.asarray(width < MISSING * step)
    nearest_row = np.rint((time[replaced] - time[0]) / step).astype(np.int64)
    good[np.clip(nearest_row, 0, len(good) - 1)] = False
    return grid, good


def _judge_signs(pieces: list[Piece], findings: Findings) -> bool:
    """Whether the data is signed; notes readings below zero either way."""
    any_signed = False
    for name, channel in (("input", "input_N"), ("output", "output_N")):
        values = np.concatenate([getattr(p, channel) for p in pieces])
        time = np.concatenate([p.time_s for p in pieces])
        below = values < 0
        if not below.any():
            continue
        span, share, lowest = float(np.ptp(values)), 100 * float(below.mean()), float(values.min())
        signed = -np.percentile(values, 1) > SIGNED_SHARE * span
        biased = not signed and share > BIASED_PERCENT and -lowest > NOISE_SHARE * span
        if signed:
            action = f"{share:.2g} % of the {name}, down to {lowest:.4g}: read as signed forces of a pre-tensioned loop"
        elif biased:
            action = (
                f"{share:.2g} % of the {name} lies below zero, down to {lowest:.4g}: a tendon cannot push, so this "
                "cell reads too low by an amount that the file does not tell; zero it without tension and measure again"
            )
        else:
            action = f"of the {name}, down to {lowest:.4g}: slack or a cell's offset, kept"
        findings.note(DataIssue.BIAS if biased else DataIssue.NEGATIVE, action, time[below], int(below.sum()))
        any_signed |= signed
    return any_signed
