"""Paths that move: inverse, engines, slopes."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.adaptive import ADAPTIVE, check_adaptive
from benchmarks.moving import balance, convergence, random_cycle
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Path, Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import LuGreBristle
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.sensitivity import force_sensitivity
from tendonff.ocp.tendon.inverse import InverseStatus, invert
from tendonff.ocp.tendon.simulate import simulate

Array = NDArray[np.float64]
STEP = 1e-3
TIME = np.arange(0.0, 2.0, STEP)
REFERENCE = 30 + np.minimum(TIME / 0.5, 1) * (12 * np.sin(2 * np.pi * 0.9 * TIME) + 4 * np.sin(2 * np.pi * 2.1 * TIME))
SECTIONS = (
    Section(name="arm", angle_rad=1.2, length_m=0.036),
    Section(name="knuckle", angle_rad=0.9, length_m=0.027, joint="q", angle_per_rad=1.0, length_per_rad_m=0.01),
    Section(name="bone", angle_rad=0.0, length_m=0.03),
    Section(name="tip", angle_rad=0.6, length_m=0.018, mu_dynamic=0.15, mu_static=0.15),
)


def bending(swing_rad: float) -> JointMotion:
    angle = swing_rad * np.sin(2 * np.pi * 0.7 * TIME) * np.minimum(TIME / 0.3, 1)
    return JointMotion(names=("q",), time_s=TIME, angle_rad=angle[:, None])


@pytest.fixture
def finger(generic: Transmission) -> Transmission:
    plain = replace(generic.friction, mu_static=0.2, mu_dynamic_release=None, mu_static_release=None, adhesion_N=0.0)
    path = Path(total_angle_rad=2.7, segments=8, sections=SECTIONS)
    return replace(generic, path=path, friction=plain, motion=bending(0.6))


def with_far_joint(finger: Transmission) -> Transmission:
    return replace(finger, load=replace(finger.load, joint="q", moment_arm_m=0.01))


@pytest.mark.each_value
@pytest.mark.compiler
@pytest.mark.parametrize("level", [Level.VISCOELASTIC, Level.PRESLIDING])
@pytest.mark.parametrize("swing_rad", [0.6, 1.2])  # the second straightens the section and bends it again
@pytest.mark.parametrize("far", [False, True])
def test_inverse_then_forward_gives_the_reference_back(
    finger: Transmission, level: Level, swing_rad: float, far: bool
) -> None:
    rig = replace(with_far_joint(finger) if far else finger, motion=bending(swing_rad))
    chain = Chain.of(rig, level)
    runs = []
    for engine in (Engine.COMPILED, Engine.CASADI):
        inversion = invert(chain, REFERENCE, STEP, engine=engine)
        run = simulate(chain, inversion.force_N, STEP, initial_tension_N=30.0, engine=engine).require()
        if inversion.status is InverseStatus.EXACT:
            assert np.abs(run.output_tension_N - REFERENCE).max() < 1e-6
        runs.append((inversion.force_N, run.tension_N))
    assert np.abs(runs[0][0] - runs[1][0]).max() < 1e-9
    assert np.abs(runs[0][1] - runs[1][1]).max() < 1e-9
    assert np.ptp(runs[0][0] - REFERENCE) > 10  # what friction and motion ask for


def test_a_joint_that_stands_still_is_the_fixed_path(finger: Transmission, generic: Transmission) -> None:
    still = replace(finger, motion=bending(0.6).held(np.zeros(1)))
    fixed = replace(finger, motion=None)
    forces = [invert(Chain.of(rig, Level.PRESLIDING), REFERENCE, STEP).force_N for rig in (still, fixed)]
    assert np.abs(forces[0] - forces[1]).max() < 1e-9


@pytest.mark.parametrize("level", [Level.VISCOELASTIC, Level.PRESLIDING])
def test_a_section_that_is_cut_in_two_changes_nothing(generic: Transmission, level: Level) -> None:
    """Also against one arc of the whole angle."""
    half = Section(name="a", angle_rad=1.55, length_m=0.05)
    rigs = [
        generic,
        replace(generic, path=replace(generic.path, sections=(Section(name="w", angle_rad=3.1, length_m=0.1),))),
        replace(generic, path=replace(generic.path, sections=(half, replace(half, name="b")))),
    ]
    force = 30 + 20 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.2, 1)
    runs = [simulate(Chain.of(rig, level), force, STEP).require().tension_N for rig in rigs]
    assert np.abs(runs[1] - runs[0]).max() < 1e-9
    assert np.abs(runs[2] - runs[0]).max() < 1e-9


@pytest.mark.parametrize("level", [Level.VISCOELASTIC, Level.PRESLIDING])
def test_a_moving_section_that_is_cut_in_two_changes_nothing(finger: Transmission, level: Level) -> None:
    knuckle = SECTIONS[1]
    half = replace(knuckle, angle_rad=0.45, length_m=0.0135, angle_per_rad=0.5, length_per_rad_m=0.005)
    halves = (SECTIONS[0], replace(half, name="k1"), replace(half, name="k2"), *SECTIONS[2:])
    rigs = [replace(finger, path=replace(finger.path, sections=each, segments=18)) for each in (SECTIONS, halves)]
    chains = [Chain.of(rig, level) for rig in rigs]
    counts = [np.bincount(chain.elements.path.section_of) for chain in chains]
    assert counts[0][1] == counts[1][1] + counts[1][2]
    runs = [simulate(chain, REFERENCE, STEP).require().tension_N for chain in chains]
    assert np.abs(runs[1] - runs[0]).max() < 1e-9


@pytest.mark.each_value
@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("swing_rad", [0.6, 1.2])  # the second loses contact
def test_adaptive_integrators_agree_on_a_moving_path(
    finger: Transmission, method: Method, far: bool, swing_rad: float
) -> None:
    """Within 0.1 % of range rms; the joint starts without a jump of its speed."""
    rise = np.minimum(TIME / 0.3, 1)
    angle = swing_rad * np.sin(2 * np.pi * 0.7 * TIME) * rise**2 * (3 - 2 * rise)
    rig = replace(finger, motion=JointMotion(names=("q",), time_s=TIME, angle_rad=angle[:, None]))
    chain = Chain.of(with_far_joint(rig) if far else rig, Level.PRESLIDING, 6)
    force = 30 + 15 * np.sin(2 * np.pi * TIME[:800]) * np.minimum(TIME[:800] / 0.2, 1)
    found = check_adaptive(chain, force, STEP, initial_tension_N=30.0, method=method)
    assert found.reproducible
    assert 0 < found.rms_N < 1e-3 * found.range_N


@pytest.mark.compiler
def test_whole_chains_give_no_energy_over_closed_cycles_of_joints_and_force() -> None:
    """What came in and is not stored never shrinks: random paths, half of which lose contact and touch again."""
    found = [balance(random_cycle(seed)) for seed in range(36)]
    assert min(each.least_tension_N for each in found) > 0
    assert sum(each.lost_contact for each in found) > 12
    assert max(each.fall for each in found) < 1e-9
    assert min(each.dissipated_J[-1] / each.exchanged_J for each in found) > 1e-3


@pytest.mark.compiler
def test_more_masses_converge_with_at_least_the_order_one_and_a_half() -> None:
    for seed in (1, 10):
        errors = convergence(random_cycle(seed).rig, (5, 10, 20), 160)
        assert -np.polyfit(np.log([5, 10, 20]), np.log(errors), 1)[0] > 1.5


@pytest.mark.compiler
@pytest.mark.parametrize("far", [False, True])
def test_slopes_on_a_moving_path_are_those_of_central_differences(finger: Transmission, far: bool) -> None:
    chain = Chain.of(with_far_joint(finger) if far else finger, Level.PRESLIDING)
    force, rows, start = (
        invert(chain, REFERENCE, STEP).force_N[:500],
        np.array([0, 100, 250, 499]),
        chain.rest_state(30.0),
    )
    slopes = [
        force_sensitivity(chain, force, STEP, rows, state=start, engine=engine).tension_slopes[:, 0, 1]
        for engine in (Engine.COMPILED, Engine.CASADI)
    ]
    assert slopes[0] == pytest.approx(slopes[1], abs=1e-9)
    hat = np.interp(np.arange(500), rows, [0.0, 1.0, 0.0, 0.0])
    runs = [simulate(chain, force + s * 1e-5 * hat, STEP, state=start).require().output_tension_N for s in (1, -1)]
    central = (runs[0] - runs[1]) / 2e-5
    assert np.quantile(np.abs(slopes[0] - central), 0.98) < 1e-4 * np.abs(central).max()


def test_a_run_can_be_taken_up_where_the_path_is(finger: Transmission) -> None:
    chain = Chain.of(finger, Level.PRESLIDING)
    force = invert(chain, REFERENCE, STEP).force_N
    whole, half = (simulate(chain, force[:rows], STEP, initial_tension_N=30.0) for rows in (1200, 601))
    assert half.final.time_s == pytest.approx(0.6)
    rest = simulate(chain, force[600:1200], STEP, state=half.final).require()  # its first step is of first order
    assert rest.output_tension_N == pytest.approx(whole.output_tension_N[600:], abs=0.02)


def test_contact_never_gives_energy() -> None:
    """1000 random courses of speed, normal force and wrap angle, which vanishes and returns: work >= 0 from rest."""
    whole = LuGreBristle(
        bristle_stiffness_N_per_m=2e4,
        mu_dynamic_pull=0.2,
        mu_static_pull=0.26,
        mu_dynamic_release=0.15,
        mu_static_release=0.2,
        stribeck_velocity_m_per_s=0.005,
        viscous_N_s_per_m=0.0,
    )
    f_s, v, f_n, old, now = symbols = [ca.SX.sym(name) for name in ("f_s", "v", "f_n", "old", "now")]
    kept = ca.if_else(now < old, now / old, 1)
    (after,) = whole.on_piece(now, now / 0.9, 1).implicit(v, (kept * f_s,), STEP, f_n)
    step = ca.Function("step", symbols, [after])
    rng, steps, courses = np.random.default_rng(7), 400, 1000
    phase = rng.uniform(0, 2 * np.pi, (3, courses, 1))
    t = np.arange(steps) * STEP * rng.uniform(2.0, 60.0, (courses, 1))
    speed = 0.02 * np.sin(t + phase[0]) * rng.uniform(0.05, 1.0, (courses, 1))
    normal = 40 + 39 * np.sin(1.7 * t + phase[1])
    angle = np.maximum(0.5 + 1.2 * np.sin(0.6 * t + phase[2]), 0.0)
    assert (angle == 0).any(axis=1).mean() > 0.2
    force, work, least = np.zeros(courses), np.zeros(courses), np.zeros(courses)
    mapped = step.map(courses)
    for k in range(1, steps):
        arguments = (force, speed[:, k], normal[:, k], angle[:, k - 1], angle[:, k])
        force = np.asarray(mapped(*(a[None, :] for a in arguments))).ravel()
        work += STEP * force * speed[:, k]
        least = np.minimum(least, work)
    assert least.min() > -1e-12
    assert work.max() > 0.01
