"""Static Coulomb law of a tendon over several bodies: the tension with which each section acts on the body it follows.

From the far end on, one-way sliding multiplies the tension by e^{mu phi} towards the near end where the tendon slides
that way (pulling), by e^{-mu phi} where it slides back, eq. (4). So a section acts on its joint with its local tension.
"""

import math
from collections.abc import Mapping

from tendonff.models.mechanism.parts import Tendon


def capstan_exponent(tendon: Tendon, places: Mapping[str, float]) -> float:
    """Logarithm of the drum's tension over that at the far end, while the tendon is pulled [-].

    Parameters
    ----------
    tendon : Tendon
    places : mapping of str to float
        Of the bodies that its sections follow; at zero where one is missing.
    """
    friction, found = tendon.friction, 0.0
    for section in tendon.path.parts:
        pull, _ = section.dynamic_coefficients(friction.mu_dynamic, friction.release_dynamic)
        found += pull * float(section.angle_at(places))
    return found


def local_arms_m(tendon: Tendon, places: Mapping[str, float], speeds: Mapping[str, float]) -> dict[str, float]:
    """Torque on each body for a tension of 1 N at the far end, while the tendon slides everywhere [m].

    Parameters
    ----------
    tendon : Tendon
    places, speeds : mapping of str to float
        Of the bodies that its sections and its far end follow; at zero where one is missing.
    """
    friction, tension = tendon.friction, 1.0
    arms: dict[str, float] = {}
    sliding = 0.0
    for arm in tendon.far.arms:
        slope = arm.slope_m(places.get(arm.body, 0.0))
        arms[arm.body] = slope
        sliding += slope * speeds.get(arm.body, 0.0)
    for section in reversed(tendon.path.parts):
        slopes = {name: float(slope) for name, slope in section.gained_slopes_at(places).items()}
        gained = math.fsum(slope * speeds.get(name, 0.0) for name, slope in slopes.items())
        pull, release = section.dynamic_coefficients(friction.mu_dynamic, friction.release_dynamic)
        exponent = (pull if sliding - gained / 2 > 0 else -release) * float(section.angle_at(places))
        for name, slope in slopes.items():
            arms[name] = arms.get(name, 0.0) - slope * tension * math.exp(exponent / 2)
        tension *= math.exp(exponent)
        sliding -= gained
    return arms
