"""A sequential test for drift: a cumulative sum of log-likelihood ratios for each change that is looked for (CUSUM).

Every window gives friction, pre-tension and gear friction with errors that belong together: free strokes determine the
product of friction and pre-tension well, and each alone poorly; a push against a stop determines both. So each
hypothesis, a change d of the logarithms, is judged with the whole covariance C: the sum grows by d' C^-1 (z - d/2), is
never below zero, and raises the alarm at `LEVEL`. What one window adds is limited, so one that is wrong raises none.
The error of the base is shared by all windows, so no sum averages it out: where few windows are the base, half of the
change, which a window must exceed to add anything, gives way to so many standard errors of the base.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.studies.watch.windows import WATCHED, WINDOW_S, Window

N = Parameter
BASE_S = 300.0
"""Time of use, of the first file at most, whose values all later ones are compared with."""

LEVEL, MOST_EACH = 15.0, 5.0
"""Sum that raises an alarm, e^15 to one, and the most that a window adds: three at least."""

FLOOR = np.array([0.03, 0.03, 0.08])
"""Standard errors of a window that no scatter within the base shows: temperature, posture."""

BASE_ERRORS = 2.5
"""Standard errors of the base that a window must be away from it, at least, to count for a change."""

SURE, DRAWS, LONGEST_S = 0.95, 400, 8 * 3600.0
"""A change is shown where so large a share of drawn courses with it raises the alarm; of how many; use at most."""

_LEAST_BASE = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """A change that is looked for.

    Parameters
    ----------
    number : Parameter
    change : float
        Relative change, signed.
    label : str
        Name in messages.
    cause : str
        Usual cause, and what to do.
    """

    number: Parameter
    change: float
    label: str
    cause: str

    @property
    def direction(self) -> Array:
        """Change of the logarithms of what is watched, shape (3,)."""
        return np.array([math.log1p(self.change) if n is self.number else 0.0 for n in WATCHED])


DRIFTS = (
    Drift(number=N.MU, change=0.3, label="friction of the tendons", cause="wear, dirt or lost lubricant"),
    Drift(number=N.TENSION, change=-0.2, label="pre-tension", cause="creep or a slipping knot; tension the loop again"),
    Drift(number=N.COULOMB, change=0.5, label="friction of the gear", cause="wear or dirt in the gear"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """A change that was found.

    Attributes
    ----------
    drift : Drift
    used_s : float
        Time of use at which it is sure [s].
    since_s : float
        Time of use since which the sum has grown [s].
    change : float
        Relative change over the windows since then.
    name : str
        Of the file.
    """

    drift: Drift
    used_s: float
    since_s: float
    change: float
    name: str

    @property
    def sentence(self) -> str:
        """The alarm for the user."""
        way = "up" if self.change > 0 else "down"
        return (
            f"{self.drift.label} {way} by {100 * abs(self.change):.0f} %, since {clock(self.since_s)} of use, sure "
            f"after {clock(self.used_s)} ({self.name}): {self.drift.cause}"
        )


def clock(seconds: float) -> str:
    """A time of use."""
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """A watched number over the use.

    Attributes
    ----------
    drift : Drift
    base : float
        Its value at first.
    used_s, ratio, low, high : ndarray, shape (windows,)
        Time of use, value over the base, and the 95 % band of that, in figure and file alike.
    total : ndarray, shape (windows,)
        Sum of the test over the one that raises the alarm [-].
    alarm : Alarm or None
        The first.
    judged_s : float
        Use after the first minutes, that the test has judged [s].
    sure_s : float
        Use after the first minutes within which a change of the size that is looked for would almost surely raise the
        alarm, windows being as certain as these [s]; infinite where none of `LONGEST_S` would.
    """

    drift: Drift
    base: float
    used_s: Array
    ratio: Array
    low: Array
    high: Array
    total: Array
    alarm: Alarm | None
    judged_s: float
    sure_s: float

    @property
    def shown(self) -> bool:
        """Whether these windows would show a change of the size that is looked for."""
        return self.alarm is not None or self.sure_s <= self.judged_s


def courses_of(windows: Sequence[Window], drifts: Sequence[Drift] = DRIFTS) -> tuple[Course, ...]:
    """Course of each number, empty where no window tells anything."""
    fitted = [w for w in windows if w.values]
    if not fitted:
        return ()
    used = np.array([w.used_s for w in fitted])
    logs = np.array([[math.log(w.values[n]) for n in WATCHED] for w in fitted])
    first = (used <= max(BASE_S, used[0])) & np.array([w.name == fitted[0].name for w in fitted])
    base = np.median(logs[first], axis=0)
    moved = logs - base
    scatter = np.diag(FLOOR**2)
    if first.sum() >= _LEAST_BASE:
        scatter = scatter + np.cov(moved[first].T)
    covariance = [w.covariance + scatter for w in fitted]
    return tuple(_course(drift, fitted, used, moved, covariance, base, int(first.sum())) for drift in drifts)


def _course(
    drift: Drift,
    windows: Sequence[Window],
    used: Array,
    moved: Array,
    covariance: Sequence[Array],
    base: Array,
    first: int,
) -> Course:
    aim, column = drift.direction, WATCHED.index(drift.number)
    weight = np.array([np.linalg.solve(c, aim) for c in covariance])
    shared = np.mean(covariance[:first], axis=0) * math.pi / 2 / first  # of a median
    least = np.maximum(weight @ aim / 2, BASE_ERRORS * np.sqrt(np.einsum("ki,ij,kj->k", weight, shared, weight)))
    gain = (moved * weight).sum(axis=1) - least
    total = np.concatenate([np.zeros(first), _sums(gain[first:])])
    begun = list(range(len(used)))
    for k in range(first, len(used)):
        begun[k] = begun[k - 1] if total[k - 1] > 0 else k
    over = np.flatnonzero(total >= LEVEL)
    alarm = None
    if over.size:
        k = int(over[0])
        rows = slice(begun[k], k + 1)
        alarm = Alarm(
            drift=drift,
            used_s=float(used[k]),
            since_s=float(used[max(begun[k] - 1, 0)]),
            change=math.expm1(float(np.median(moved[rows, column]))),
            name=windows[k].name,
        )
    reach = 1.96 * np.sqrt([c[column, column] + shared[column, column] for c in covariance])  # that of the base too
    own = moved[:, column]
    return Course(
        drift=drift,
        base=math.exp(float(base[column])),
        used_s=used,
        ratio=np.exp(own),
        low=np.exp(own - reach),
        high=np.exp(own + reach),
        total=total / LEVEL,
        alarm=alarm,
        judged_s=float(used[-1] - used[first - 1]),
        sure_s=_sure_windows(aim, weight, least, shared, first) * float(used[-1]) / len(used),
    )


def _sums(gain: Array) -> Array:
    """Sums of the test after each window, shape (windows, ...), from those of the logarithms of its likelihoods."""
    total = np.zeros_like(gain)
    before = np.zeros(gain.shape[1:])
    for k, each in enumerate(np.minimum(gain, MOST_EACH)):
        before = total[k] = np.maximum(before + each, 0.0)
    return total


def _sure_windows(aim: Array, weight: Array, least: Array, shared: Array, first: int) -> float:
    """Windows after those of the base by which a change would almost surely raise the alarm; infinite if none do.

    Drawn: the change, with the errors of windows like these, and with that of the base, which all share.
    """
    draw = np.random.default_rng(0)
    base = draw.multivariate_normal(np.zeros(len(aim)), shared, DRAWS)
    like = np.arange(first, len(weight)) if first < len(weight) else np.arange(len(weight))
    many = like[np.arange(round(LONGEST_S / WINDOW_S)) % len(like)]
    mean = (weight[many] @ aim)[:, None]
    scattered = mean + np.sqrt(mean) * draw.standard_normal((len(many), DRAWS)) - weight[many] @ base.T
    gain = scattered - least[many, None]
    raised = np.maximum.accumulate(_sums(gain) >= LEVEL, axis=0).mean(axis=1) >= SURE
    return float(np.argmax(raised) + 1) if raised.any() else math.inf
