"""A chain as the mechanism of two bodies: its ends, and the tendon between them."""

from dataclasses import dataclass

import casadi as ca

from tendonff.models.fidelity import Level
from tendonff.models.layout import INPUT_NAMES
from tendonff.models.mechanism.equations import Pose, equations_of
from tendonff.models.mechanism.loads import Damper, DryFriction
from tendonff.models.mechanism.mechanism import CutMechanism, CutTendon
from tendonff.models.mechanism.parts import Arm, Attachment, Body, Drive, Force, Lead, Servo, Unit
from tendonff.models.tendon.assembly import End
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import GearedEnd, RubbingEnd
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainEquations:
    """The continuous-time chain as CasADi expressions."""

    state: ca.SX  # shape (size, 1); in the order of `StateLayout`
    inputs: ca.SX  # shape (4, 1); in the order of `INPUT_NAMES`
    place: ca.SX  # shape (3 N + 3, 1); a row of `PathRows.table`
    place_rate: ca.SX  # shape (3 N + 3, 1); its time derivative
    rate: ca.SX  # shape (size, 1); time derivative of `state`
    tension_N: ca.SX  # shape (N + 1, 1); f_1 .. f_{N+1}


@in_turn
def chain_equations(chain: Chain) -> ChainEquations:
    """The equations of `mechanism_equations` for two bodies and one tendon, its path and its far end as columns."""
    n, led = chain.count, chain.far_joint is not None
    place, place_rate = ca.SX.sym("place", 3 * n + 3), ca.SX.sym("place_rate", 3 * n + 3)
    inputs, v_l, q_l = ca.SX.sym("u", len(INPUT_NAMES)), ca.SX.sym("v_l"), ca.SX.sym("q_l")
    angle_rate, _, gained_rate, far_rate = ca.vertsplit(place_rate, [0, n, 2 * n + 1, 3 * n + 2, 3 * n + 3])
    angle, ratio, _, far_place = ca.vertsplit(place, [0, n, 2 * n + 1, 3 * n + 2, 3 * n + 3])
    pose = Pose(angle_rad=angle, ratio=ratio, angle_rate=angle_rate, gained_rate=gained_rate)
    page = equations_of(_two_bodies(chain), {"tendon": pose} if chain.moving else None)

    names = {name: k for k, name in enumerate(page.state_names)}
    mine = dict(zip(names, ca.vertsplit(page.state), strict=True)) | ({"l_m_per_s": v_l, "l_m": q_l} if led else {})
    rates = dict(zip(names, ca.vertsplit(page.rate), strict=True))
    rates |= {"l_m_per_s": ca.SX(0), "l_m": far_rate} if led else {}
    order = _order(chain)
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(inputs)
    ends = (far_place, far_rate) if led else (ca.SX(0, 1), ca.SX(0, 1))
    rate, tension = ca.substitute(
        [ca.vertcat(*(rates[name] for name in order)), page.tension_N],
        [page.inputs, page.place, page.place_rate],
        [ca.vertcat(f_c1, x_c1, *(() if led else (-f_c2, x_c2))), *ends],
    )
    return ChainEquations(
        state=ca.vertcat(*(mine[name] for name in order)),
        inputs=inputs,
        place=place,
        place_rate=place_rate,
        rate=rate,
        tension_N=tension,
    )


def _order(chain: Chain) -> list[str]:
    """Names of the mechanism's states in the order of `StateLayout`."""
    n, layout = chain.count, chain.layout
    links = [f"tendon_{state}_{k}" for state in layout.link_states for k in range(1, n + 2)]
    masses = [f"tendon_{state}_{k}" for state in layout.friction_states for k in range(1, n + 1)]
    v = ["a_m_per_s", *(f"tendon_v_{k}_m_per_s" for k in range(1, n + 1)), "l_m_per_s"]
    rubbing = ["a_dry_N" for _ in layout.end_states]
    return [*v, *rubbing, *(f"tendon_e_{k}_m" for k in range(1, n + 2)), *links, *masses, "a_m", "l_m"]


def _two_bodies(chain: Chain) -> CutMechanism:
    """The ends of a chain as bodies, each with a force on it and a spring to its rest position."""
    ends: tuple[Drive, ...] = (Force(body="a"), Servo(body="a", stiffness=chain.near.stiffness_N_per_m))
    if chain.far_joint is None:
        ends = (*ends, Force(body="l"), Servo(body="l", stiffness=chain.far.stiffness_N_per_m))
    else:
        ends = (*ends, Lead(body="l"))
    near, far = (Attachment(arms=(Arm(body=name, metres_per_unit=1.0),)) for name in ("a", "l"))
    return CutMechanism(
        bodies=(_body("a", chain.near, chain.level), _body("l", chain.far, chain.level)),
        tendons=(CutTendon(name="tendon", elements=chain.elements, near=near, far=far),),
        drives=ends,
    )


def _body(name: str, end: End, level: Level) -> Body:
    loads: tuple[Damper | DryFriction, ...] = (Damper(damping=end.damping_N_s_per_m),)
    if isinstance(end, RubbingEnd):
        bristle = end.bristle_stiffness_N_per_m
        lost = end.lost_share if isinstance(end, GearedEnd) else 0.0
        dry = DryFriction(
            coulomb=end.coulomb_N, bristle_stiffness=bristle, soft_bristle_stiffness=bristle, lost_share=lost
        )
        loads = (*loads, dry.at(level))
    return Body(name=name, unit=Unit.METRE, inertia=end.mass_kg, loads=loads)
