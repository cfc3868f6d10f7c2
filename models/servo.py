"""Way from a command to what the drive does: sampling, hold, delay, lag and backlash, for any kind of drive.

    command --[ sampling, resolution ]--[ line | hold | late ]--[ delay ]--[ lag ]--[ play ]--> drive

The command is a force, a position or an angle, and so is what the drive does; a lag is a first-order servo,
servo_time dy/dt = u - y. Forward the chain is exact for a command that goes straight between its samples. Backwards,
for a reference that is known in advance, the command is advanced by what is late, and where it is held between samples
its values are those of least squares on the drive's output.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import require, require_given
from tendonff.models.layout import Array

TURNING = 0.05
"""Share of its play by which a drive turns back before it is crossed [-]: rounding is no reversal."""

_SAME = 1e-9  # of an interval, by which two times are one


class CommandHold(StrEnum):
    """Course of a drive between samples of its commands.

    Attributes
    ----------
    LINE
        A straight line from one to the next, as a drive does that is sent targets with the time to reach them.
    HOLD
        The last one, until the next one arrives.
    LATE
        A straight line that starts when a command arrives: one interval late.
    """

    LINE = "line"
    HOLD = "hold"
    LATE = "late"


class DriveClass(StrEnum):
    """Kind of drive whose lag and delay were not measured: what is assumed of them, with a spread.

    Attributes
    ----------
    HOBBY_SERVO
        A servo that is commanded by pulses.
    DYNAMIXEL
        A smart servo on a serial bus.
    INDUSTRIAL
        A drive on a field bus with a current loop of its own.
    IDEAL
        Without lag or delay: nothing is assumed.
    """

    HOBBY_SERVO = "hobby servo"
    DYNAMIXEL = "dynamixel"
    INDUSTRIAL = "industrial"
    IDEAL = "ideal"


ASSUMED_S: dict[DriveClass, dict[str, tuple[float, float]]] = {
    DriveClass.HOBBY_SERVO: {"servo_time_s": (0.01, 0.06), "delay_s": (0.005, 0.025)},
    DriveClass.DYNAMIXEL: {"servo_time_s": (0.005, 0.03), "delay_s": (0.001, 0.01)},
    DriveClass.IDEAL: {},
    DriveClass.INDUSTRIAL: {"servo_time_s": (0.0005, 0.004), "delay_s": (0.0002, 0.002)},
}
"""Intervals that are assumed of a class [s]: estimates that leave room, not data of a product. The pulses of a hobby
servo come every 20 ms, a serial bus is asked every few milliseconds, a field bus every millisecond or less."""


def stated_or_assumed_s(stated_s: float | None, kind: DriveClass | None, key: str) -> float:
    """Time that a drive states, 0 too, else the middle of what is assumed of its class; 0 without one, or ideal [s]."""
    if stated_s is not None:
        return stated_s
    return 0.0 if kind is None else sum(ASSUMED_S[DriveClass(kind)].get(key, (0.0, 0.0))) / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo:
    """The way from a command to the drive.

    Parameters
    ----------
    servo_time_s : float
        Time constant with which the drive follows [s], >= 0.
    delay_s : float
        Dead time before it does [s], >= 0.
    command_interval_s : float, optional
        Time between two commands [s], > 0; default: one a step.
    command_hold : CommandHold
        Between two commands.
    resolution : float
        Step of the command in its unit, >= 0.
    play : float
        Way that the drive crosses at a reversal before it moves what follows, in its unit, >= 0.
    """

    servo_time_s: float = 0.0
    delay_s: float = 0.0
    command_interval_s: float | None = None
    command_hold: CommandHold = CommandHold.LINE
    resolution: float = 0.0
    play: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "command_hold", CommandHold(self.command_hold))
        for name in ("servo_time_s", "delay_s", "resolution", "play"):
            require(name, getattr(self, name), least=0, hint="leave it out for none")
        require_given("command_interval_s", self.command_interval_s, above=0, hint="leave it out for one a step")

    @property
    def is_ideal(self) -> bool:
        """The drive does what is commanded, at once."""
        return self == Servo()

    def is_rough(self, step_s: float) -> bool:
        """Its output has kinks that are not those of a smooth command: samples, steps of a resolution, or a play."""
        sampled = self._interval_s(step_s) > step_s * (1 + _SAME) or self.command_hold is CommandHold.HOLD
        return sampled or self.resolution > 0 or self.play > 0

    def jumps(self, step_s: float) -> bool:
        """Its output jumps: what is held or comes in steps at every row, and no lag smooths it."""
        stepped = self.resolution > 0 and self._interval_s(step_s) <= step_s * (1 + _SAME)
        return self.servo_time_s == 0 and (stepped or self.command_hold is CommandHold.HOLD)

    @property
    def turning(self) -> float:
        """Way back from where it went furthest that counts as a reversal, in the unit of the command."""
        return max(TURNING * self.play, self.resolution)

    def lag_s(self, step_s: float, *, live: bool = False) -> float:
        """Time by which the output is late if the command is what is wanted [s]; live, that which remains then.

        A servo's lag is taken back live too, from the rate so far.
        """
        interval = self._interval_s(step_s)
        held = {CommandHold.LINE: 0.0, CommandHold.HOLD: interval / 2, CommandHold.LATE: interval}[self.command_hold]
        if live and self.command_hold is CommandHold.LINE and interval > step_s * (1 + _SAME):
            held = interval
        return self.delay_s + held + (0.0 if live else self.servo_time_s)

    def follow(self, command: Array, step_s: float, refinement: int = 1) -> Array:
        """Output of the drive for commands, linear between rows of a step; at rest before.

        Parameters
        ----------
        command : ndarray, shape (n,) or (n, columns)
        step_s : float
            Between its rows [s].
        refinement : int, optional
            Rows of the output to a row of the command.

        Returns
        -------
        ndarray, shape ((n - 1) refinement + 1,) or the same with columns
        """
        given = np.asarray(command, dtype=np.float64)
        if given.ndim == 2:
            return np.column_stack([self.follow(column, step_s, refinement) for column in given.T])
        time: Array = np.arange((len(given) - 1) * refinement + 1, dtype=np.float64) * (step_s / refinement)
        at, values = self._sampled(given, step_s)
        starts = at + self.delay_s
        if self.servo_time_s == 0:
            return played(self._between(time, time, starts, values)[0], self.play)
        inside = starts[(starts > 0) & (starts < time[-1])]
        every = _merged(time, inside, step_s / refinement)
        left, right = self._between(every[:-1], every[1:], starts, values)
        reached = _lagged(np.diff(every), left, right, self.servo_time_s, float(given[0]))
        rows = np.searchsorted(every, time - _SAME * step_s)
        return played(reached[rows], self.play)

    def command(self, wanted: Array, step_s: float, *, live: bool = False) -> Array:
        """Commands whose answer is what is wanted, rows alike, shape (n,) or (n, columns).

        Known in advance, everything is taken back; live, the rate is known from the samples so far alone, and
        `lag_s` remains.
        """
        given = np.asarray(wanted, dtype=np.float64)
        if given.ndim == 2:
            return np.column_stack([self.command(column, step_s, live=live) for column in given.T])
        aimed = crossed(given, self.play, self.turning)
        interval = self._interval_s(step_s)
        if live or self.command_hold is not CommandHold.HOLD:
            # The play is crossed at once, whatever the lag.
            rate = _rate_so_far(given, step_s) if live else _rate(given, step_s)
            advanced = aimed + self.servo_time_s * rate if self.servo_time_s > 0 else aimed
            early = 0.0 if live else self.delay_s + (interval if self.command_hold is CommandHold.LATE else 0.0)
            return _advanced(advanced, early, step_s)
        if interval <= step_s * (1 + _SAME):
            early = self.delay_s + interval / 2
            return _advanced(aimed + self.servo_time_s * _rate(given, step_s), early, step_s)
        return self._held(aimed, step_s)

    def _interval_s(self, step_s: float) -> float:
        return max(self.command_interval_s or 0.0, step_s)

    def _sampled(self, command: Array, step_s: float) -> tuple[Array, Array]:
        """Times and values of the commands that are sent."""
        interval, time = self._interval_s(step_s), np.arange(len(command)) * step_s
        if interval <= step_s * (1 + _SAME):
            at, values = time, command
        else:
            at = np.arange(0.0, time[-1] + interval, interval)
            values = np.interp(at, time, command)
        late = interval if self.command_hold is CommandHold.LATE else 0.0
        starts: Array = np.asarray(at + late, dtype=np.float64)
        return starts, rounded(values, self.resolution)

    def _between(self, first: Array, second: Array, at: Array, values: Array) -> tuple[Array, Array]:
        """Commanded values just after the first and just before the second of two times."""
        if self.command_hold is not CommandHold.HOLD:
            left: Array = np.interp(first, at, values)
            right: Array = np.interp(second, at, values)
            return left, right
        width = at[1] - at[0] if len(at) > 1 else 1.0
        held: Array = values[np.clip(np.searchsorted(at, first + _SAME * width, side="right") - 1, 0, None)]
        return held, held

    def _held(self, aimed: Array, step_s: float) -> Array:
        """Samples, held until the next one, whose answer is nearest to what is aimed at, as a line through them."""
        from scipy import sparse  # here: few drives hold their commands, and it takes a tenth of a second to import
        from scipy.sparse.linalg import spsolve

        interval, rows = self._interval_s(step_s), len(aimed)
        time = np.arange(rows) * step_s
        at = np.arange(0.0, time[-1] + interval, interval)
        # The share of a step that each sample has in the rows: D y = G u, with a row's weight of the lag.
        keep = math.exp(-step_s / self.servo_time_s) if self.servo_time_s > 0 else 0.0
        edges = np.append(at + self.delay_s, np.inf)
        entries = [(0, 0, 0.0)]
        for row in range(1, rows):
            low, high = time[row - 1], time[row]
            first = max(int(np.searchsorted(edges, low + _SAME * step_s, side="right")) - 1, 0)
            k = first
            while k < len(at) and (k == first or edges[k] < high - _SAME * step_s):
                begin, end = (low if k == first else max(low, edges[k])), min(high, edges[k + 1])
                if self.servo_time_s > 0:
                    share = math.exp(-(high - end) / self.servo_time_s) - math.exp(-(high - begin) / self.servo_time_s)
                else:
                    share = (end - begin) / step_s
                entries.append((row, k, share))
                k += 1
        lines, columns, shares = zip(*entries, strict=True)
        gain = sparse.csc_matrix((shares, (lines, columns)), shape=(rows, len(at)))
        memory = sparse.diags([np.ones(rows), np.full(rows - 1, -keep)], [0, -1], format="csc")
        start = np.zeros(rows)
        start[0] = aimed[0]
        bend = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(max(len(at) - 2, 0), len(at)), format="csc")
        smooth = _SMOOTH * (bend.T @ bend + sparse.identity(len(at), format="csc") * _SMOOTH)
        system = sparse.bmat(
            [
                [sparse.identity(rows), None, memory.T],
                [None, smooth, -gain.T],
                [memory, -gain, None],
            ],
            format="csc",
        )
        middle = np.zeros(len(at))
        found = spsolve(system, np.concatenate([aimed, middle, start]))
        samples = found[rows : rows + len(at)]
        # Before the delay is over, and after the last row, a sample has no effect: it stays.
        seen = np.asarray(abs(gain).sum(axis=0)).ravel() > _SAME
        samples = np.interp(at, at[seen], samples[seen]) if seen.any() else np.full(len(at), aimed[0])
        line: Array = np.interp(time, at, samples)
        return line


_SMOOTH = 1e-7  # weight of the samples' curvature beside that of the error


def rounded(values: Array, resolution: float) -> Array:
    """Values in steps of the resolution, where there is one."""
    return values if resolution == 0 else np.round(values / resolution) * resolution


def played(motor: Array, play: float) -> Array:
    """Places of what follows a motor through a play, from the middle of it on (play operator), shape (n,)."""
    if play == 0:
        return motor
    found = np.empty_like(motor)
    now = found[0] = motor[0]
    for row, place in enumerate(motor.tolist()):
        now = found[row] = min(max(now, place - play / 2), place + play / 2)
    return found


def crossed(wanted: Array, play: float, turning: float) -> Array:
    """Places of a motor that has crossed the play wherever what follows it turns back, shape (n,)."""
    if play == 0:
        return wanted
    motor = np.empty_like(wanted)
    furthest, side = float(wanted[0]), 0.0
    for row, place in enumerate(wanted.tolist()):
        turned, ahead = abs(place - furthest) > turning, (place - furthest) * side > 0
        if turned and not ahead:
            side = math.copysign(1.0, place - furthest)
        furthest = place if ahead or turned else furthest
        motor[row] = place + side * play / 2
    return motor


def _advanced(values: Array, early_s: float, step_s: float) -> Array:
    if early_s == 0:
        return values
    time = np.arange(len(values)) * step_s
    found: Array = np.interp(time + early_s, time, values)
    return found


def _merged(time: Array, more: Array, step_s: float) -> Array:
    """Times in order, without those that are the same but for rounding."""
    every = np.sort(np.concatenate([time, more]))
    grid = np.round(every / step_s) * step_s
    every = np.where(np.abs(every - grid) < _SAME * step_s, grid, every)
    return np.unique(every)


def _lagged(spans: Array, left: Array, right: Array, servo_time_s: float, start: float) -> Array:
    """Places at the ends of spans in which the command goes straight from `left` to `right`, first order."""
    keep = np.exp(-spans / servo_time_s)
    behind = servo_time_s * (right - left) / spans
    now, found = start, [start]
    for k, a, b, s in zip(keep.tolist(), left.tolist(), right.tolist(), behind.tolist(), strict=True):
        now = b - s + (now - a + s) * k
        found.append(now)
    return np.array(found)


def _rate(values: Array, step_s: float) -> Array:
    """Rates by central differences, shape (n,) [1/s]."""
    rate: Array = np.gradient(values, step_s) if len(values) > 1 else np.zeros(len(values))
    return rate


def _rate_so_far(values: Array, step_s: float) -> Array:
    """Rates at the ends of steps that start at rest, of second order, shape (n,) [1/s]."""
    change = np.diff(values, prepend=values[:1])
    before = np.roll(change, 1)
    before[0] = 0.0
    rate: Array = (1.5 * change - 0.5 * before) / step_s
    return rate
