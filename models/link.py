"""Links: the tendon between two masses, elastic (6) or visco-elastic (7).

Elongation e = q_near - q_far is positive when the link is stretched; the force f > 0 pulls both masses together::

    [ near ]--<--f--~~~~ link ~~~~--f-->--[ far ]        e = q_near - q_far        a tendon cannot push: f >= 0

Equation numbers are those of Palli, Borghesan, Melchiorri (ICRA 2010).
"""

from dataclasses import dataclass

import casadi as ca

from tendonff.models.bounds import at_least


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkParameters:
    """Parameters of one link; numbers or CasADi scalars.

    Parameters
    ----------
    stiffness_N_per_m, relaxing_stiffness_N_per_m : float or ca.SX
        k1 (N + 1), k2 (N + 1) [N/m]; k2 = 0 is the elastic link (6).
    relaxation_time_s : float or ca.SX
        tau = b_k/k2 [s].
    damping_N_s_per_m : float or ca.SX
        c (N + 1) [N s/m].
    """

    stiffness_N_per_m: ca.SX
    relaxing_stiffness_N_per_m: ca.SX
    relaxation_time_s: ca.SX
    damping_N_s_per_m: ca.SX


def relaxation_rate(e: ca.SX, z: ca.SX, link: LinkParameters) -> ca.SX:
    """dz/dt = (e - z)/tau [m/s], eq. (7) in the time domain.

    Parameters
    ----------
    e, z : ca.SX
        Elongation, and elongation of the relaxing branch's damper [m].
    link : LinkParameters
    """
    return (e - z) / link.relaxation_time_s


def unclipped_force(e: ca.SX, e_rate: ca.SX, z: ca.SX, link: LinkParameters) -> ca.SX:
    """k1 e + k2 (e - z) + c de/dt [N], eqs. (6), (7): what a link that can push would carry.

    Parameters
    ----------
    e, e_rate, z : ca.SX
        Elongation [m], its rate [m/s], elongation of the relaxing branch's damper [m].
    link : LinkParameters
    """
    return link.stiffness_N_per_m * e + link.relaxing_stiffness_N_per_m * (e - z) + link.damping_N_s_per_m * e_rate


def tendon_force(unclipped_N: ca.SX) -> ca.SX:
    """Force of a link that cannot push [N]: zero where `unclipped_force` is negative (slack)."""
    return at_least(unclipped_N, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImplicitLink:
    """Eqs. (6), (7) under the implicit rule x = base + H dx/dt: affine in the rate of elongation.

    Parameters
    ----------
    e, z : ca.SX
        States at the end of the step [m].
    unclipped_N : ca.SX
        Force at the end of the step, before slack [N].
    """

    e: ca.SX
    z: ca.SX
    unclipped_N: ca.SX


def implicit_link(e_rate: ca.SX, e_base: ca.SX, z_base: ca.SX, step_s: ca.SX, link: LinkParameters) -> ImplicitLink:
    """Solve the relaxing branch over an implicit step, symbolically, from `relaxation_rate` itself.

    Parameters
    ----------
    e_rate : ca.SX
        Rate of elongation at the end of the step [m/s].
    e_base, z_base : ca.SX
        What the scheme adds the rates to: the old states for implicit Euler [m].
    step_s : ca.SX
        H, the weight of the rates: the step for implicit Euler [s].
    link : LinkParameters
    """
    e = e_base + step_s * e_rate
    z_symbol = ca.SX.sym("z")
    rate = relaxation_rate(e, z_symbol, link)
    z = (z_base + step_s * ca.substitute(rate, z_symbol, ca.SX(0))) / (1 - step_s * ca.jacobian(rate, z_symbol))
    return ImplicitLink(e=e, z=z, unclipped_N=unclipped_force(e, e_rate, z, link))


def transfer_function(link: LinkParameters) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """Numerator and denominator of F/E of one link in powers of s, highest first, eq. (7).

    F/E = [c tau s^2 + (tau (k1 + k2) + c) s + k1]/(tau s + 1). The paper prints F/V = F/(s E) with c = 0 and
    tau = b_k/k2: [b_k (k1 + k2) s + k1 k2]/(b_k s^2 + k2 s).

    Parameters
    ----------
    link : LinkParameters
        Numbers.

    Returns
    -------
    numerator : tuple of 3 floats
    denominator : tuple of 2 floats
    """
    k1, k2 = float(link.stiffness_N_per_m), float(link.relaxing_stiffness_N_per_m)
    tau, c = float(link.relaxation_time_s), float(link.damping_N_s_per_m)
    return (c * tau, tau * (k1 + k2) + c, k1), (tau, 1.0)
