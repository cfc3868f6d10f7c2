"""Friction coefficient that falls as the load rises, mu(T) = mu (T/T_0)^-n: the law of the play; that of an element
is `models.tendon.friction.at_load`.

Friction in proportion to the true area of contact gives F = a N^(1-n): n = 1/3 for an elastic contact of a fibre or
polymer, 0 for a plastic one of metals, between them in measurements (Howell and Mazur, "Amontons' law and fibre
friction", J. Textile Inst. 44, 1953; Bowden and Tabor, "The Friction and Lubrication of Solids" II, 1964). On a
capstan: Jung, Pan and Kang, "Generalized capstan problem", Tribology International 41, 2008. mu is the coefficient at
the tension T_0, and n = 0 is Coulomb's law. Pairs (mu, T_0) with the same mu T_0^n are one law.

Per wrap angle dT/ds = mu(T) T, so that T_in^n = T_out^n + n mu theta T_0^n in one-way slip, and with

    L(T) = T_0 exp(((T/T_0)^n - 1)/n),      L -> T as n -> 0

the play operator of the capstan law holds in ln L in the place of ln T. T includes a load-independent part p.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def lifted_N(tension_N: ArrayLike, exponent: float, reference_N: float) -> Any:
    """L(T) [N]: one-way slip multiplies it by e^{mu theta}; T itself where n = 0, and for T <= 0."""
    tension = np.asarray(tension_N, dtype=np.float64)
    if exponent == 0:
        return tension
    power = (np.maximum(tension, 0.0) / reference_N) ** exponent
    return reference_N * np.exp((power - 1) / exponent)


def lowered_N(lifted: ArrayLike, exponent: float, reference_N: float) -> Any:
    """T of L(T) [N], 0 where friction alone holds more: at n > 0 a finite tension ends on the path."""
    values = np.asarray(lifted, dtype=np.float64)
    if exponent == 0:
        return values
    with np.errstate(divide="ignore"):
        power = np.maximum(1 + exponent * np.log(values / reference_N), 0.0)
    tension: NDArray[np.float64] = reference_N * power ** (1 / exponent)
    return tension


def mean_tension_in_slip_N(input_N: ArrayLike, signed_exponent: float, exponent: float, reference_N: float) -> Any:
    """Mean of T over the path in one-way slip [N], whose ends differ in ln L by `signed_exponent` = +-mu theta.

    T^n is linear in the wrap angle: the mean is (1/(1 + n)) (x^(1+n) - y^(1+n))/(x^n - y^n) of the end tensions x, y.
    """
    near = np.asarray(input_N, dtype=np.float64)
    far = lowered_N(lifted_N(near, exponent, reference_N) * math.exp(-signed_exponent), exponent, reference_N)
    drop = near**exponent - far**exponent
    flat = np.abs(drop) < 1e-9 * near**exponent
    mean = (near ** (1 + exponent) - far ** (1 + exponent)) / (1 + exponent) / np.where(flat, 1.0, drop / exponent)
    return np.where(flat, (near + far) / 2, mean)
