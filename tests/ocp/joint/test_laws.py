"""The law of a mass from the joint to the drum."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.joint.laws import path_mass_back
from tendonff.ocp.step.laws import ElementLaws
from tests.ocp.tendon.test_other_laws import chain_with_two_bristles

MASS = {"piece_mass_kg": 2e-4, "piece_adhesion_N": 0.3, "v_base": 0.01, "H": 1e-3}


def chains(rig: Transmission) -> dict[str, Chain]:
    """The paper's law, one that falls with the load, and one of two bristles without a closed form."""
    loaded = replace(rig, friction=replace(rig.friction, load_exponent=0.3, reference_tension_N=20.0))
    return {
        "paper": Chain.of(rig, Level.PRESLIDING),
        "load": Chain.of(loaded, Level.PRESLIDING),
        "two bristles": chain_with_two_bristles(rig),
    }


def found(chain: Chain, v: float, f_far: float, f_s: float) -> tuple[float, float, float, float]:
    """Slopes over speed and far tension as the law has them, and as its drop has them."""
    law = path_mass_back(ElementLaws.of(chain))
    named = {s.name(): s for s in law.inputs}
    drop = law.outputs["drop"]
    outputs = [
        law.outputs["by_v"],
        law.outputs["by_far"],
        ca.jacobian(drop, named["v"]),
        ca.jacobian(drop, named["f_far"]),
    ]
    numbers = {name: float(np.ravel(value)[0]) for name, value in chain.numbers().items()} | MASS
    at = numbers | {"v": v, "f_far": f_far} | {f"{name}_base": f_s for name in chain.friction.states}
    function = ca.Function("slopes", [*law.inputs], outputs)
    return tuple(float(x) for x in function.call([at[s.name()] for s in law.inputs]))  # type: ignore[return-value]


@pytest.mark.parametrize("kind", ["paper", "load", "two bristles"])
@pytest.mark.parametrize("v", [-0.3, -1e-3, -1e-5, 2e-5, 1e-3, 0.3])
@pytest.mark.parametrize("f_far", [0.5, 30.0])
def test_slopes_from_the_balance_are_those_of_what_a_mass_takes_off(generic, kind, v, f_far):
    """Sliding both ways and sticking, whatever the law."""
    by_v, by_far, of_drop_v, of_drop_far = found(chains(generic)[kind], v, f_far, 0.2)
    assert by_v == pytest.approx(of_drop_v, rel=1e-7)
    assert by_far == pytest.approx(1 + of_drop_far, rel=1e-7)


def test_a_slack_tendon_has_the_slopes_that_it_has_without_friction(generic):
    """There is no root there, and a search must find back."""
    chain = chains(generic)["paper"]
    by_v, by_far, *_ = found(chain, 0.05, -5.0, 0.2)
    assert by_far == 1.0
    assert by_v == pytest.approx(
        MASS["piece_mass_kg"] / MASS["H"] + float(np.ravel(chain.numbers()["friction_viscous_N_s_per_m"])[0])
    )
