"""Laws of a joint between two chains under an implicit step, beside those of the chains' own elements."""

from dataclasses import replace

import casadi as ca
import numpy as np

from tendonff.models.joint.balance import JointLaw
from tendonff.models.layout import fields_of
from tendonff.models.tendon.assembly import near_tension, tension_sum
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import far_side_balance
from tendonff.ocp.codegen.printer import Law
from tendonff.ocp.step.laws import ElementLaws, symbolic, symbols, twins_of, way_of

_NO_JOINT = JointLaw(**dict.fromkeys(JointLaw.__dataclass_fields__, 0.0))
"""Numbers that do not matter: only the names of the fields are used."""

_RIGID = 1e30
"""Slope of a balance that lets nothing move."""

JOINT_NUMBERS = tuple(fields_of(_NO_JOINT, "joint_"))
"""Names of a joint's numbers in C."""


def joint_torque() -> Law:
    """Torque that the tendons give a joint, its slope over the joint's speed, and the joint's dry friction."""
    w, w_base, q_base, dry_base, step = inputs = symbols("w w_base q_base dry_base H")
    joint = symbolic(_NO_JOINT, "joint_")
    dry = joint.dry_friction(w, dry_base, step)
    torque = joint.torque(q_base + step * w, w, (w - w_base) / step, dry)
    return Law(
        name="joint_torque",
        comment="Torque of the tendons on a joint that touches nothing [N m], its slope over w, and its dry friction.",
        inputs=(*inputs, *fields_of(joint).values()),
        outputs={"torque": torque, "by_w": ca.jacobian(torque, w), "dry": dry},
    )


def joint_torque_tangent() -> Law:
    """Slopes of torque and dry friction of `joint_torque` over states and numbers (`torque_by_X`, `dry_by_X`)."""
    law = joint_torque()
    slopes = {
        f"{name}_by_{s.name()}": ca.jacobian(law.outputs[name], s)
        for name in ("torque", "dry")
        for s in law.inputs
        if s.name() != "H"
    }
    comment = "Slopes of the tendons' torque on a joint and of its dry friction."
    return replace(law, name="joint_torque_tangent", comment=comment, outputs=slopes)


def link_back(laws: ElementLaws) -> Law:
    """Rate of elongation of a taut link that carries a force, and its slope over the force."""
    law = laws.link_rate()
    force, rate = law.inputs[0], law.outputs["rate"]
    comment = "Rate of elongation [m/s] of a taut link that carries a force, and its slope over the force."
    return replace(
        law,
        name="link_back",
        comment=comment,
        outputs={"rate": rate, "by_force": ca.jacobian(rate, force)},
        held=tuple(s.name() for s in law.inputs[1:]),
    )


def path_mass_back(laws: ElementLaws) -> Law:
    """Friction and inertia that a mass adds to the tension, with slopes over its speed and the load side's tension.

    The balance of its friction's states gives their slopes without those of its root: fewer operations, and no
    branches. Where the tendon is slack they are those without friction.
    """
    law, friction = laws.path_mass_inverse(drop=True), laws.friction
    known = {s.name(): s for s in law.inputs}
    v, f_far, step = known["v"], known["f_far"], known["H"]
    inertia = known["piece_mass_kg"] / step * (v - known["v_base"])
    own = near_tension(f_far, friction.viscous_force(v), inertia)
    far_sum = tension_sum(f_far, own, known["piece_adhesion_N"])
    base = tuple(known[f"{name}_base"] for name in friction.states)
    found = ca.vertcat(*(law.outputs[name] for name in friction.states))
    x, a = ca.SX.sym("x", len(friction.states)), ca.SX.sym("a")
    states = tuple(ca.vertsplit(x))
    balance = ca.vertcat(*far_side_balance(friction, v, base, step, a, states))
    of_states = [ca.jacobian(friction.state_force(states), x), *(ca.jacobian(balance, s) for s in (x, a, v))]
    force, by_x, by_a, by_v = ca.substitute(of_states, [x, a], [found, far_sum])
    held = force @ ca.inv(ca.if_else(far_sum > 0, by_x, _RIGID * ca.SX.eye(len(states))))
    slopes = {
        "by_v": ca.jacobian(own, v) - held @ (by_v + by_a * ca.jacobian(far_sum, v)),
        "by_far": ca.jacobian(own, f_far) - held @ (by_a * ca.jacobian(far_sum, f_far)),
    }
    comment = "Friction and inertia of a mass [N], slopes of the tension behind it, and the states of its friction."
    every = {name: value for name, value in law.outputs.items() if name != "drop"}
    return replace(
        law,
        name="path_mass_back",
        comment=comment,
        outputs={"drop": law.outputs["drop"], **slopes, **every},
        held=tuple(known.keys() - {"v", "f_far"}),
    )


def representative(chains: tuple[Chain, ...]) -> Chain:
    """A chain whose code serves all of them: what is equal by chance in one only counts as different."""
    first = chains[0]
    alike = all(
        chain.friction.aliases() == first.friction.aliases() and twins_of(chain) == twins_of(first) for chain in chains
    )
    if alike:
        return first
    elements, n = first.elements, first.count
    apart = {name: float(k + 1) for k, name in enumerate(fields_of(elements.contact)) if way_of(name)}
    columns = {name: np.full(n, value) for name, value in apart.items()}
    contact = replace(elements.contact, **columns)  # type: ignore[type-var]
    return replace(first, elements=replace(elements, contact=contact, friction=replace(elements.friction, **apart)))  # type: ignore[type-var]
