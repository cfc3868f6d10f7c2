"""A tendon whose stiffness grows with its tension: the inverse is exact on its own chain, by either engine."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.target import require_linear
from tendonff.ocp.tendon.inverse import InverseStatus, invert
from tendonff.ocp.tendon.simulate import at_rest, simulate

STEP = 1e-3
TIME = np.arange(0.0, 1.0, STEP)
WANTED = 30 + np.minimum(TIME / 0.5, 1) * (12 * np.sin(np.pi * TIME) + 5 * np.sin(2.6 * np.pi * TIME))


def stiffening(generic: Transmission, share: float) -> Transmission:
    tendon = replace(generic.tendon, stiffening=share, stiffening_tension_N=20.0)
    return replace(generic, tendon=tendon)


@pytest.mark.parametrize("level", [Level.ELASTIC, Level.PRESLIDING])
@pytest.mark.parametrize("engine", [Engine.CASADI, pytest.param(Engine.COMPILED, marks=pytest.mark.compiler)])
def test_the_force_gives_the_reference_back(generic: Transmission, level: Level, engine: Engine) -> None:
    rig = replace(generic, friction=replace(generic.friction, mu_static=0.2, mu_static_release=0.15))
    chain = Chain.of(stiffening(rig, 0.4), level, 4)
    inversion = invert(chain, WANTED, STEP, engine=engine)
    assert inversion.status is InverseStatus.EXACT
    run = simulate(chain, inversion.force_N, STEP, initial_tension_N=30.0, engine=engine).require()
    assert np.abs(run.output_tension_N - WANTED).max() < 1e-6


def test_the_actuator_travels_less_by_the_closed_form(generic: Transmission) -> None:
    """Slowly from 20 to 50 N without friction: the integral of the compliance, and the load's spring."""
    bare = replace(generic, friction=replace(generic.friction, mu_dynamic=1e-9, mu_static=1e-9, mu_dynamic_release=1e-9,
                                             mu_static_release=1e-9, viscous_N_s_per_m=0.0))  # fmt: skip
    slow = 20 + 30 * np.clip(np.arange(4001) / 3000, 0, 1)
    chains = [Chain.of(rig, Level.ELASTIC, 3) for rig in (bare, stiffening(bare, 0.3))]
    travel = [np.ptp(invert(chain, slow, STEP, record=True).states[:, -2]) for chain in chains]
    link = chains[1].link
    assert travel[0] - travel[1] == pytest.approx(
        30 / bare.tendon.stiffness_N_per_m - float(link.rest(50.0)[0] - link.rest(20.0)[0]), rel=1e-3
    )
    assert at_rest(chains[1], 35.0).elongation_m.sum() == pytest.approx(float(link.rest(35.0)[0]), rel=1e-12)


def test_an_export_is_refused_with_the_way_out(generic: Transmission) -> None:
    require_linear(Chain.of(generic, Level.ELASTIC, 3))
    with pytest.raises(CodeError, match="`stiffening` cannot be exported yet; leave it out"):
        require_linear(Chain.of(stiffening(generic, 0.3), Level.ELASTIC, 3))
