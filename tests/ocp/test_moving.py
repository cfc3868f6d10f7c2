"""Paths that move: inverse, engines, slopes, and a plant of another make."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.friction import LuGreBristle
from tendonff.models.parameters import Path, Transmission
from tendonff.models.path import JointMotion
from tendonff.models.section import Section
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.inverse import InverseStatus, invert
from tendonff.ocp.sensitivity import force_sensitivity
from tendonff.ocp.simulate import simulate

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
        assert np.all(np.abs(force) <= np.tanh(0.13 * angle[:, k]) * normal[:, k] * (1 + 1e-9) + 1e-9) or k > 0
        work += STEP * force * speed[:, k]
        least = np.minimum(least, work)
    assert least.min() > -1e-12
    assert work.max() > 0.01


def other_plant(rig: Transmission, force_N: Array, step_s: float, count: int) -> Array:
    """Output tension of `count` masses in each section that touches, by implicit Euler and Newton in numpy.

    Written for this test alone: sections by hand, equal pieces, no code of the tool.
    """
    tendon, friction, motion = rig.tendon, rig.friction, rig.motion
    assert motion is not None
    touching = [k for k, section in enumerate(SECTIONS) if section.angle_rad > 0]
    n, size = count * len(touching), len(touching)
    mu = np.repeat([SECTIONS[k].mu_dynamic or friction.mu_dynamic for k in touching], count)
    total = sum(section.length_m or 0.0 for section in SECTIONS)
    theta0 = sum(section.angle_rad for section in SECTIONS)

    def geometry(q: float) -> tuple[Array, Array]:
        """Angles of the pieces, and positions of the middles along the path with both ends."""
        angles, places, at = [], [0.0], 0.0
        for k, section in enumerate(SECTIONS):
            length = (section.length_m or 0.0) + section.length_per_rad_m * q
            if k in touching:
                angles += [(section.angle_rad + section.angle_per_rad * q) / count] * count
                places += [at + length * (j + 0.5) / count for j in range(count)]
            at += length
        return np.array(angles), np.array([*places, at])

    share = np.repeat([(SECTIONS[k].length_m or 0.0) for k in touching], count) / count
    share = share / share.sum()
    mass = np.concatenate([[rig.actuator.mass_kg], tendon.mass_kg * share, [rig.load.mass_kg]])
    viscous = np.concatenate([[rig.actuator.damping_N_s_per_m], friction.viscous_N_s_per_m * share, [0.0]])
    viscous[-1] = rig.load.damping_N_s_per_m
    times = np.arange(len(force_N)) * step_s
    q = np.interp(times, motion.time_s, motion.angle_rad[:, 0])
    angle, places = geometry(q[0])
    length = np.diff(places)
    e = force_N[0] * length / total / tendon.stiffness_N_per_m
    z, f_s, v = e.copy(), np.zeros(n), np.zeros(n + 2)
    far = force_N[0] / rig.load.stiffness_N_per_m
    h, tau, output = step_s, tendon.relaxation_time_s, [force_N[0]]
    assert size == 3
    for row in range(1, len(force_N)):
        before, gone = angle, length
        angle, places = geometry(q[row])
        length = np.diff(places)
        stiff, soft, damp = (
            k * total / length
            for k in (tendon.stiffness_N_per_m, tendon.relaxing_stiffness_N_per_m, tendon.damping_N_s_per_m)
        )
        sigma = friction.soft_bristle_stiffness_N_per_m * angle / theta0
        limit = np.tanh(mu * angle / 2)
        old = f_s * np.minimum(angle / before, 1.0)
        drift = (length - gone) / h

        def balance(
            v: Array,
            v_old: Array = v,
            e_old: Array = e,
            z_old: Array = z,
            far_old: float = far,
            drift: Array = drift,
            stiff: Array = stiff,
            soft: Array = soft,
            damp: Array = damp,
            sigma: Array = sigma,
            limit: Array = limit,
            old: Array = old,
            row: int = row,
        ) -> tuple[Array, Array, tuple[Array, Array, Array, Array, float]]:
            rate = v[:-1] - v[1:] + drift
            e_new = e_old + h * rate
            z_new = (z_old + h / tau * e_new) / (1 + h / tau)
            free = stiff * e_new + soft * (e_new - z_new) + damp * rate
            f = np.maximum(free, 0.0)
            slope = (free > 0) * (stiff * h + soft * h / (1 + h / tau) + damp)
            f_n, inside = f[:-1] + f[1:], v[1:-1]
            push, drag = old + h * sigma * inside, h * sigma * np.abs(inside) / limit
            bristle = push * f_n / (f_n + drag)
            by_v = (h * sigma * f_n - push * f_n / (f_n + drag) * h * sigma * np.sign(inside) / limit) / (f_n + drag)
            by_n = push * drag / (f_n + drag) ** 2
            far_new = far_old + h * v[-1]
            sums = -viscous * v
            sums[0] += force_N[row] - f[0]
            sums[-1] += f[-1] - rig.load.stiffness_N_per_m * far_new
            sums[1:-1] += f[:-1] - f[1:] - bristle
            band = np.zeros((3, len(v)))
            band[1] = mass / h + viscous
            band[1, 0] += slope[0]
            band[1, -1] += slope[-1] + rig.load.stiffness_N_per_m * h
            band[1, 1:-1] += by_v + slope[:-1] * (1 - by_n) + slope[1:] * (1 + by_n)
            band[0, 1] = -slope[0]
            band[0, 2:] = -slope[1:] * (1 + by_n)
            band[2, :-2] = -slope[:-1] * (1 - by_n)
            band[2, -2] = -slope[-1]
            return mass / h * (v - v_old) - sums, band, (e_new, z_new, bristle, f, far_new)

        residual, band, state = balance(v)
        for _ in range(60):
            size_now = np.abs(residual).max()
            if size_now < 1e-9:
                break
            move, t = solve_banded((1, 1), band, -residual), 1.0
            while t > 1e-6:
                trial = balance(v + t * move)
                if np.abs(trial[0]).max() < size_now:
                    break
                t /= 2
            v = v + t * move
            residual, band, state = trial
        e, z, f_s, f, far = state
        output.append(f[-1])
    return np.array(output)


@pytest.mark.slow
def test_blind_on_another_plant_the_inverse_follows_and_a_design_at_rest_does_not(
    finger: Transmission, record_property: pytest.FixtureRequest
) -> None:
    """60 masses, another implementation, scheme and step; segments = 24."""
    chain = Chain.of(finger, Level.PRESLIDING, 24)
    parts = 2
    fine = np.arange((len(TIME) - 1) * parts + 1) / parts
    wanted, errors = REFERENCE, {}
    for name, design in (("moving", chain), ("at rest", chain.at_rest())):
        force = invert(design, REFERENCE, STEP).force_N
        played = other_plant(finger, np.interp(fine, np.arange(len(TIME)), force), STEP / parts, 20)[::parts]
        errors[name] = 100 * np.sqrt(np.mean((played - wanted) ** 2)) / np.ptp(wanted)
    record_property(
        "figure",
        f"moving path, blind on 60 masses: {errors['moving']:.2f} % of range, at rest {errors['at rest']:.0f} %",
    )  # type: ignore[operator]
    assert errors["moving"] < 0.4
    assert errors["at rest"] > 20
