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


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """One law: named scalar inputs, named scalar outputs.

    Parameters
    ----------
    name, comment : str
        Identifier, and what it computes with source.
    inputs : tuple of ca.SX
        Scalar symbols.
    outputs : dict of str to ca.SX
        Expressions.
    """

    name: str
    comment: str
    inputs: tuple[ca.SX, ...]
    outputs: dict[str, ca.SX]

    def function(self) -> ca.Function:
        """The law as a CasADi function."""
        return ca.Function(
            self.name,
            list(self.inputs),
            list(self.outputs.values()),
            [s.name() for s in self.inputs],
            list(self.outputs),
        )


def _symbols(names: str) -> tuple[ca.SX, ...]:
    return tuple(ca.SX.sym(name) for name in names.split())


LINK_NAMES = "k1 k2 tau c"
BRISTLE_NAMES = "sigma0 mu_dp mu_sp mu_dr mu_sr omega"


def _link_parameters() -> tuple[tuple[ca.SX, ...], LinkParameters]:
    k1, k2, tau, c = symbols = _symbols(LINK_NAMES)
    return symbols, LinkParameters(
        stiffness_N_per_m=k1, relaxing_stiffness_N_per_m=k2, relaxation_time_s=tau, damping_N_s_per_m=c
    )


def _bristle_parameters() -> tuple[tuple[ca.SX, ...], BristleParameters]:
    sigma0, mu_dp, mu_sp, mu_dr, mu_sr, omega = symbols = _symbols(BRISTLE_NAMES)
    return symbols, BristleParameters(
        bristle_stiffness_N_per_m=sigma0,
        mu_dynamic_pull=mu_dp,
        mu_static_pull=mu_sp,
        mu_dynamic_release=mu_dr,
        mu_static_release=mu_sr,
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


def _path_mass() -> _PathMass:
    v, v_base, f_near, f_far, s_base, step, mass, viscous, adhesion = _symbols(
        "v v_base f_near f_far s_base H mass b p"
    )
    symbols, bristle = _bristle_parameters()
    f_n = normal_force(f_near, f_far, adhesion)
    f_s = implicit_bristle(v, s_base, step, bristle).force(f_n)
    f_f = friction_force(v, f_s, viscous)
    residual = mass * (v - v_base) / step - (f_near - f_far - f_f)
    inputs = (v, f_near, f_far, v_base, s_base, step, mass, viscous, adhesion, *symbols)
    return _PathMass(inputs=inputs, residual=residual, f_s=f_s)


def path_mass() -> Law:
    """Balance of a mass on the path [N] and its slopes: zero where the mass's velocity solves the step."""
    m = _path_mass()
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


def path_mass_tangent() -> Law:
    """Every slope of a path mass's balance and bristle force that a sensitivity needs.

    Outputs `residual_by_X` and `f_s_by_X` for X in v, f_near, f_far, v_base, s_base, mass, b, p and the six bristle
    parameters; those of the residual over v, f_near, f_far are in `path_mass` and left out here.
    """
    m = _path_mass()
    by_name = {symbol.name(): symbol for symbol in m.inputs}
    outputs: dict[str, ca.SX] = {}
    for name, symbol in by_name.items():
        if name == "H":
            continue
        if name not in ("v", "f_near", "f_far"):
            outputs[f"residual_by_{name}"] = ca.jacobian(m.residual, symbol)
        if name not in ("v_base", "mass", "b"):
            outputs[f"f_s_by_{name}"] = ca.jacobian(m.f_s, symbol)
    return Law(
        name="path_mass_tangent",
        comment="Slopes of a path mass's balance and bristle force over states and parameters.",
        inputs=m.inputs,
        outputs=outputs,
    )


def end_mass() -> Law:
    """Balance of an end mass [N] and its slopes; `pull` is +1 where the tension pulls it to the positive side."""
    v, f, v_base, q_base, step, pull, f_c, x_c, mass, damping, stiffness = _symbols(
        "v f v_base q_base H pull f_c x_c mass damping stiffness"
    )
    end = End(mass_kg=mass, damping_N_s_per_m=damping, stiffness_N_per_m=stiffness)
    residual = mass * (v - v_base) / step - end_force(v, q_base + step * v, f, pull, f_c, x_c, end)
    return Law(
        name="end_mass",
        comment="Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end.",
        inputs=(v, f, v_base, q_base, step, pull, f_c, x_c, mass, damping, stiffness),
        outputs={"residual": residual, "by_v": ca.jacobian(residual, v), "by_f": ca.jacobian(residual, f)},
    )


def simulation_laws() -> tuple[Law, ...]:
    """The laws a time step needs, in the order in which C must define them."""
    return (link_gain(), link_start(), link_force(), link_states(), path_mass(), end_mass())
