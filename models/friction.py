"""Friction of the tendon on its path.

Positive is towards the actuator (pulling); friction opposes sliding::

    actuator                                load
        f_i <-----[ mass i ]-----> f_{i+1}          (m/N) dv_i/dt = f_i - f_{i+1} - f_f,i
                      |--> f_f,i                    drawn for v_i > 0: slides left, f_f,i > 0 points right

The laws are module functions of plain arguments (numbers or CasADi scalars), so that simulation, inverse,
linearisation, identification and exported C all use the same expressions. Equation numbers are those of Palli,
Borghesan, Melchiorri, "Friction and Visco-Elasticity Effects in Tendon-based Transmission Systems" (ICRA 2010).
"""

from dataclasses import dataclass

import casadi as ca

from tendonff.models.bounds import at_least

NORMAL_FORCE_FLOOR_N = 1e-9
"""Least normal force in the bristle law [N]: its rate sigma0 abs(v)/(mu f_n) has no limit as a tendon goes slack."""

COEFFICIENT_FLOOR = 1e-12
"""Least equivalent coefficient in the bristle law [-]: lets a frictionless path run through the same expression."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BristleParameters:
    """Parameters of one element's bristle; numbers or CasADi scalars.

    Parameters
    ----------
    bristle_stiffness_N_per_m : float or ca.SX
        sigma0/N [N/m].
    mu_dynamic_pull, mu_static_pull, mu_dynamic_release, mu_static_release : float or ca.SX
        Equivalent coefficients of the element, eqs. (8), (9) [-].
    stribeck_velocity_m_per_s : float or ca.SX
        omega [m/s].
    """

    bristle_stiffness_N_per_m: ca.SX
    mu_dynamic_pull: ca.SX
    mu_static_pull: ca.SX
    mu_dynamic_release: ca.SX
    mu_static_release: ca.SX
    stribeck_velocity_m_per_s: ca.SX


def normal_force(f_near: ca.SX, f_far: ca.SX, adhesion_N: ca.SX) -> ca.SX:
    """Normal force of an element, f_n = f_i + f_{i+1} + 2 p [N], eq. (4) with adhesion p; at least the floor.

    Parameters
    ----------
    f_near, f_far : ca.SX
        Tensions on the actuator's and the load's side [N].
    adhesion_N : ca.SX
        p [N].
    """
    return at_least(f_near + f_far + 2 * adhesion_N, NORMAL_FORCE_FLOOR_N)


def stribeck_coefficient(v: ca.SX, bristle: BristleParameters) -> ca.SX:
    """mu(v) = mu_d + (mu_c - mu_d) exp(-abs(v)/omega) [-], eq. (5b), with the coefficients of the direction of v.

    First power of abs(v) as in the paper; much of the literature squares it. Extension: pulling (v >= 0) and
    releasing (v < 0) may have different coefficients; at v = 0 the bristle law does not use mu.
    """
    pulling = v >= 0
    low = ca.if_else(pulling, bristle.mu_dynamic_pull, bristle.mu_dynamic_release)
    # Differences inside: with equal coefficients the exponential vanishes from the expression.
    excess = ca.if_else(
        pulling,
        bristle.mu_static_pull - bristle.mu_dynamic_pull,
        bristle.mu_static_release - bristle.mu_dynamic_release,
    )
    mu = low + excess * ca.exp(-ca.fabs(v) / bristle.stribeck_velocity_m_per_s)
    return at_least(mu, COEFFICIENT_FLOOR)


def bristle_rate(v: ca.SX, f_s: ca.SX, f_n: ca.SX, bristle: BristleParameters) -> ca.SX:
    """df_s/dt = sigma0 (v - f_s abs(v)/(f_n mu(v))) [N/s], eq. (5a).

    Parameters
    ----------
    v : ca.SX
        Sliding velocity [m/s], positive towards the actuator.
    f_s : ca.SX
        Bristle force [N], positive when it opposes pulling.
    f_n : ca.SX
        Normal force [N], > 0.
    bristle : BristleParameters
    """
    return bristle.bristle_stiffness_N_per_m * (v - f_s * ca.fabs(v) / (f_n * stribeck_coefficient(v, bristle)))


def friction_force(v: ca.SX, f_s: ca.SX, viscous_N_s_per_m: ca.SX) -> ca.SX:
    """f_f = f_s + b v [N], eq. (5c)."""
    return f_s + viscous_N_s_per_m * v


@dataclass(frozen=True, slots=True, kw_only=True)
class ImplicitBristle:
    """Eq. (5a) under the implicit rule f_s = base + H df_s/dt: f_s (1 + g/f_n) = B.

    The rate is affine in f_s and its slope is inverse to f_n, so the rule has a closed form both forwards, where
    f_n is known, and backwards, where f_n = A + f_s (`bristle_force_from_far_side`).

    Parameters
    ----------
    drive : ca.SX
        B = base + H sigma0 v [N].
    resistance : ca.SX
        g = H sigma0 abs(v)/mu(v) [N], >= 0.
    """

    drive: ca.SX
    resistance: ca.SX

    def force(self, f_n: ca.SX) -> ca.SX:
        """f_s [N] for a known normal force [N]."""
        return self.drive * f_n / (f_n + self.resistance)

    def bristle_force_from_far_side(self, far_sum: ca.SX) -> ca.SX:
        """f_s [N] when f_n = A + f_s, the root of f_s^2 + (A + g - B) f_s - A B = 0 with f_n > 0.

        Parameters
        ----------
        far_sum : ca.SX
            A = 2 f_{i+1} + 2 p + b v + m dv/dt [N].
        """
        half = (far_sum + self.resistance - self.drive) / 2
        product = far_sum * self.drive
        root = ca.sqrt(at_least(half * half + product, 0))
        # Two forms of the same root; each cancels on the other's side.
        return ca.if_else(half > 0, product / at_least(root + half, NORMAL_FORCE_FLOOR_N), root - half)


def implicit_bristle(v: ca.SX, base: ca.SX, step_s: ca.SX, bristle: BristleParameters) -> ImplicitBristle:
    """Solve eq. (5a) over an implicit step, symbolically, from `bristle_rate` itself.

    Parameters
    ----------
    v : ca.SX
        Velocity at the end of the step [m/s].
    base : ca.SX
        What the scheme adds the rate to: the old f_s for implicit Euler [N].
    step_s : ca.SX
        H, the weight of the rate: the step for implicit Euler [s].
    bristle : BristleParameters
    """
    f_s = ca.SX.sym("f_s")
    rate = bristle_rate(v, f_s, ca.SX(1), bristle)
    slope = ca.jacobian(rate, f_s)
    drive = base + step_s * ca.substitute(rate, f_s, ca.SX(0))
    return ImplicitBristle(drive=drive, resistance=-step_s * slope)
