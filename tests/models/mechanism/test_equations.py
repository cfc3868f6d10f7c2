"""The equations of a mechanism on one page."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from explicit_finger import Numbers, Strand, respond
from numpy.typing import NDArray

import tendonff as tf
from tendonff.models import parameters
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.layout import INPUT_NAMES
from tendonff.models.mechanism import (
    Arm,
    Attachment,
    Body,
    Damper,
    DryFriction,
    Force,
    Gravity,
    Lead,
    Mechanism,
    MechanismEquations,
    Spring,
    Stops,
    Table,
    Tendon,
    Unit,
    mechanism_equations,
    rest_state,
)
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Transmission
from tendonff.models.path import ANGLE_FLOOR_RAD, JointMotion, Section
from tendonff.models.tendon.assembly import end_force, normal_force, path_force
from tendonff.models.tendon.chain import Chain, laws_at
from tendonff.models.tendon.link import tendon_force
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import simulate_mechanism

Array = NDArray[np.float64]

SECTIONS = (
    Section(name="sheath", angle_rad=1.5, length_m=0.2),
    Section(name="bend", angle_rad=0.4, length_m=0.05, joint="elbow", angle_per_rad=0.8, length_per_rad_m=0.006),
    Section(
        name="guide", angle_rad=0.9, length_m=0.1, mu_dynamic=0.12, mu_static=0.14, joint="wrist", angle_per_rad=-1
    ),
)
MOTION = JointMotion(
    names=("elbow", "wrist"), time_s=np.linspace(0, 1, 4), angle_rad=np.array([[0, 0], [0.6, 0.2], [-0.3, 0.4], [0, 0]])
)


def chain_by_hand(chain: Chain) -> tuple[ca.Function, int]:
    """The chain of Fig. 2 with laws (4) to (7), written out for two ends and one tendon."""
    n, layout, piece = chain.count, chain.layout, chain.elements.piece
    state, inputs = ca.SX.sym("x", layout.size), ca.SX.sym("u", len(INPUT_NAMES))
    place, place_rate = ca.SX.sym("place", 3 * n + 3), ca.SX.sym("place_rate", 3 * n + 3)
    angle_rate, _, gained_rate, far_rate = ca.vertsplit(place_rate, [0, n, 2 * n + 1, 3 * n + 2, 3 * n + 3])
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(inputs)
    v, *own, q_a, q_l = ca.vertsplit(state, layout.cuts)
    rubbing, (e, *own) = tuple(own[: len(layout.end_states)]), own[len(layout.end_states) :]
    friction, link = laws_at(chain, place)
    links, masses = tuple(own[: len(link.states)]), tuple(own[len(link.states) :])
    v_far = v[n + 1] if chain.far_joint is None else far_rate
    e_rate = ca.vertcat(v[:-2] - v[1:-1], v[n] - v_far) + (gained_rate if chain.moving else 0)
    f = tendon_force(link.unclipped_force(e, e_rate, links))
    on_path = v[1:-1]
    f_f = friction.state_force(masses) + friction.viscous_force(on_path)
    near, far = chain.near, chain.far
    near_force = end_force(v[0], q_a, f[0], -1, f_c1, x_c1, near, rubbing)
    far_force = end_force(v[n + 1], q_l, f[n], 1, f_c2, x_c2, far) if chain.far_joint is None else 0
    own_rate = friction.rate(on_path, masses, normal_force(f[:-1], f[1:], piece.adhesion_N))
    if chain.moving:
        lost = ca.fmin(angle_rate, 0) / ca.fmax(place[:n], ANGLE_FLOOR_RAD)
        own_rate = tuple(rate + lost * state for rate, state in zip(own_rate, masses, strict=True))
    accelerations = (
        near_force / near.mass_kg,
        path_force(f[:-1], f[1:], f_f) / ca.DM(piece.mass_kg),
        far_force / far.mass_kg,
    )
    dry = near.rate(v[0], rubbing, f[0])
    rate = ca.vertcat(*accelerations, *dry, e_rate, *link.rate(e, links), *own_rate, v[0], v_far)
    return ca.Function("by_hand", [state, inputs, place, place_rate], [rate, f]), layout.size


def rigs(generic: Transmission) -> dict[str, Transmission]:
    """Single tendons: plain, in sections, moving, moved at its far end, with a drive that rubs."""
    path = parameters.Path(total_angle_rad=2.8, segments=5, sections=SECTIONS)
    friction = replace(generic.friction, adhesion_N=1.3, mu_dynamic_release=0.14)
    sections = replace(generic, friction=friction, path=path, motion=MOTION)
    return {
        "plain": replace(generic, friction=friction),
        "moving": sections,
        "far": replace(sections, load=replace(generic.load, joint="wrist", moment_arm_m=0.011)),
        "rubbing": replace(sections, actuator=replace(generic.actuator, coulomb_N=2.0)),
    }


def drawn(rng: np.random.Generator, chain: Chain, place: Array) -> list[Array]:
    """A state anywhere, slack links among them, inputs and a motion of the path."""
    state, layout = chain.rest_state(30.0).vector(), chain.layout
    state *= 1 + 0.8 * rng.standard_normal(layout.size)
    state[layout.part("v")] = 1e-2 * rng.standard_normal(chain.count + 2)
    for name in (*layout.end_states, *layout.friction_states):
        state[layout.part(name)] = rng.standard_normal(state[layout.part(name)].shape)
    return [state, 20 * rng.standard_normal(4), place, 0.3 * rng.standard_normal(len(place))]


@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("rig", ["plain", "moving", "far", "rubbing"])
def test_a_single_tendon_is_the_mechanism_of_two_bodies(rig: str, level: Level, generic: Transmission) -> None:
    """Against the chain written out by hand, at random states and poses."""
    transmission = rigs(generic)[rig]
    chain = Chain.of(transmission, level)
    if rig == "plain":
        chain = chain.with_end_stiffness(700.0, 3000.0)
    page = chain_equations(chain)
    new = ca.Function("new", [page.state, page.inputs, page.place, page.place_rate], [page.rate, page.tension_N])
    old, size = chain_by_hand(chain)
    assert page.state.numel() == size
    rng = np.random.default_rng(3)
    points = [drawn(rng, chain, chain.path_at(rng.uniform(0, 1, 1)).table()[0]) for _ in range(20)]
    mine, theirs = (
        np.array([np.concatenate([np.asarray(part).ravel() for part in f(*at)]) for at in points]) for f in (new, old)
    )
    largest = np.abs(theirs).max(axis=0)
    assert (np.abs(mine - theirs).max(axis=0) <= 1e-12 * largest).all()
    moving = chain.far_joint is None
    assert (largest > 0).sum() >= len(largest) - (0 if moving else 1)
    slack = theirs[:, size:] == 0
    assert slack.any()
    assert not slack.all()


@pytest.mark.parametrize("rig", ["plain", "moving", "far", "rubbing"])
def test_a_transmission_gives_the_equations_of_its_chain(rig: str, generic: Transmission) -> None:
    """Poses of the path follow from the joints' angles as they do in `CutPath.at`."""
    transmission, level = rigs(generic)[rig], Level.PRESLIDING
    mechanism, chain = Mechanism.of(transmission), Chain.of(transmission, level)
    page, cut, old = mechanism_equations(mechanism, level), mechanism.cut(level), chain_by_hand(chain)[0]
    f = ca.Function("f", [page.state, page.inputs, page.place, page.place_rate], [page.tension_N, page.rate])
    time, d = np.array([0.45]), 1e-5
    place, before, after = (chain.path_at(time + shift).table()[0] for shift in (0, -d, d))
    led = [body.name for body in cut.led]
    angles, start = ({name: MOTION.at(t)[0][MOTION.names.index(name)] for name in led} for t in (time, np.zeros(1)))
    rates = [(MOTION.at(time + d) - MOTION.at(time - d))[0][MOTION.names.index(name)] / (2 * d) for name in led]
    at_start = rest_state(
        cut, {"tendon": 20.0}, {"actuator": 0.1, "load": 20.0 / transmission.load.stiffness_N_per_m} | start
    )
    rest = chain.rest_state(20.0)
    free = transmission.load.joint is None
    tension, rate = f(at_start, [21.0, 0.0][: 1 + free], list(angles.values()), rates)
    theirs, force = old(rest.vector(), [21.0, 0, 0, 0], place, (after - before) / (2 * d))
    assert np.asarray(tension) == pytest.approx(np.asarray(force), rel=1e-9)
    [k] = page.rows("actuator_m_per_s")
    assert float(rate[k]) == pytest.approx(float(theirs[0]), rel=1e-9)
    first, last = (page.rows(name)[0] for name in ("tendon_e_1_m", f"tendon_e_{chain.count + 1}_m"))
    there = chain.layout.part("e")
    assert np.asarray(rate)[first : last + 1] == pytest.approx(np.asarray(theirs)[there], rel=1e-6, abs=1e-9)


def finger(sections: bool = True) -> Mechanism:
    """Three joints and four tendons that cross them; one arm is a table, one motor holds two tendons."""
    names = ("mcp", "pip", "dip")
    bones = tuple(
        Body(
            name=name,
            unit=Unit.RADIAN,
            inertia=2e-5,
            loads=(
                Damper(damping=1e-3),
                Spring(stiffness=0.1, rest=0.2),
                Gravity(amplitude_N_m=0.02, zero_rad=0.4),
                Stops(stiffness=60.0, low=-0.5, high=1.2),
                DryFriction(coulomb=0.01, bristle_stiffness=50.0, soft_bristle_stiffness=5.0),
            ),
            span=(-0.4, 1.1),
        )
        for name in names
    )
    motors = tuple(Body(name=name, unit=Unit.RADIAN, inertia=1.0) for name in ("m1", "m2", "m3"))
    bends = tuple(
        Section(name=name, angle_rad=0.4, length_m=0.02, joint=name, angle_per_rad=0.5, length_per_rad_m=-0.004)
        for name in names
    )
    channel = Section(name="channel", angle_rad=2.0, length_m=0.2)
    knots = np.array([-0.5, 0.3, 1.2])
    table = Table(body="dip", knots=knots, cubics=np.array([[0.0, 6e-3, 1e-3, 0.0], [5.4e-3, 7.6e-3, 0, 0]]))
    far = (
        Attachment(),
        Attachment(arms=(Arm(body="mcp", metres_per_unit=-0.008), Arm(body="pip", metres_per_unit=-0.006), table)),
        Attachment(arms=(Arm(body="pip", metres_per_unit=-0.007),)),
        Attachment(arms=(Arm(body="mcp", metres_per_unit=0.009),)),
    )
    near = (("m1", 0.008), ("m1", -0.007), ("m2", 0.01), ("m3", 0.01))
    tendon = parameters.Tendon(
        mass_kg=0.004,
        stiffness_N_per_m=2e4,
        relaxing_stiffness_N_per_m=5e3,
        relaxation_time_s=0.3,
        damping_N_s_per_m=2.0,
    )
    friction = parameters.Friction(
        mu_dynamic=0.15,
        mu_static=0.18,
        stribeck_velocity_m_per_s=0.01,
        viscous_N_s_per_m=0.5,
        bristle_stiffness_N_per_m=3e5,
        soft_bristle_stiffness_N_per_m=3e4,
        adhesion_N=0.7,
    )
    path = parameters.Path(total_angle_rad=3.2, segments=6, sections=(channel, *bends))
    plain = parameters.Path(total_angle_rad=2.0, segments=4)
    tendons = tuple(
        Tendon(
            name=f"t{k}",
            path=path if k == 0 and sections else plain,
            tendon=tendon,
            friction=friction,
            near=Attachment(arms=(Arm(body=body, metres_per_unit=radius),)),
            far=far[k],
        )
        for k, (body, radius) in enumerate(near)
    )
    leads = tuple(Lead(body=motor.name) for motor in motors)
    return Mechanism(bodies=(*bones, *motors), tendons=tendons, drives=(*(Force(body=name) for name in names), *leads))


def path_length(mechanism: Mechanism, places: dict[str, float]) -> Array:
    """What each tendon is stretched between its ends and its path, apart from the masses [m]: plain arithmetic."""
    found = []
    for tendon in mechanism.tendons:
        sections = sum(s.length_per_rad_m * places[s.joint] for s in tendon.path.sections if s.joint is not None)
        near, far = (float(ca.evalf(end.travel_m(places))) for end in (tendon.near, tendon.far))
        found.append(near - far + sections)
    return np.array(found)


def evaluated(page: MechanismEquations, **values: Array) -> dict[str, Array]:
    """Rate, tensions and efforts by name."""
    f = ca.Function(
        "f", [page.state, page.inputs, page.place, page.place_rate], [page.rate, page.tension_N, page.effort]
    )
    at = [
        values.get(name, np.zeros(getattr(page, name).numel())) for name in ("state", "inputs", "place", "place_rate")
    ]
    return dict(zip(("rate", "tension_N", "effort"), (np.asarray(each).ravel() for each in f(*at)), strict=True))


PLACES = {"mcp": 0.3, "pip": 0.7, "dip": 0.5, "m1": 0.1, "m2": 0.2, "m3": 0.3}
TENSIONS = {"t0": 20.0, "t1": 12.0, "t2": 9.0, "t3": 15.0}


def test_a_tendon_pulls_each_body_by_its_virtual_work() -> None:
    """At uniform tension the effort on a body is -T d(length)/dq, by differences."""
    mechanism = finger()
    page = mechanism_equations(mechanism, Level.PRESLIDING)
    state = rest_state(mechanism.cut(Level.PRESLIDING), TENSIONS, PLACES)
    out = evaluated(page, state=state, place=np.array([PLACES[name] for name in ("m1", "m2", "m3")]))
    d = 1e-6
    for body, effort in zip(mechanism.bodies, out["effort"], strict=True):
        lengths = [path_length(mechanism, PLACES | {body.name: PLACES[body.name] + step}) for step in (d, -d)]
        arms = (lengths[0] - lengths[1]) / (2 * d)
        assert effort == pytest.approx(-arms @ np.array(list(TENSIONS.values())), rel=1e-8)


def test_each_section_acts_with_its_local_tension() -> None:
    """tau = -sum of f dl/dq: with half of a tendon slackened the effort halves with it."""
    mechanism = finger()
    page = mechanism_equations(mechanism, Level.ELASTIC)
    state = rest_state(mechanism.cut(Level.ELASTIC), TENSIONS, PLACES)
    links = page.rows(*(f"t0_e_{k}_m" for k in range(1, 8)))
    state[links] *= np.linspace(1.0, 0.4, 7)
    out = evaluated(page, state=state)
    parts = mechanism.cut(Level.ELASTIC).tendons[0].elements.path.parts
    of_dip = -parts @ np.array([0, 0, 0, -0.004]) @ out["tension_N"][:7]
    table = mechanism.tendons[1].far.arms[2]
    q = ca.SX.sym("q")
    arm = float(ca.evalf(ca.substitute(ca.gradient(table.travel_m(q), q), q, PLACES["dip"])))
    assert out["effort"][2] == pytest.approx(of_dip + arm * TENSIONS["t1"], rel=1e-12)


def test_a_body_between_loads_and_tendons_obeys_its_balance() -> None:
    """J dw/dt = contact + tendons - damper - spring - gravity - stop - dry friction, in numbers."""
    mechanism = finger()
    page = mechanism_equations(mechanism, Level.PRESLIDING)
    state = rest_state(mechanism.cut(Level.PRESLIDING), TENSIONS, PLACES | {"pip": 1.3})
    w, dry, w_rate = page.rows("pip_rad_per_s", "pip_dry_N_m", "pip_rad_per_s")
    state[w], state[dry] = 0.4, 0.006
    out = evaluated(page, state=state, inputs=np.array([0.0, 0.05, 0.0]))
    held = 1e-3 * 0.4 + 0.1 * (1.3 - 0.2) + 0.02 * np.sin(1.3 - 0.4) + 60.0 * (1.3 - 1.2) + 0.006
    assert out["rate"][w_rate] == pytest.approx((0.05 + out["effort"][1] - held) / 2e-5, rel=1e-12)
    assert out["rate"][dry] == pytest.approx(5.0 * (0.4 - 0.006 * 0.4 / 0.01), rel=1e-12)  # the soft bristle


def test_two_loads_that_are_alike_both_count() -> None:
    damper = Damper(damping=0.01)
    dry = DryFriction(coulomb=0.01, bristle_stiffness=50.0, soft_bristle_stiffness=5.0)
    body = Body(name="wheel", unit=Unit.RADIAN, inertia=0.5, loads=(damper, damper, dry))
    page = mechanism_equations(Mechanism(bodies=(body,), tendons=(), drives=()), Level.ELASTIC)
    out = evaluated(page, state=np.array([0.0, 2.0, 0.003]))
    assert out["rate"][1] == pytest.approx(-(2 * 0.01 * 2.0 + 0.003) / 0.5)
    with pytest.raises(ParameterError, match='"wheel" has two dry frictions; make one of them'):
        replace(body, loads=(dry, dry))


def test_every_row_has_a_name_with_its_unit() -> None:
    page = mechanism_equations(finger(), Level.PRESLIDING)
    for column, names in (
        (page.state, page.state_names),
        (page.inputs, page.input_names),
        (page.place, page.place_names),
        (page.tension_N, page.tension_names),
        (page.effort, page.effort_names),
        (page.position, page.position_names),
    ):
        assert column.numel() == len(names) == len(set(names))
    assert page.input_names == ("mcp_torque_N_m", "pip_torque_N_m", "dip_torque_N_m")
    assert page.effort_names[0] == "mcp_effort_N_m"


@pytest.mark.parametrize("name", ["hand_joint", "instrument_pair"])
def test_a_joint_holds_its_start_as_its_mechanism(name: str, examples: Path) -> None:
    """At the tensions of the start the joint's balance vanishes, for a loop and for a pair."""
    scenario = tf.load_scenario(examples / f"{name}.toml")
    joint = scenario.mechanism.joint
    names = {s.joint for t in scenario.mechanism.tendons for s in t.path.sections if s.joint} | {joint.name}
    still = JointMotion(names=tuple(names), time_s=np.zeros(1), angle_rad=np.zeros((1, len(names))))
    problem = tf.system_of(scenario.mechanism, Level.PRESLIDING, still)
    mechanism = describe(scenario.mechanism, still)
    run = tf.simulate(problem, np.zeros((2, 1 if problem.loop else 2)), 1e-3)
    tensions = {t.name: float(f) for t, f in zip(mechanism.tendons, run.tension_N[0], strict=True)}
    cut = mechanism.cut(Level.PRESLIDING)
    page = mechanism_equations(mechanism, Level.PRESLIDING)
    state = rest_state(cut, tensions, {body.name: 0.0 for body in cut.bodies})
    out = evaluated(page, state=state)
    assert out["rate"] == pytest.approx(0.0, abs=1e-9 / joint.inertia_kg_m2)
    assert out["effort"][0] == pytest.approx(run.torque_N_m[0], abs=1e-12)


def by_hand() -> tuple[list[Strand], Numbers]:
    """The same finger for the independent plant: masses and links by hand, 3 and 1 for channel and each bend."""
    nothing, channel, bend, whole = np.zeros(3), 0.2 / 6, 0.02 / 2, 0.26
    bends, gains = np.zeros((6, 3)), np.zeros((7, 3))
    for joint in range(3):
        bends[3 + joint, joint] = 0.5
        gains[3 + joint : 5 + joint, joint] = -0.004 / 2
    crossing = Strand(
        angle=np.array([2 / 3] * 3 + [0.4] * 3),
        angle_by=bends,
        length=np.array([channel, *[2 * channel] * 2, channel + bend, *[2 * bend] * 2, bend]) / whole,
        length_by=gains / whole,
        gained_by=gains,
        piece=np.array([2 * channel] * 3 + [2 * bend] * 3) / whole,
        winding=np.array([0.008, 0, 0]),
        far=lambda _: 0.0,
        far_by=lambda _: nothing,
        tension=TENSIONS["t0"],
    )

    def plain(name: str, winding: Array, far: Callable[[Array], float], far_by: Callable[[Array], Array]) -> Strand:
        return replace(
            crossing,
            angle=np.full(4, 0.5),
            angle_by=np.zeros((4, 3)),
            length=np.array([1, 2, 2, 2, 1]) / 8,
            length_by=np.zeros((5, 3)),
            gained_by=np.zeros((5, 3)),
            piece=np.full(4, 0.25),
            winding=winding,
            far=far,
            far_by=far_by,
            tension=TENSIONS[name],
        )

    def dip(q: float) -> float:
        return 6e-3 * (q + 0.5) + 1e-3 * (q + 0.5) ** 2 if q < 0.3 else 5.4e-3 + 7.6e-3 * (q - 0.3)

    def dip_by(q: float) -> float:
        return 6e-3 + 2e-3 * (q + 0.5) if q < 0.3 else 7.6e-3

    strands = [
        crossing,
        plain(
            "t1",
            np.array([-0.007, 0, 0]),
            lambda q: -0.008 * q[0] - 0.006 * q[1] + dip(q[2]),
            lambda q: np.array([-0.008, -0.006, dip_by(q[2])]),
        ),
        plain("t2", np.array([0, 0.01, 0]), lambda q: -0.007 * q[1], lambda _: np.array([0, -0.007, 0])),
        plain("t3", np.array([0, 0, 0.01]), lambda q: 0.009 * q[0], lambda _: np.array([0.009, 0, 0])),
    ]
    rope = {"mass": 0.004, "k1": 2e4, "k2": 5e3, "tau": 0.3, "c": 2.0, "p": 0.7, "viscous": 0.5}
    rubbing = {"mu": 0.15, "mu_static": 0.18, "omega": 0.01, "bristle": 3e4, "coulomb": 0.01, "dry": 5.0}
    held = {"inertia": 2e-5, "damping": 1e-3, "spring": 0.1, "rest": 0.2, "gravity": 0.02, "zero": 0.4}
    return strands, Numbers(**rope, **rubbing, **held, low=-0.5, high=1.2, stop=60.0)


@pytest.mark.parametrize("rows", [6, pytest.param(60, marks=pytest.mark.nightly)])
def test_a_finger_of_three_joints_and_four_tendons_moves_as_an_independent_plant(rows: int) -> None:
    """Motors at 5 to 8 Hz from rest; explicit steps of 4 and 2 us, extrapolated."""
    strands, numbers = by_hand()
    time = 1e-3 * np.arange(rows + 1)
    motors = np.column_stack([a * np.sin(2 * np.pi * f * time) for a, f in ((0.6, 6), (0.5, 8), (0.5, 5))])
    coarse, fine = (respond(strands, numbers, motors, 1e-3, each) for each in (250, 500))
    plant = 2 * fine - coarse
    mechanism = finger()
    page = mechanism_equations(mechanism, Level.PRESLIDING)
    at_zero = {body.name: 0.0 for body in mechanism.bodies}
    start = rest_state(mechanism.cut(Level.PRESLIDING), TENSIONS, at_zero)
    run = tf.integrate(page, start, np.zeros((rows + 1, 3)), 1e-3, places=motors, rtol=1e-8, atol=1e-11).require()
    angles = run.states[:, page.rows("mcp_rad", "pip_rad", "dip_rad")]
    assert np.ptp(plant, axis=0).min() > math.radians(1)
    assert np.abs(angles - plant).max() < math.radians(1e-4)


def test_a_finger_is_a_system_of_python_control_and_its_linearisation() -> None:
    """Matrices against differences of the nonlinear system, at rest, where its tendons stick."""
    mechanism = finger()
    page = mechanism_equations(mechanism, Level.ELASTIC)
    rest = rest_state(mechanism.cut(Level.ELASTIC), TENSIONS, PLACES)
    state = np.concatenate([rest, [PLACES[name] for name in ("m1", "m2", "m3")]])
    system, linear = tf.as_iosystem(page, name="finger"), tf.linear_system(page, state)
    assert linear.input_labels == system.input_labels
    assert linear.output_labels == system.output_labels
    assert system.input_labels[-1] == "m3_rad_per_s"
    force, rng = np.zeros(6), np.random.default_rng(5)
    still = [k for k, name in enumerate(system.state_labels) if not name.endswith("per_s")]
    change = np.zeros(len(state))
    change[still] = 1e-9 * rng.standard_normal(len(still))
    for nonlinear, by_state in ((system.dynamics, linear.A), (system.output, linear.C)):
        up, down = (np.asarray(nonlinear(0.0, state + sign * change, force)) for sign in (1, -1))
        expected = by_state @ change
        assert (up - down) / 2 == pytest.approx(expected, rel=1e-4, abs=1e-5 * np.abs(expected).max())
    with pytest.raises(ParameterError, match=r"state must have .* numbers"):
        tf.linear_system(page, rest)


@pytest.mark.compiler
def test_the_compiled_step_of_a_finger_tends_to_the_page() -> None:
    """At 5 to 8 Hz; sections, a table, a shared drum, stops and dry friction."""
    mechanism, level = finger(), Level.PRESLIDING
    problem = MechanismProblem(
        mechanism=mechanism,
        level=level,
        segments=None,
        driven=3,
        wanted=3,
        motors=3,
        start=np.zeros(6),
        tension_N=np.array(list(TENSIONS.values())),
    )
    time = 1e-3 * np.arange(61)
    motors = np.column_stack([a * np.sin(2 * np.pi * f * time) for a, f in ((0.6, 6), (0.5, 8), (0.5, 5))])
    page = mechanism_equations(mechanism, level)
    start = rest_state(mechanism.cut(level), TENSIONS, {body.name: 0.0 for body in mechanism.bodies})
    run = tf.integrate(page, start, np.zeros((61, 3)), 1e-3, places=motors).require()
    exact = run.states[:, page.rows("mcp_rad", "pip_rad", "dip_rad")]
    errors = []
    for parts in (1, 10, 50):
        inner = np.arange(60 * parts + 1) / parts
        rows = np.column_stack([np.interp(inner, np.arange(61), column) for column in motors.T])
        found = simulate_mechanism(problem, rows, 1e-3 / parts).position[::parts]
        errors.append(float(np.abs(found - exact).max()))
    assert errors[0] > 20 * errors[1] > 20 * 10 * errors[2]
    assert errors[2] < math.radians(0.005)


def test_a_table_of_lengths_goes_on_straight_beyond_its_ends() -> None:
    table, q = finger().tendons[1].far.arms[2], ca.SX.sym("q")
    travel = ca.Function("travel", [q], [table.travel_m(q), ca.gradient(table.travel_m(q), q)])
    inside, edge = (float(travel(at)[0]) for at in (0.1, 0.3))
    assert inside == pytest.approx(6e-3 * 0.6 + 1e-3 * 0.36)
    assert edge == pytest.approx(5.4e-3)
    beyond = [float(travel(at)[0]) for at in (-0.7, 1.5)]
    assert beyond == pytest.approx([-0.2 * 6e-3, 5.4e-3 + 1.2 * 7.6e-3])
    assert [float(travel(at)[1]) for at in (-0.7, 1.5)] == pytest.approx([6e-3, 7.6e-3])


def test_parts_that_do_not_fit_are_refused_by_name() -> None:
    mechanism = finger()
    with pytest.raises(ParameterError, match='bodies need different names, got "mcp" twice'):
        replace(mechanism, bodies=(*mechanism.bodies, mechanism.bodies[0]))
    with pytest.raises(ParameterError, match='tendon "t0" names the body "dip", which is not there; bodies: mcp, pip'):
        replace(mechanism, bodies=(*mechanism.bodies[:2], *mechanism.bodies[3:]))
    with pytest.raises(ParameterError, match='"m1" is led, so nothing else can drive it'):
        replace(mechanism, drives=(*mechanism.drives, Force(body="m1")))
    with pytest.raises(ParameterError, match='inertia of "mcp" must be a finite number > 0, got 0'):
        replace(mechanism.bodies[0], inertia=0.0)
    with pytest.raises(ParameterError, match="low must be below its high, got 1 and 0"):
        Stops(stiffness=60.0, low=1.0, high=0.0)
