"""The laws of one element under an implicit step, as functions that every solver shares.

A scheme is written as x = base + H dx/dt at the end of the step; implicit Euler has base = old x, H = h. Then a link
is affine in the rate of its elongation, a bristle is rational in velocity and normal force, and what is left to solve
is one equation per mass in its velocity, coupled to its two neighbours only.
"""

from dataclasses import dataclass

import casadi as ca

from tendonff.models.chain import End, end_force
from tendonff.models.friction import (
    BristleParameters,
    friction_force,
    implicit_bristle,
    normal_force,
)
from tendonff.models.link import LinkParameters, implicit_link, tendon_force
from tendonff.ocp.codegen.law import Law


def _symbols(names: str) -> tuple[ca.SX, ...]:
    return tuple(ca.SX.sym(name) for name in names.split())


LINK_NAMES = "k1 k2 tau c"
BRISTLE_NAMES = "sigma0 mu_dp mu_sp mu_dr mu_sr omega"


def _link_parameters() -> tuple[tuple[ca.SX, ...], LinkParameters]:
    k1, k2, tau, c = symbols = _symbols(LINK_NAMES)
    return symbols, LinkParameters(
        stiffness_N_per_m=k1, relaxing_stiffness_N_per_m=k2, relaxation_time_s=tau, damping_N_s_per_m=c
    )


def _bristle_parameters(*, stribeck: bool) -> tuple[tuple[ca.SX, ...], BristleParameters]:
    sigma0, mu_dp, mu_sp, mu_dr, mu_sr, omega = symbols = _symbols(BRISTLE_NAMES)
    return symbols, BristleParameters(
        bristle_stiffness_N_per_m=sigma0,
        mu_dynamic_pull=mu_dp,
        mu_static_pull=mu_sp if stribeck else mu_dp,
        mu_dynamic_release=mu_dr,
        mu_static_release=mu_sr if stribeck else mu_dr,
        stribeck_velocity_m_per_s=omega,
    )


def link_gain() -> Law:
    """Slope of a link's unclipped force over the rate of elongation: one number for a whole run."""
    symbols, link = _link_parameters()
    rate, e_base, z_base, step = _symbols("rate e_base z_base H")
    gain = ca.jacobian(implicit_link(rate, e_base, z_base, step, link).unclipped_N, rate)
    return Law(
        name="link_gain",
        comment="Slope of a link's force over its rate of elongation under an implicit step [N s/m], eqs. (6), (7).",
        inputs=(step, *symbols),
        outputs={"gain": gain},
    )


def link_start() -> Law:
    """A link's unclipped force at zero rate of elongation: one number per link and step."""
    symbols, link = _link_parameters()
    e_base, z_base, step = _symbols("e_base z_base H")
    start = implicit_link(ca.SX(0), e_base, z_base, step, link).unclipped_N
    return Law(
        name="link_start",
        comment="A link's force at zero rate of elongation, before slack [N], eqs. (6), (7).",
        inputs=(e_base, z_base, step, *symbols),
        outputs={"start": start},
    )


def link_force() -> Law:
    """Tension of a link from its affine form, and its slope: a tendon cannot push."""
    rate, start, gain = _symbols("rate start gain")
    force = tendon_force(start + gain * rate)
    return Law(
        name="link_force",
        comment="Tension of a link [N] and its slope over the rate of elongation [N s/m]; a tendon cannot push.",
        inputs=(rate, start, gain),
        outputs={"force": force, "slope": ca.jacobian(force, rate)},
    )


def link_states() -> Law:
    """Elongation and relaxed elongation of a link at the end of the step."""
    symbols, link = _link_parameters()
    rate, e_base, z_base, step = _symbols("rate e_base z_base H")
    end = implicit_link(rate, e_base, z_base, step, link)
    return Law(
        name="link_states",
        comment="Elongation and relaxed elongation of a link at the end of the step [m].",
        inputs=(rate, e_base, z_base, step, *symbols),
        outputs={"e": end.e, "z": end.z},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _PathMass:
    """Symbols and expressions of one mass on the path."""

    inputs: tuple[ca.SX, ...]
    residual: ca.SX
    f_s: ca.SX


def _path_mass(*, stribeck: bool = True) -> _PathMass:
    v, v_base, f_near, f_far, s_base, step, mass, viscous, adhesion = _symbols(
        "v v_base f_near f_far s_base H mass b p"
    )
    symbols, bristle = _bristle_parameters(stribeck=stribeck)
    f_n = normal_force(f_near, f_far, adhesion)
    f_s = implicit_bristle(v, s_base, step, bristle).force(f_n)
    f_f = friction_force(v, f_s, viscous)
    residual = mass / step * (v - v_base) - (f_near - f_far - f_f)
    inputs = (v, f_near, f_far, v_base, s_base, step, mass, viscous, adhesion, *symbols)
    return _PathMass(inputs=inputs, residual=residual, f_s=f_s)


def path_mass(*, stribeck: bool = True) -> Law:
    """Balance of a mass on the path [N] and its slopes: zero where the mass's velocity solves the step.

    Parameters
    ----------
    stribeck : bool, optional
        False leaves the static coefficients out of the law; the arguments stay.
    """
    m = _path_mass(stribeck=stribeck)
    v, f_near, f_far = m.inputs[:3]
    return Law(
        name="path_mass",
        comment="Balance of a mass on the path [N], its slopes, and its bristle force [N], eqs. (4), (5).",
        inputs=m.inputs,
        outputs={
            "residual": m.residual,
            "by_v": ca.jacobian(m.residual, v),
            "by_near": ca.jacobian(m.residual, f_near),
            "by_far": ca.jacobian(m.residual, f_far),
            "f_s": m.f_s,
        },
    )


def path_balance(*, stribeck: bool = True) -> Law:
    """Balance of a mass on the path [N] without its slopes.

    Parameters
    ----------
    stribeck : bool, optional
        As for `path_mass`.
    """
    m = _path_mass(stribeck=stribeck)
    return Law(
        name="path_balance",
        comment="Balance of a mass on the path [N] and its bristle force [N], eqs. (4), (5).",
        inputs=m.inputs,
        outputs={"residual": m.residual, "f_s": m.f_s},
    )


def path_mass_tangent() -> Law:
    """Every slope of a path mass's balance (`r_by_X`) and bristle force (`s_by_X`) that a sensitivity needs."""
    m = _path_mass()
    outputs: dict[str, ca.SX] = {}
    for symbol in m.inputs:
        if (name := symbol.name()) != "H":
            outputs[f"r_by_{name}"] = ca.jacobian(m.residual, symbol)
            outputs[f"s_by_{name}"] = ca.jacobian(m.f_s, symbol)
    return Law(
        name="path_mass_tangent",
        comment="Slopes of a path mass's balance and bristle force over states and parameters.",
        inputs=m.inputs,
        outputs=outputs,
    )


def end_mass_residual(inputs: tuple[ca.SX, ...]) -> ca.SX:
    """Balance of an end mass [N] in the symbols of `end_mass`."""
    v, f, v_base, q_base, step, pull, f_c, x_c, mass, damping, stiffness = inputs
    end = End(mass_kg=mass, damping_N_s_per_m=damping, stiffness_N_per_m=stiffness)
    return mass / step * (v - v_base) - end_force(v, q_base + step * v, f, pull, f_c, x_c, end)


def end_mass() -> Law:
    """Balance of an end mass [N] and its slopes; `pull` is +1 where the tension pulls it to the positive side."""
    inputs = _symbols("v f v_base q_base H pull f_c x_c mass damping stiffness")
    v, f = inputs[:2]
    residual = end_mass_residual(inputs)
    return Law(
        name="end_mass",
        comment="Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end.",
        inputs=inputs,
        outputs={"residual": residual, "by_v": ca.jacobian(residual, v), "by_f": ca.jacobian(residual, f)},
    )


def link_tangent() -> Law:
    """Slopes of a link's unclipped force and relaxed elongation over states and parameters."""
    symbols, link = _link_parameters()
    rate, e_base, z_base, step = _symbols("rate e_base z_base H")
    end = implicit_link(rate, e_base, z_base, step, link)
    outputs = {f"u_by_{s.name()}": ca.jacobian(end.unclipped_N, s) for s in (e_base, z_base, *symbols)}
    outputs |= {f"z_by_{s.name()}": ca.jacobian(end.z, s) for s in (rate, e_base, z_base, symbols[2])}
    return Law(
        name="link_tangent",
        comment="Slopes of a link's force before slack and of its relaxed elongation.",
        inputs=(rate, e_base, z_base, step, *symbols),
        outputs=outputs,
    )


def end_mass_tangent() -> Law:
    """Slopes of an end mass's balance over bases, motor inputs and parameters."""
    inputs = end_mass().inputs
    residual = end_mass_residual(inputs)
    kept = [s for s in inputs if s.name() not in ("v", "H", "pull")]
    return Law(
        name="end_mass_tangent",
        comment="Slopes of an end mass's balance.",
        inputs=inputs,
        outputs={f"by_{s.name()}": ca.jacobian(residual, s) for s in kept},
    )


def tangent_laws() -> tuple[Law, ...]:
    """The laws that forward sensitivities need beside `simulation_laws`."""
    return (link_tangent(), path_mass_tangent(), end_mass_tangent())


def _zero_of(expression: ca.SX, unknown: ca.SX) -> ca.SX:
    """Root of an expression that is affine in `unknown`."""
    return -ca.substitute(expression, unknown, ca.SX(0)) / ca.jacobian(expression, unknown)


def far_velocity() -> Law:
    """Velocity of the load that a given output tension causes."""
    inputs = end_mass().inputs
    residual, v = end_mass_residual(inputs), inputs[0]
    return Law(
        name="far_velocity",
        comment="Velocity of an end mass [m/s] for a given tension.",
        inputs=inputs[1:],
        outputs={"v": _zero_of(residual, v)},
    )


def near_force() -> Law:
    """Motor force that gives an end mass a given velocity against a given tension."""
    inputs = end_mass().inputs
    residual = end_mass_residual(inputs)
    f_c = inputs[6]
    return Law(
        name="near_force",
        comment="Motor force [N] that gives an end mass its velocity.",
        inputs=(*inputs[:6], *inputs[7:]),
        outputs={"f_c": _zero_of(residual, f_c)},
    )


def link_rate() -> Law:
    """Rate of elongation of a taut link that carries a given force."""
    rate, start, gain, force = _symbols("rate start gain force")
    return Law(
        name="link_rate",
        comment="Rate of elongation [m/s] of a taut link that carries a given force.",
        inputs=(force, start, gain),
        outputs={"rate": _zero_of(start + gain * rate - force, rate)},
    )


def path_mass_inverse(*, stribeck: bool = True) -> Law:
    """Tension on the actuator's side of a mass whose motion and load side are known, where f_n = A + f_s.

    Parameters
    ----------
    stribeck : bool, optional
        As for `path_mass`.
    """
    v, f_far, v_base, s_base, step, mass, viscous, adhesion = _symbols("v f_far v_base s_base H mass b p")
    symbols, bristle = _bristle_parameters(stribeck=stribeck)
    without_bristle = f_far + friction_force(v, ca.SX(0), viscous) + mass / step * (v - v_base)
    f_s = implicit_bristle(v, s_base, step, bristle).bristle_force_from_far_side(f_far + without_bristle + 2 * adhesion)
    return Law(
        name="path_mass_inverse",
        comment="Tension on the actuator's side [N], at least zero, and its bristle force [N], eqs. (4), (5).",
        inputs=(v, f_far, v_base, s_base, step, mass, viscous, adhesion, *symbols),
        outputs={"f_near": tendon_force(without_bristle + f_s), "f_s": f_s},
    )


def path_mass_drop() -> Law:
    """What a mass whose motion and load side are known adds to the tension: friction and inertia.

    `path_mass_inverse` without the sum, for arithmetic with few digits, and without the slack: f_i = f_{i+1} + drop.
    """
    v, f_far, v_base, s_base, step, mass, viscous, adhesion = _symbols("v f_far v_base s_base H mass b p")
    symbols, bristle = _bristle_parameters(stribeck=True)
    inertia = mass / step * (v - v_base)
    far_sum = 2 * f_far + friction_force(v, ca.SX(0), viscous) + inertia + 2 * adhesion
    f_s = implicit_bristle(v, s_base, step, bristle).bristle_force_from_far_side(far_sum)
    return Law(
        name="path_mass_drop",
        comment="Friction and inertia of a mass on the path [N], and its bristle force [N], eqs. (4), (5).",
        inputs=(v, f_far, v_base, s_base, step, mass, viscous, adhesion, *symbols),
        outputs={"drop": friction_force(v, f_s, viscous) + inertia, "f_s": f_s},
    )


def inverse_laws(*, stribeck: bool = True) -> tuple[Law, ...]:
    """The laws that the exact inverse needs beside `link_gain`, `link_start` and `link_states`.

    Parameters
    ----------
    stribeck : bool, optional
        As for `path_mass`.
    """
    return (far_velocity(), near_force(), link_rate(), path_mass_inverse(stribeck=stribeck))


def simulation_laws(*, stribeck: bool = True) -> tuple[Law, ...]:
    """The laws a time step needs, in the order in which C must define them.

    Parameters
    ----------
    stribeck : bool, optional
        As for `path_mass`.
    """
    path = (path_mass(stribeck=stribeck), path_balance(stribeck=stribeck))
    return (link_gain(), link_start(), link_force(), link_states(), *path, end_mass())
