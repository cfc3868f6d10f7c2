"""State of a mechanism at rest, with which a run begins."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from tendonff.models.layout import Array
from tendonff.models.mechanism.mechanism import CutMechanism


def rest_state(
    mechanism: CutMechanism,
    tension_N: Mapping[str, float],
    places: Mapping[str, float],
    slack_m: Mapping[str, float] | None = None,
) -> Array | ca.SX:
    """At rest under a tension that is uniform along each tendon, in the order of `MechanismEquations.state`.

    Whether bodies stay at rest is the caller's affair: their loads must carry the tensions.

    Parameters
    ----------
    tension_N : mapping of str to float
        Of each tendon by name [N], >= 0.
    places : mapping of str to float
        Coordinate of every body by name [m or rad].
    slack_m : mapping of str to float, optional
        Length that hangs loose in a tendon without tension [m].

    Returns
    -------
    ndarray, shape (states,)
        Or a column of CasADi's where numbers of the mechanism are symbols.
    """
    parts: list[Array] = [np.array([places[body.name], *np.zeros(1 + len(body.states))]) for body in mechanism.free]
    for tendon in mechanism.tendons:
        elements, n = tendon.elements, tendon.count
        joints = {joint: np.array([places[joint]]) for s in elements.path.sections for joint in s.joints}
        ratio = elements.path.at(joints).ratio[0]
        stretch, states = elements.link.shortened(ratio).rest(tension_N[tendon.name])
        loose = (slack_m or {}).get(tendon.name, 0.0) / (n + 1)
        links = [each - loose for each in (stretch, *states)]
        parts += [np.zeros(n), *links, np.zeros(n * len(elements.friction.states))]
    symbolic = any(isinstance(part, ca.SX) for part in parts)
    return ca.vertcat(*parts) if symbolic else np.concatenate(parts)
