"""One step of the recursion: recursive Gauss-Newton with forgetting, a gate and bounds.

The measured quantity is predicted by a model that is driven by the applied force; `s` is its derivative with respect
to the tuned factors. A sample counts by the share `weight` of full speed at which the prediction moves: friction does
not depend on rate, so a sample at rest repeats what is known, and nothing moves there, the covariance included.
"""

import casadi as ca

from tendonff.ocp.codegen.law import Law

CLIP = 3.0
"""Innovations count up to so many standard deviations."""


def _indexed(name: str, count: int) -> list[ca.SX]:
    return [ca.SX.sym(f"{name}{k}") for k in range(count)]


def covariance_names(count: int) -> tuple[str, ...]:
    """Names of the entries on and below the diagonal, row by row.

    Parameters
    ----------
    count : int
        Tuned factors.
    """
    return tuple(f"P{i}{j}" for i in range(count) for j in range(i + 1))


def update_law(count: int) -> Law:
    """Factors and covariance after one measurement.

    Parameters
    ----------
    count : int
        Tuned factors.

    Returns
    -------
    Law
        `spread` is the variance of the prediction that the factors' covariance explains.
    """
    e, w, R, deviation, drift, start, low, high = (
        ca.SX.sym(name) for name in ("e", "weight", "R", "deviation", "drift", "start", "low", "high")
    )
    s, f = _indexed("s", count), _indexed("f", count)
    entries = {name: ca.SX.sym(name) for name in covariance_names(count)}
    P = [[entries[f"P{max(i, j)}{min(i, j)}"] for j in range(count)] for i in range(count)]

    Ps = [sum((P[i][j] * s[j] for j in range(count)), start=ca.SX(0)) for i in range(count)]
    spread = sum((s[i] * Ps[i] for i in range(count)), start=ca.SX(0))
    limit = CLIP * ca.sqrt(spread + deviation * deviation)
    clipped = ca.fmax(ca.fmin(e, limit), -limit)
    share = w / (w * spread + R)
    gain = [share * p for p in Ps]
    new = [ca.fmax(ca.fmin(f[i] + gain[i] * clipped, high), low) for i in range(count)]

    after = [[P[i][j] - gain[i] * Ps[j] + (w * drift if i == j else 0) for j in range(count)] for i in range(count)]
    most = start * start
    # Where forgetting would carry a variance beyond that of the start, row and column are scaled back.
    scale = [ca.sqrt(most / ca.fmax(after[i][i], most)) for i in range(count)]
    outputs = {f"f{i}_new": new[i] for i in range(count)}
    outputs |= {f"P{i}{j}_new": after[i][j] * scale[i] * scale[j] for i in range(count) for j in range(i + 1)}
    return Law(
        name="tuning_update",
        comment="Recursive Gauss-Newton step with forgetting; the weight is the gate.",
        inputs=(e, w, *s, *f, *entries.values(), R, deviation, drift, start, low, high),
        outputs=outputs | {"spread": spread},
    )
