"""Lag and delay of a drive, from what it was commanded and what it did.

The drive's answer y to a command u is that of `models.servo`, y = gain follow(u; lag, delay) + offset, for forces,
positions and angles alike. A log of the drive alone is enough; a chirp tells both times best.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.servo import Servo
from tendonff.ocp.fits.least_squares import Residuals, Solution, Unknown, solve
from tendonff.ocp.step.protocol import Array

LAG, DELAY, GAIN, OFFSET = "servo_time_s", "delay_s", "gain", "offset"

_BLOCK_S = 0.25
_LEAST_ROWS = 100
_MOST_S = 0.5
_STARTS = ((0.3, 0.1), (0.1, 0.3), (0.6, 0.6))  # lag and delay, over the time by which the answer is late at first


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoFit:
    """Lag and delay of a drive.

    Attributes
    ----------
    servo_time_s, delay_s : float
    servo_time_interval_s, delay_interval_s : tuple of float
        95 % intervals.
    gain, offset : float
        Of the answer over the command [-], and in its unit: 1 and 0 where both channels are read alike.
    residual : float
        RMS of what is left, over the standard deviation of the answer [-].
    """

    servo_time_s: float
    delay_s: float
    servo_time_interval_s: tuple[float, float]
    delay_interval_s: tuple[float, float]
    gain: float
    offset: float
    residual: float


def fit_servo(command: Array, answer: Array, step_s: float, *, command_interval_s: float | None = None) -> ServoFit:
    """Fit lag and delay to a command and the drive's answer, both shape (n,), sampled evenly.

    ParameterError where the channels cannot tell them.
    """
    given, seen = np.asarray(command, dtype=np.float64), np.asarray(answer, dtype=np.float64)
    if given.shape != seen.shape or given.ndim != 1 or len(given) < _LEAST_ROWS:
        raise ParameterError(
            f"command and answer must be vectors of one length >= {_LEAST_ROWS}, got {given.shape} and {seen.shape}"
        )
    swing, scale = float(np.std(seen)), float(np.std(given))
    if not (swing > 0 and scale > 0):
        raise ParameterError("command or answer does not change; log a chirp: --suggest writes one")
    blocks = (np.arange(len(given)) * step_s // _BLOCK_S).astype(int)

    def response(values: Mapping[str, float]) -> Array:
        servo = Servo(servo_time_s=values[LAG], delay_s=values[DELAY], command_interval_s=command_interval_s)
        return servo.follow(given, step_s)

    def evaluate(values: Mapping[str, float]) -> Residuals:
        followed, slopes = response(values), []
        for name in (LAG, DELAY):
            by = 1e-3 * max(values[name], step_s)
            low = max(values[name] - by, 0.0)
            both = response({**values, name: values[name] + by}) - response({**values, name: low})
            slopes.append(values[GAIN] * both / (values[name] + by - low))
        rows = values[GAIN] * followed + values[OFFSET] - seen
        columns = np.column_stack([*slopes, followed, np.ones(len(seen))])
        return Residuals(values=rows / swing, slopes=columns / swing, blocks=blocks)

    late = _late_s(given, seen, step_s)
    gain = swing / scale
    offset = float(seen.mean() - gain * given.mean())
    found = min((_solved(evaluate, late, share, gain, offset, swing, step_s) for share in _STARTS), key=_left)
    if not math.isfinite(found.standard_error(LAG)) or not math.isfinite(found.standard_error(DELAY)):
        raise ParameterError("the command is too slow or too short to tell lag and delay; log a chirp")
    low = {name: tuple(max(end, 0.0) for end in found.interval(name)) for name in (LAG, DELAY)}
    return ServoFit(
        servo_time_s=found.values[LAG],
        delay_s=found.values[DELAY],
        servo_time_interval_s=(low[LAG][0], low[LAG][1]),
        delay_interval_s=(low[DELAY][0], low[DELAY][1]),
        gain=found.values[GAIN],
        offset=found.values[OFFSET],
        residual=math.sqrt(float(np.mean(found.residuals.values**2))),
    )


def _left(found: Solution) -> float:
    return float(np.sum(found.residuals.values**2))


def _solved(
    evaluate: Callable[[Mapping[str, float]], Residuals],
    late: float,
    share: tuple[float, float],
    gain: float,
    offset: float,
    swing: float,
    step_s: float,
) -> Solution:
    first, second = (max(part * late, 0.2 * step_s) for part in share)
    unknowns = (
        Unknown(name=LAG, start=first, low=0.0, high=_MOST_S, scale=max(first, step_s)),
        Unknown(name=DELAY, start=second, low=0.0, high=_MOST_S, scale=max(second, step_s)),
        Unknown(name=GAIN, start=gain, low=0.1 * gain, high=10 * gain, scale=0.1 * gain),
        Unknown(name=OFFSET, start=offset, low=-1e9, high=1e9, scale=0.1 * swing),
    )
    return solve(evaluate, unknowns)


def _late_s(command: Array, answer: Array, step_s: float) -> float:
    """Shift at which the answer is most alike to the command [s]."""
    a, b = command - command.mean(), answer - answer.mean()
    rows = min(round(_MOST_S / step_s), len(a) // 2)
    alike = [float(a[: len(a) - k] @ b[k:]) for k in range(rows)]
    return max(int(np.argmax(alike)), 1) * step_s


def servo_chirp(size: float, step_s: float, *, middle: float = 0.0, seconds: float = 8.0) -> tuple[Array, Array]:
    """Excitation of a drive alone: times [s] and commands, a faded sine from 0.5 to 15 Hz around `middle`."""
    time = np.arange(0.0, seconds + step_s / 2, step_s)
    low, high = 0.5, 15.0
    rate = math.log(high / low) / seconds
    phase = 2 * math.pi * low * np.expm1(rate * time) / rate
    fade = np.clip(np.minimum(time, seconds - time) / 0.5, 0.0, 1.0)
    return time, middle + size * fade * fade * (3 - 2 * fade) * np.sin(phase)
