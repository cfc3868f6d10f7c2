"""A friction law that the tool does not know, in one file: simulated, inverted, differentiated and exported."""

import ctypes
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Path, Tendon, Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import whole_of
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR, States, equivalent_coefficient
from tendonff.models.tendon.link import TwoTimesLink
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.sensitivity import force_sensitivity
from tendonff.ocp.step.target import chain_code
from tendonff.ocp.tendon.inverse import InverseStatus, invert
from tendonff.ocp.tendon.simulate import simulate

Array = NDArray[np.float64]
STEP = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBristles:
    """Two Dahl bristles in parallel (generalised Maxwell slip): `share` of the coefficient on the stiffer one.

    Its force for f_n = A + f is the root of a cubic, so it leaves the inverse to the guarded Newton iteration.
    """

    states: ClassVar[tuple[str, ...]] = ("f_stiff", "f_soft")

    stiff_N_per_m: ca.SX
    soft_N_per_m: ca.SX
    mu: ca.SX
    share: ca.SX
    viscous_N_s_per_m: ca.SX

    @property
    def slip_coefficients(self) -> tuple[float, float]:
        return self.mu, self.mu

    @property
    def weakening_speed_m_per_s(self) -> float | None:
        return None

    def aliases(self) -> Mapping[str, str]:
        return {}

    def in_section(self, section: Section) -> "TwoBristles":
        return self if section.mu_dynamic is None else replace(self, mu=section.mu_dynamic)

    def on_piece(self, angle_rad: ca.SX, angle_share: ca.SX, length_share: ca.SX) -> "TwoBristles":
        return replace(
            self,
            stiff_N_per_m=self.stiff_N_per_m * angle_share,
            soft_N_per_m=self.soft_N_per_m * angle_share,
            mu=equivalent_coefficient(self.mu, angle_rad),
            viscous_N_s_per_m=self.viscous_N_s_per_m * length_share,
        )

    def _bristles(self) -> tuple[tuple[ca.SX, ca.SX], ...]:
        return (self.stiff_N_per_m, self.share), (self.soft_N_per_m, 1 - self.share)

    def rate(self, v: ca.SX, states: States, f_n: ca.SX) -> States:
        return tuple(
            sigma * (v - f * ca.fabs(v) / (f_n * at_least(share * self.mu, COEFFICIENT_FLOOR)))
            for f, (sigma, share) in zip(states, self._bristles(), strict=True)
        )

    def state_force(self, states: States) -> ca.SX:
        return states[0] + states[1]

    def viscous_force(self, v: ca.SX) -> ca.SX:
        return self.viscous_N_s_per_m * v

    def implicit(self, v: ca.SX, base: States, step_s: ca.SX, f_n: ca.SX) -> States:
        return tuple(
            (f + step_s * sigma * v)
            * f_n
            / (f_n + step_s * sigma * ca.fabs(v) / at_least(share * self.mu, COEFFICIENT_FLOOR))
            for f, (sigma, share) in zip(base, self._bristles(), strict=True)
        )

    def implicit_from_far_side(self, *_known: object) -> None:
        return None

    def far_side_balance(self, *_known: object) -> None:
        return None


def chain_with_two_bristles(rig: Transmission, n: int = 4, **changes: float) -> Chain:
    chain = Chain.of(rig, Level.VISCOELASTIC, n)
    law = TwoBristles(stiff_N_per_m=2e5, soft_N_per_m=1e4, mu=0.2, share=0.6, viscous_N_s_per_m=1.0)
    on_piece = replace(law, **changes).on_piece(rig.path.total_angle_rad / n, 1 / n, 1 / n)
    return replace(chain, elements=replace(chain.elements, friction=on_piece))


def wave(amplitude_N: float) -> Array:
    time = np.arange(0.0, 1.2, STEP)
    return 30 + amplitude_N * np.sin(2 * np.pi * 2 * time) * np.minimum(time / 0.2, 1)


BENT = (
    Section(name="arm", angle_rad=1.2, length_m=0.036),
    Section(name="knuckle", angle_rad=0.9, length_m=0.027, joint="q", angle_per_rad=1.0, length_per_rad_m=0.01),
    Section(name="tip", angle_rad=1.0, length_m=0.03, mu_dynamic=0.15, mu_static=0.15),
)


def bent_chains(rig: Transmission) -> tuple[Chain, Chain]:
    """The paper's law and two equal bristles on a path with a joint, and a section that has its own coefficient."""
    time = np.arange(0.0, 1.2, STEP)
    swing = 0.6 * np.sin(2 * np.pi * 1.1 * time) * np.minimum(time / 0.3, 1)
    rig = replace(
        rig,
        path=Path(total_angle_rad=3.1, segments=6, sections=BENT),
        friction=replace(
            rig.friction, mu_static=0.2, mu_dynamic_release=None, mu_static_release=None, bristle_stiffness_N_per_m=2e5
        ),
        motion=JointMotion(names=("q",), time_s=time, angle_rad=swing[:, None]),
    )
    one, whole = Chain.of(rig, Level.VISCOELASTIC), whole_of(rig, Level.VISCOELASTIC)
    law = TwoBristles(stiff_N_per_m=1e5, soft_N_per_m=1e5, mu=0.2, share=0.5, viscous_N_s_per_m=1.0)
    return one, replace(one, elements=replace(whole, friction=law).divided(one.count, rig.motion))


@pytest.mark.compiler
@pytest.mark.parametrize("engine", [Engine.COMPILED, Engine.CASADI])
def test_on_a_path_with_sections_and_joints_it_is_cut_and_moved_as_the_papers(
    generic: Transmission, engine: Engine
) -> None:
    """Two equal bristles are one of the paper's there too: each mass has its own angle and coefficient."""
    one, two = bent_chains(generic)
    expected, found = (simulate(c, wave(20.0), STEP, engine=engine).require() for c in (one, two))
    assert found.tension_N == pytest.approx(expected.tension_N, abs=1e-9)
    still = simulate(two.at_rest(), wave(20.0), STEP, engine=engine).require()
    assert np.abs(still.tension_N - found.tension_N).max() > 1  # the joint is seen
    forces = [invert(c, wave(12.0), STEP, engine=engine).force_N for c in (one, two)]
    assert forces[1] == pytest.approx(forces[0], abs=1e-8)


def test_two_equal_bristles_are_one_of_the_papers(generic: Transmission) -> None:
    """Half the stiffness and half the coefficient each: Dahl's law is linear in both together."""
    friction = replace(
        generic.friction, mu_static=0.2, mu_dynamic_release=0.2, mu_static_release=0.2, bristle_stiffness_N_per_m=2e5
    )
    one = Chain.of(replace(generic, friction=friction), Level.VISCOELASTIC, 4)
    two = chain_with_two_bristles(generic, stiff_N_per_m=1e5, soft_N_per_m=1e5, share=0.5)
    expected, found = (simulate(c, wave(20.0), STEP).require() for c in (one, two))
    assert found.tension_N == pytest.approx(expected.tension_N, abs=1e-9)
    assert np.ptp(expected.output_tension_N) > 10
    forces = [invert(c, wave(12.0), STEP).force_N for c in (one, two)]
    assert forces[1] == pytest.approx(forces[0], abs=1e-8)


@pytest.mark.compiler
def test_both_engines_simulate_and_invert_it_alike(generic: Transmission) -> None:
    chain = chain_with_two_bristles(generic)
    engines = (Engine.COMPILED, Engine.CASADI)
    runs = [simulate(chain, wave(20.0), STEP, record=True, engine=engine).require() for engine in engines]
    assert runs[0].states is not None
    assert runs[0].states.shape[1] == chain.layout.size == (4 + 2) + 2 * (4 + 1) + 2 * 4 + 2
    assert np.abs(runs[0].tension_N - runs[1].tension_N).max() < 1e-9
    forces = [invert(chain, wave(12.0), STEP, engine=engine).force_N for engine in engines]
    assert np.abs(forces[0] - forces[1]).max() < 1e-8


def test_its_inverse_gives_its_reference_back(generic: Transmission) -> None:
    chain, reference = chain_with_two_bristles(generic), wave(12.0)
    inversion = invert(chain, reference, STEP)
    assert inversion.status is InverseStatus.EXACT
    answer = simulate(chain, inversion.force_N, STEP, initial_tension_N=30.0).require().output_tension_N
    assert np.abs(answer - reference).max() < 1e-6
    assert np.abs(inversion.force_N - reference).max() > 5  # friction was there


def test_its_sensitivity_is_the_slope_of_central_differences(generic: Transmission) -> None:
    chain, force, rows = chain_with_two_bristles(generic), wave(20.0)[:300], np.array([0, 100, 200, 299])
    found = force_sensitivity(chain, force, STEP, rows, state=chain.rest_state(30.0)).tension_slopes[:, 0, 2]
    hat = np.interp(np.arange(300), rows, [0.0, 0.0, 1.0, 0.0])
    runs = [simulate(chain, force + s * 1e-5 * hat, STEP).require().output_tension_N for s in (1, -1)]
    slope = (runs[0] - runs[1]) / 2e-5
    assert np.quantile(np.abs(found - slope), 0.98) < 1e-4 * np.abs(slope).max()


@pytest.mark.compiler
def test_it_is_exported_as_c(generic: Transmission, tmp_path: pathlib.Path) -> None:
    """The inverse in C gives the forces of the Python inverse; the plant in C its tensions."""
    chain, reference = chain_with_two_bristles(generic), wave(12.0)
    code = chain_code(chain, STEP, "tff", Precision.DOUBLE, forward=chain)
    assert code.inverse is not None
    assert code.plant is not None
    parts = ["#include <math.h>\n", *(f"#define TFF_{name}_COUNT {chain.count}\n" for name in ("STATE", "CHAIN"))]
    inputs = ", ".join(code.plant.inputs)
    parts += [
        code.record,
        code.values,
        code.links,
        code.solver,
        f"typedef struct {{ double {inputs}; int led; }} tff_chain_input;",
    ]
    parts += [text for scheme in (code.inverse, code.plant) for text in (scheme.header, scheme.laws, scheme.body)]
    parts.append(f"void start(double tension, double *x) {{ int j;\n{code.rest}\n}}\n")
    given = "".join(f"{chain.numbers()[name]!r}, " for name in code.inverse.free)
    parts.append(
        f"""
        double run_inverse(double reference, int fresh, double *x, double *x_old) {{
            double least;
            return tff_inverse_invert_step(tff_rows, reference, fresh, {given}x, x_old, &least);
        }}
        double run_plant(double force, int fresh, double *x, double *x_old) {{
            tff_chain_work w;
            tff_chain_report r = {{ .most = 60 }};
            const tff_chain_input u = {{ force, 0.0, 0 }};
            tff_chain_step(tff_rows, &u, fresh, x, x_old, &w, &r);
            return r.converged ? w.force[TFF_CHAIN_COUNT] : -1.0;
        }}
        """
    )
    library = load_library("\n".join(parts))
    library.run_inverse.restype = library.run_plant.restype = ctypes.c_double
    expected = invert(chain, reference, STEP).force_N
    answer = simulate(chain, expected, STEP, initial_tension_N=30.0).require().output_tension_N
    states = {name: np.empty(chain.layout.size) for name in ("inv", "plant")}
    for x in states.values():
        library.start(ctypes.c_double(30.0), ctypes.c_void_p(x.ctypes.data))
        assert x == pytest.approx(chain.rest_state(30.0).vector(), abs=1e-15)
    old = {name: x.copy() for name, x in states.items()}
    places = {name: [ctypes.c_void_p(a[name].ctypes.data) for a in (states, old)] for name in states}
    for k in range(1, len(reference)):
        force = library.run_inverse(ctypes.c_double(reference[k]), ctypes.c_int(k == 1), *places["inv"])
        assert force == pytest.approx(expected[k], abs=1e-9)
        tension = library.run_plant(ctypes.c_double(expected[k]), ctypes.c_int(k == 1), *places["plant"])
        assert tension == pytest.approx(answer[k], abs=1e-8)


TWO_TIMES = Tendon(
    mass_kg=0.01,
    stiffness_N_per_m=2e4,
    relaxing_stiffness_N_per_m=6e3,
    relaxation_time_s=0.1,
    damping_N_s_per_m=30.0,
    second_relaxing_stiffness_N_per_m=3e3,
    second_relaxation_time_s=0.8,
)


@pytest.mark.compiler
def test_a_tendon_with_two_relaxation_times_is_simulated_alike_by_both_engines_and_inverted_exactly(
    generic: Transmission,
) -> None:
    chain = Chain.of(replace(generic, tendon=TWO_TIMES), Level.PRESLIDING)
    assert isinstance(chain.link, TwoTimesLink)
    time = np.arange(0.0, 1.0, STEP)
    reference = 30 + 12 * np.sin(7 * time) * np.minimum(time / 0.3, 1)
    answer = invert(chain, reference, STEP)
    assert answer.status is InverseStatus.EXACT
    runs = [simulate(chain, answer.force_N, STEP, engine=engine) for engine in (Engine.COMPILED, Engine.CASADI)]
    assert runs[0].tension_N == pytest.approx(runs[1].tension_N, abs=1e-9)
    assert runs[0].output_tension_N == pytest.approx(reference, abs=1e-8)
    one = Chain.of(replace(generic, tendon=replace(TWO_TIMES, **NO_SECOND)), Level.PRESLIDING)
    assert np.abs(invert(one, reference, STEP).force_N - answer.force_N).max() > 0.01  # the second branch is seen


NO_SECOND = {"second_relaxing_stiffness_N_per_m": None, "second_relaxation_time_s": None}


def test_levels_without_relaxation_and_tendons_with_one_time_carry_no_further_state(generic: Transmission) -> None:
    with_two = replace(generic, tendon=TWO_TIMES)
    assert Chain.of(with_two, Level.ELASTIC).layout.link_states == ("z",)
    assert Chain.of(generic, Level.PRESLIDING).layout.link_states == ("z",)
    assert Chain.of(with_two, Level.VISCOELASTIC).layout.link_states == ("z", "z_second")
