"""Data of a self test that are worked out apart from the C: the limiter's answers, and checksums."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.export.tension.following import Status
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal

_FNV_START, _FNV_PRIME, _MASK = 2166136261, 16777619, 0xFFFFFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCase:
    """Call of the limiter."""

    # before_N, wanted_N: last output, and the force that is asked for [N]
    before_N: float
    wanted_N: float
    force_N: float  # what must come out [N]
    status: Status


def limit_cases(low_N: float, high_N: float, change_N: float, precision: Precision) -> list[LimitCase]:
    """Calls of the limiter that reach each of its branches, with the right answers.

    The range is that of the force, the change the largest per sample. The last output is set by hand, so that the rate
    binds also where no course of forces could make it.
    """
    real = np.float32 if precision is Precision.FLOAT else np.float64
    given = (float(np.clip(v, -1e30, 1e30)) for v in (low_N, high_N, change_N))
    low, high, change = (real(float(literal(v, precision).rstrip("f"))) for v in given)  # as the header is read
    span = high - low
    middle = low + real(0.5) * span
    small = real(0.25) * min(change, span)
    far = [low - real(8) * change, high + real(8) * change]
    wanted = [middle, middle + small, middle - small, low, high, low - small, high + small, real(1e29), real(-1e29)]
    wanted += [real(v) for v in (np.nan, np.inf, -np.inf, 3e30, -3e30)]
    cases = []
    for before in (middle, low, high, *far):
        if not abs(before) < real(1e29):
            continue
        for want in wanted:
            force, status = _limited(before, want, low, high, change)
            if abs(force - before) < change * real(0.999) or status & (Status.RATE_LIMITED | Status.FAILED):
                cases.append(
                    LimitCase(before_N=float(before), wanted_N=float(want), force_N=float(force), status=status)
                )
    return cases


def _limited(
    before: np.floating, wanted: np.floating, low: np.floating, high: np.floating, change: np.floating
) -> tuple[np.floating, Status]:
    """The rules of the limiter, stated apart from the template that prints them."""
    if not abs(wanted) <= 1e30:
        force, status = before, Status.FAILED
    else:
        force = min(max(wanted, low), high)
        status = Status.OK if force == wanted else Status.FORCE_LIMITED
    within = min(max(force, before - change), before + change)
    return within, status if within == force else status | Status.RATE_LIMITED


def checksum(values: Iterable[float], precision: Precision) -> int:
    """FNV-1a over the bytes of numbers as C reads their literals, least significant byte first."""
    kind = "<f4" if precision is Precision.FLOAT else "<f8"
    read = [float(literal(float(value), precision).rstrip("f")) for value in values]
    return _fnv(np.asarray(read, dtype=kind).tobytes())


def _fnv(data: bytes) -> int:
    value = _FNV_START
    for byte in data:
        value = ((value ^ byte) * _FNV_PRIME) & _MASK
    return value
