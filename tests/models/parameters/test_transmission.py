import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs, ChainState, StateLayout
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import whole_of

OTHER_RULES = (
    "second_relaxing_stiffness_N_per_m",
    "stiffening",
    "stiffening_tension_N",
    "second_relaxation_time_s",
    "segments",
    "sections",
    "joint",
    "moment_arm_m",
    "motor",
    "drive",
    "travel_min_m",
    "travel_max_m",
    "servo_stiffness_N_per_m",
    "command_hold",
    "drive_class",
    "backlash_m",
)
PARTS = ("path", "tendon", "friction", "actuator", "load")


def changed(transmission: Transmission, part: str, **values: Any) -> Transmission:
    return replace(transmission, **{part: replace(getattr(transmission, part), **values)})


def test_every_number_is_refused_by_name_when_negative_or_nan(generic: Transmission) -> None:
    seen = 0
    for part in PARTS:
        for field in fields(getattr(generic, part)):
            for bad in (-1.0, math.nan, math.inf):
                if field.name in OTHER_RULES:
                    continue
                with pytest.raises(ParameterError, match=f"{field.name} must be .*got {bad}"):
                    changed(generic, part, **{field.name: bad})
                seen += 1
    assert seen == 3 * 35


def test_a_number_too_large_for_any_transmission_is_refused_instead_of_overflowing(generic: Transmission) -> None:
    with pytest.raises(ParameterError, match=r"mass_kg must be at most 1e\+15, got 1e\+300; check its unit"):
        changed(generic, "tendon", mass_kg=1e300)
    with pytest.raises(ParameterError, match=r"adhesion_N must be at most 1e\+15"):
        changed(generic, "friction", adhesion_N=2e15)


@pytest.mark.parametrize("bad", [0, -3, 2.5, 10_001])
def test_segments_are_a_whole_number_in_range(generic: Transmission, bad: float) -> None:
    with pytest.raises(ParameterError, match=f"segments must be a whole number from 1 to 10000, got {bad}"):
        changed(generic, "path", segments=bad)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"mu_static": 0.1}, "mu_dynamic = 0.2 is above mu_static = 0.1: change both, or delete mu_static"),
        ({"mu_static_release": 0.1}, "mu_dynamic_release = 0.15 is above mu_static_release = 0.1: change both"),
    ],
)
def test_static_friction_is_not_below_dynamic(generic: Transmission, values: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        changed(generic, "friction", **values)


def test_left_out_release_coefficients_follow_pulling(generic: Transmission) -> None:
    friction = replace(generic.friction, mu_dynamic_release=None, mu_static_release=None)
    assert (friction.release_dynamic, friction.release_static) == (0.2, pytest.approx(0.23))
    friction = replace(friction, mu_dynamic_release=0.1)
    assert friction.release_static == pytest.approx(0.23 * 0.1 / 0.2)
    for mu in (0.2, 0.35, 0.7):  # equal when pulling: equal to the last bit when releasing, or it counts as Stribeck
        for release in (None, 0.1, 0.3):
            even = replace(friction, mu_dynamic=mu, mu_static=mu, mu_dynamic_release=release)
            assert even.release_static == even.release_dynamic
    frictionless = replace(friction, mu_dynamic=0.0, mu_static=0.05, mu_dynamic_release=0.02)
    assert frictionless.release_static == 0.05


@pytest.mark.parametrize("n", [1, 6, 40])
def test_the_parts_add_up_to_the_whole(generic: Transmission, n: int) -> None:
    """Masses, bristles and viscous friction in parallel, links in series."""
    e = whole_of(generic, Level.VISCOELASTIC).divided(n)
    friction, link = e.friction, e.link
    assert n * e.piece.mass_kg == pytest.approx(0.002)
    assert n * friction.viscous_N_s_per_m == pytest.approx(1.0)
    assert n * friction.bristle_stiffness_N_per_m == pytest.approx(1e6)
    links = [link.shortened(ratio) for ratio in e.ratio]  # half as long at the ends
    assert e.ratio == pytest.approx([2 * n, *[n] * (n - 1), 2 * n])
    assert 1 / sum(1 / one.stiffness_N_per_m for one in links) == pytest.approx(2e4)
    assert 1 / sum(1 / one.relaxing_stiffness_N_per_m for one in links) == pytest.approx(6e3)
    assert 1 / sum(1 / one.damping_N_s_per_m for one in links) == pytest.approx(2.0)
    pairs = [
        (friction.mu_dynamic_pull, 0.2),
        (friction.mu_static_pull, 0.23),
        (friction.mu_dynamic_release, 0.15),
        (friction.mu_static_release, 0.18),
    ]
    for equivalent, mu in pairs:
        assert equivalent == pytest.approx(math.tanh(mu * 3.1 / n / 2))
    assert (e.piece.adhesion_N, link.relaxation_time_s, friction.stribeck_velocity_m_per_s) == (0.5, 0.4, 0.005)


def test_a_level_chooses_link_and_bristle(generic: Transmission) -> None:
    elastic, viscoelastic, presliding = (whole_of(generic, level) for level in Level)
    assert (elastic.link.relaxing_stiffness_N_per_m, elastic.friction.bristle_stiffness_N_per_m) == (0.0, 1e6)
    assert viscoelastic == elastic.changed({"relaxing_stiffness_N_per_m": 6e3})
    assert presliding == viscoelastic.changed({"bristle_stiffness_N_per_m": 2e4})


@pytest.mark.parametrize("n", [1, 5])
def test_the_start_is_an_equilibrium(generic: Transmission, n: int) -> None:
    import casadi as ca

    chain = Chain.of(generic, Level.PRESLIDING, n)
    equations = chain_equations(chain)
    rate = ca.Function("rate", [equations.state, equations.inputs], [equations.rate, equations.tension_N])
    state = chain.rest_state(30.0, far_rest_position_m=0.01)
    x_dot, tension = rate(state.vector(), [30.0, 0.0, 0.0, 0.01])
    assert np.abs(np.asarray(x_dot)).max() < 1e-9
    assert np.asarray(tension).ravel() == pytest.approx(np.full(n + 1, 30.0))
    assert state.near_position_m - state.far_position_m == pytest.approx(state.elongation_m.sum())


def test_a_state_survives_its_vector() -> None:
    x = np.arange(4 * 3 + 6, dtype=np.float64)
    state = ChainState.from_vector(x, StateLayout(count=3, link_states=("z",), friction_states=("f_s",)))
    assert state.vector() == pytest.approx(x)
    assert state.friction[0] == pytest.approx([13.0, 14.0, 15.0])


def test_a_layout_gives_every_state_of_every_law_its_place() -> None:
    """Two states a link, three a mass: blocks follow one another, as offsets, slices and names."""
    layout = StateLayout(count=2, link_states=("z", "y"), friction_states=("f_s", "a", "b"))
    assert layout.size == (2 + 2) + 3 * (2 + 1) + 3 * 2 + 2 == len(layout.names)
    assert layout.cuts == (0, 4, 7, 10, 13, 15, 17, 19, 20, 21)
    for name, first in (("v", "v_a"), ("e", "e_1"), ("y", "y_1"), ("f_s", "f_s_1"), ("b", "b_1"), ("q_l", "q_l")):
        per_mass, more = layout.offset(name)
        assert layout.names[2 * per_mass + more] == first
        assert layout.part(name).start == 2 * per_mass + more
    state = ChainState.from_vector(np.arange(21.0), layout)
    assert state.link.tolist() == [[7, 8, 9], [10, 11, 12]]
    assert state.friction.tolist() == [[13, 14], [15, 16], [17, 18]]
    assert state.vector().tolist() == list(range(21))


def test_inputs_are_named_sliced_and_joined() -> None:
    inputs = ChainInputs.of(3, near_force_N=np.arange(3.0), far_rest_m=7.0)
    assert inputs[:1].table(inputs[1:]).tolist() == [[1, 0, 0, 7], [2, 0, 0, 7], [0, 0, 0, 7]]
    with pytest.raises(TypeError, match="ChainInputs has no field speed"):
        ChainInputs.of(3, speed=1.0)


def test_a_chain_is_symmetric_in_its_ends(generic: Transmission) -> None:
    """Seen from the other end, positions and velocities change sign, tensions do not."""
    import casadi as ca

    def mirrored(x: np.ndarray, n: int) -> np.ndarray:
        s = ChainState.from_vector(x, chain.layout)
        return ChainState(
            velocity_m_per_s=-s.velocity_m_per_s[::-1],
            elongation_m=s.elongation_m[::-1],
            link=s.link[:, ::-1],
            friction=-s.friction[:, ::-1],
            near_position_m=-s.far_position_m,
            far_position_m=-s.near_position_m,
        ).vector()

    n = 4
    same = changed(generic, "friction", mu_dynamic_release=None, mu_static_release=None)
    chain = Chain.of(same, Level.VISCOELASTIC, n).with_end_stiffness(700.0, 3000.0)
    turned = replace(chain, near=chain.far, far=chain.near)
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.normal(0, 0.01, n + 2), rng.uniform(1e-4, 5e-4, 2 * n + 2), rng.normal(0, 1, n + 2)])
    results = []
    for c, state, u in ((chain, x, [20.0, 0.1, 7.0, 0.2]), (turned, mirrored(x, n), [7.0, -0.2, 20.0, -0.1])):
        equations = chain_equations(c)
        rate = ca.Function("rate", [equations.state, equations.inputs], [equations.rate])
        results.append(np.asarray(rate(state, u)).ravel())
    assert mirrored(results[1], n) == pytest.approx(results[0], rel=1e-9, abs=1e-9)


def test_a_position_drive_needs_its_stiffness_and_a_force_drive_has_none(generic: Transmission) -> None:
    with pytest.raises(ParameterError, match=r'drive = "position" needs servo_stiffness_N_per_m'):
        changed(generic, "actuator", drive=Drive.POSITION)
    with pytest.raises(ParameterError, match=r'servo_stiffness_N_per_m is for drive = "position"'):
        changed(generic, "actuator", servo_stiffness_N_per_m=1e5)
    with pytest.raises(ParameterError, match="servo_stiffness_N_per_m must be a finite number > 0, got 0"):
        changed(generic, "actuator", drive=Drive.POSITION, servo_stiffness_N_per_m=0.0)


@pytest.mark.parametrize(("key", "bad"), [("travel_min_m", 0.01), ("travel_max_m", -0.01), ("travel_max_m", math.inf)])
def test_a_travel_that_excludes_the_start_is_refused(generic: Transmission, key: str, bad: float) -> None:
    with pytest.raises(
        ParameterError, match=f"{key} must be a finite number .* 0, got {bad}; it counts from the start"
    ):
        changed(generic, "actuator", **{key: bad})
