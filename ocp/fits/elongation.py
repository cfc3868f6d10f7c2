"""Elongation of a visco-elastic tendon under a measured tension, with exact sensitivities.

Eq. (7) inverted: the whole tendon under a mean tension F elongates by::

    x = F/(k1 + k2) + (1/k1 - 1/(k1 + k2)) z,     dz/dt = (F - z)/tau_c,     tau_c = tau (k1 + k2)/k1

so that a held force creeps with tau_c while a held length relaxes with tau. The links are linear and equal, hence only
the mean of the tension over the path counts, whatever the friction does to its profile.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.signal import lfilter

from tendonff.ocp.step.protocol import Array

TENDON_PARAMETERS = ("stiffness_N_per_m", "relaxing_stiffness_N_per_m", "relaxation_time_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Elongation:
    """Elongation and its derivatives."""

    elongation_m: Array  # shape (n,)
    slopes: Array  # shape (n, 3); over k1, k2, tau
    fading: Array  # shape (n,); share of an unknown start that is left, exp(-t/tau_c)


def _digital() -> ca.Function:
    """Coefficients of x_k = b0 F_k + b1 F_{k-1} + a x_{k-1} by the bilinear rule, and their slopes over k1, k2, tau."""
    numbers, step = ca.SX.sym("numbers", 3), ca.SX.sym("step")
    k1, k2, tau = ca.vertsplit(numbers)
    # F/E of the link is (tau (k1 + k2) s + k1)/(tau s + 1); its inverse, s = 2/step (z - 1)/(z + 1).
    s = 2 / step
    lead, creep = tau * s, tau * (k1 + k2) * s
    below = creep + k1
    b0, b1, a = (1 + lead) / below, (1 - lead) / below, (creep - k1) / below
    coefficients = ca.vertcat(b0, b1, a)
    return ca.Function("digital", [numbers, step], [coefficients, ca.jacobian(coefficients, numbers)])


_DIGITAL = _digital()


def elongation(numbers: tuple[float, float, float], tension_N: Array, step_s: float) -> Elongation:
    """Elongation under a mean tension over the path, shape (n,), that has stood at its first value for long.

    The numbers are k1 > 0 [N/m], k2 >= 0 [N/m] and tau > 0 [s] of the whole tendon.
    """
    (b0, b1, a), by = (np.asarray(m) for m in _DIGITAL(numbers, step_s))
    b0, b1, a = float(b0[0]), float(b1[0]), float(a[0])
    k1, k2, tau = numbers
    start = tension_N[0] / k1
    now, before = tension_N, np.concatenate([tension_N[:1], tension_N[:-1]])
    x = _recursion(a, b0 * now + b1 * before, start)
    x_before = np.concatenate([[start], x[:-1]])
    slopes = np.empty((len(x), 3))
    for k, first in enumerate((-start / k1, 0.0, 0.0)):
        slopes[:, k] = _recursion(a, by[0, k] * now + by[1, k] * before + by[2, k] * x_before, first)
    time_constant = tau * (k1 + k2) / k1
    return Elongation(elongation_m=x, slopes=slopes, fading=np.exp(-np.arange(len(x)) * step_s / time_constant))


def _recursion(a: float, drive: Array, first: float) -> Array:
    """Run x_k = drive_k + a x_{k-1} from x_0 = first."""
    drive[0] = first
    return np.asarray(lfilter([1.0], [1.0, -a], drive))
