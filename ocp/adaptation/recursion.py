"""Step of the recursion: recursive Gauss-Newton with forgetting, a gate and bounds.

The measured quantity is predicted by a model that is driven by the applied force; `s` is its derivative with respect
to the tuned factors. A sample counts by the share `weight` of full speed at which the prediction moves: friction does
not depend on rate, so a sample at rest repeats what is known, and nothing moves there, the covariance included.

`level` is the mean square of what stays unexplained, relative to that of a good model. A wrong model's errors repeat
with the reference, so they are averaged over a longer past (forgetting goes down with the level), and an estimate
counts only as far as it stands out from what they alone could make of it. Where a wrong parameter looks like a tuned
one for part of a cycle, nothing stays unexplained; but the estimate goes and comes back, which the true value does not.
From the position, friction that falls with the tension looks like less friction while the tension is high: a factor
counts as far as it is the same with a load exponent and without, and stands out from what is not known of that one.
An exponent that stands out itself takes the factor back towards the scenario's value where the present tension asks so.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from tendonff.ocp.codegen.printer import Law

CLIP = 3.0
"""Innovations count up to so many standard deviations."""

KNOWN = 1.0
"""Variances of the prediction within which an error is explained by what the factors may be."""

LEAST, MOST = 0.03, 1e4
"""Bounds of what is unexplained, as a square of errors of a good model."""

TRUST = 6.0
"""Squared standard deviations by which an estimate must stand out before it counts."""

RECALL = 0.1
"""Share of the rate of slow means at which it is forgotten how far an estimate came back, and how much was lacking."""

FARTHEST = 0.08
"""Largest way back that is held against an estimate."""

WANDERS = 90.0
"""Random walk of a nuisance parameter in squares of its spread, over that of a factor: nine seconds at level 1."""

CURVED = 5.0
"""Relative growth of the covariance for a factor that moves by 1: the slopes of the way there were others."""


SMALLEST = 1e-12
"""Least variance of a factor that is divided by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Knowledge of one factor beside that of all."""

    width: float = 1.0  # standard deviation at the start, and step of the random walk, over those of the others
    # least, most: bounds of physics, within those of all
    least: float = -math.inf
    most: float = math.inf


def _indexed(name: str, count: int) -> list[ca.SX]:
    return [ca.SX.sym(f"{name}{k}") for k in range(count)]


def covariance_names(count: int) -> tuple[str, ...]:
    """Names of the entries on and below the diagonal of the covariance of so many factors, row by row."""
    return tuple(f"P{i}{j}" for i in range(count) for j in range(i + 1))


def _covariance(count: int) -> tuple[dict[str, ca.SX], list[list[ca.SX]]]:
    entries = {name: ca.SX.sym(name) for name in covariance_names(count)}
    return entries, [[entries[f"P{max(i, j)}{min(i, j)}"] for j in range(count)] for i in range(count)]


def trust_law(count: int) -> Law:
    """Share of the deviation of one or two estimates that counts, and evidence for it.

    `share` is 1 - (TRUST/D^2)^3, not below 0, where D is the distance in standard deviations, with the covariance at
    the present level plus what `return_law` keeps: a single factor that came back by more than it stands out does not
    count. Times 1 - (level/lost)^2, not below 0. `evidence` is D^2/TRUST, not above 1.
    """
    d, back, (entries, P) = _indexed("d", count), _indexed("back", count), _covariance(count)
    level, lost = ca.SX.sym("level"), ca.SX.sym("lost")
    C = [[TRUST * level * P[i][j] + (back[i] if i == j else 0) for j in range(count)] for i in range(count)]
    if count == 1:
        have, need = d[0] * d[0], C[0][0]
    else:
        have = d[0] * d[0] * C[1][1] + d[1] * d[1] * C[0][0] - 2 * d[0] * d[1] * C[1][0]
        need = C[0][0] * C[1][1] - C[1][0] * C[1][0]
    most = ca.fmax(have, need)
    doubt, wrong, evidence = need / most, level / lost, have / most
    share = (1 - doubt * doubt * doubt) * ca.fmax(1 - wrong * wrong, 0)
    return Law(
        name="tuning_trust",
        comment="Share of a deviation that counts, and evidence for it: 1 where it stands out.",
        inputs=(*d, *entries.values(), *back, level, lost),
        outputs={"share": share, "evidence": evidence},
    )


def return_law() -> Law:
    """Excursion of an estimate from its safe value and back.

    `far_new` is the place farthest out, which follows the estimate at `rate` times RECALL; `back_new` the largest
    square of the way back from there, forgotten as fast.
    """
    f, safe, far, back, rate = (ca.SX.sym(name) for name in ("f", "safe", "far", "back", "rate"))
    near, out, slow = f - safe, far - safe, RECALL * rate
    place = ca.if_else(near * near > out * out, f, far + slow * (f - far))
    way = place - f
    return Law(
        name="tuning_return",
        comment="How far an estimate went out and came back, squared; the true value does not come back.",
        inputs=(f, safe, far, back, rate),
        outputs={"far_new": place, "back_new": ca.fmax(ca.fmin(way * way, FARTHEST**2), back - slow * back)},
    )


def _kept_inside(moves: list[ca.SX], f: list[ca.SX], P: list[list[ca.SX]], priors: Sequence[Prior]) -> list[ca.SX]:
    """The moves of everything where a factor stops at a bound of its own: those most likely given that it does."""
    for k, prior in enumerate(priors):
        if prior.least > -math.inf or prior.most < math.inf:
            back = ca.fmax(ca.fmin(f[k] + moves[k], prior.most), prior.least) - (f[k] + moves[k])
            share = back / ca.fmax(P[k][k], SMALLEST)
            moves = [move + (back if i == k else P[i][k] * share) for i, move in enumerate(moves)]
    return moves


def update_law(
    count: int, spreads: tuple[float, ...] = (), priors: Sequence[Prior] = (), exponent: Prior | None = None
) -> Law:
    """Factors, nuisance parameters and covariance after one measurement.

    `mean_new` is the mean of `e` over a short time, in units of `deviation`, `lasting_new` that over a longer one at
    any speed; `surprise` and `remains` are the parts of their squares that the covariance does not explain.

    Parameters
    ----------
    count : int
        Factors.
    spreads : tuple of float, optional
        Standard deviation at the start of each nuisance parameter; they come behind the factors in slopes and
        covariance. What stays unexplained opens them and closes the factors.
    priors : sequence of Prior, optional
        Of each factor.
    exponent : Prior, optional
        Of a load exponent `n` that the model lacks, estimated from the same errors by the second stage of Friedland's
        separate-bias filter: `s_n` is the slope of the prediction over it, `Pn` its variance, `shift` the change of
        every other estimate with it. These are what they are without an exponent; with it they are less by n shift.
    """
    total, priors = count + len(spreads), priors or (Prior(),) * count
    e, w, mean, quick, level = (ca.SX.sym(name) for name in ("e", "weight", "mean", "quick", "level"))
    lasting, long = ca.SX.sym("lasting"), ca.SX.sym("long_share")
    R, deviation, drift, start, slew, low, high = (
        ca.SX.sym(name) for name in ("R", "deviation", "drift", "start", "slew", "low", "high")
    )
    s, (entries, P) = _indexed("s", total), _covariance(total)
    f, b = _indexed("f", count), _indexed("b", len(spreads))

    Ps = [sum((P[i][j] * s[j] for j in range(total)), start=ca.SX(0)) for i in range(total)]
    spread = sum((s[i] * Ps[i] for i in range(total)), start=ca.SX(0))
    variance = deviation * deviation
    limit = CLIP * ca.sqrt(spread + level * variance)
    clipped = ca.fmax(ca.fmin(e, limit), -limit)
    share = w / (w * spread + R)
    gain = [share * p for p in Ps]
    fastest = functools.reduce(ca.fmax, [ca.fabs(gain[i] * clipped) for i in range(count)])
    slower = slew / ca.fmax(fastest, slew)  # no factor moves faster than the inverse may follow
    gain = [slower * g for g in gain]
    moves = _kept_inside([g * clipped for g in gain], f, P, priors)
    found_f = [ca.fmax(ca.fmin(f[i] + moves[i], high), low) for i in range(count)]
    found_b = [ca.fmax(ca.fmin(b[k] + moves[count + k], 1), -1) for k in range(len(spreads))]

    grown = 1 + CURVED * ca.fabs(clipped) * sum((ca.fabs(g) for g in gain[:count]), start=ca.SX(0))
    walks = [drift * p.width**2 / level for p in priors] + [drift * level * WANDERS * x * x for x in spreads]
    most = [start * start * p.width**2 for p in priors] + [ca.SX(x * x) for x in spreads]
    after = [
        [grown * (P[i][j] - gain[i] * Ps[j]) + (w * walks[i] if i == j else 0) for j in range(total)]
        for i in range(total)
    ]
    # Where forgetting would carry a variance beyond that of the start, row and column are scaled back.
    scale = [ca.sqrt(most[i] / ca.fmax(after[i][i], most[i])) for i in range(total)]
    outputs = {f"f{i}_new": found_f[i] for i in range(count)} | {f"b{k}_new": x for k, x in enumerate(found_b)}
    outputs |= {f"P{i}{j}_new": after[i][j] * scale[i] * scale[j] for i in range(total) for j in range(i + 1)}
    explained = KNOWN * spread / variance
    found = mean + (e / deviation - mean) * w * quick
    lasts = lasting + (e / deviation - lasting) * long
    outputs |= {
        "mean_new": found,
        "surprise": ca.fmin(ca.fmax(found * found - explained, LEAST), MOST),
        "lasting_new": lasts,
        "remains": ca.fmin(ca.fmax(lasts * lasts - explained, LEAST), MOST),
    }
    beside: tuple[ca.SX, ...] = ()
    if exponent is not None:
        n, Pn, s_n, shift = ca.SX.sym("n"), ca.SX.sym("Pn"), ca.SX.sym("s_n"), _indexed("shift", total)
        slope = s_n - sum((s[i] * shift[i] for i in range(total)), start=ca.SX(0))
        gain_n = w * Pn * slope / (w * slope * slope * Pn + w * spread + R)
        widest = (exponent.width * start) ** 2
        outputs |= {
            "n_new": ca.fmax(ca.fmin(n + gain_n * (clipped - slope * n), exponent.most), exponent.least),
            "Pn_new": ca.fmin((1 - gain_n * slope) * Pn + w * drift * exponent.width**2 / level, widest),
        }
        outputs |= {f"shift{i}_new": shift[i] + gain[i] * slope for i in range(total)}
        beside = (s_n, n, Pn, *shift)
    numbers = (mean, quick, lasting, long, level, R, deviation, drift, start, slew, low, high)
    return Law(
        name="tuning_update",
        comment="Recursive Gauss-Newton step with forgetting; the weight is the gate.",
        inputs=(e, w, *s, *f, *b, *entries.values(), *numbers, *beside),
        outputs=outputs,
    )
