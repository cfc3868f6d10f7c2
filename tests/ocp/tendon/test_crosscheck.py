import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.adaptive import ADAPTIVE, check_adaptive
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.tendon.crosscheck import StepCheck, StepHalving
from tendonff.ocp.tendon.simulate import simulate

Array = NDArray[np.float64]
STEP = 1e-3


def swing(seconds: float, step_s: float = STEP, amplitude_N: float = 15.0) -> Array:
    time = np.arange(0.0, seconds, step_s)
    return 30 + amplitude_N * np.sin(2 * np.pi * time) * np.minimum(time / 0.2, 1)


def check_step(chain: Chain, force: Array) -> StepCheck:
    """The check of a run with h from rest at 30 N."""
    run = simulate(chain, force, STEP, initial_tension_N=30.0).require()
    halving = StepHalving(chain, STEP, chain.rest_state(30.0), float(force[0]))
    halving.add(run.time_s[1:], run.output_tension_N[1:], lambda t: np.interp(t, run.time_s, force))
    return halving.result()


def smooth(generic: Transmission) -> Transmission:
    return replace(generic, friction=replace(generic.friction, mu_static=0.2, mu_static_release=0.15))


def chattering(generic: Transmission) -> Transmission:
    """A stiff bristle with friction that falls with speed."""
    friction = replace(
        generic.friction, mu_static=0.3, mu_static_release=0.22, bristle_stiffness_N_per_m=1e8, viscous_N_s_per_m=0.01
    )
    return replace(generic, friction=friction, tendon=replace(generic.tendon, damping_N_s_per_m=0.01))


@pytest.mark.each_value
@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("level", Level)
def test_the_run_agrees_with_adaptive_integrators_of_the_same_equations(
    generic: Transmission, method: Method, level: Level
) -> None:
    """0.1 % of range rms at 1 ms, and the integrator agrees with itself."""
    found = check_adaptive(Chain.of(smooth(generic), level, 3), swing(0.8), STEP, initial_tension_N=30.0, method=method)
    assert found.reproducible
    assert 0 < found.rms_N < 1e-3 * found.range_N
    assert found.spread_N < found.peak_N


@pytest.mark.parametrize("level", Level)
def test_the_step_check_estimates_the_true_error(generic: Transmission, level: Level) -> None:
    """Against a run with 10 us: neither far below nor far above the estimate."""
    chain, force = Chain.of(smooth(generic), level, 3), swing(1.5)
    found = check_step(chain, force)
    time = np.arange(len(force)) * STEP
    fine_time = np.arange((len(force) - 1) * 100 + 1) * STEP / 100
    fine = simulate(chain, np.interp(fine_time, time, force), STEP / 100).require().output_tension_N[::100]
    true = math.sqrt(np.mean((simulate(chain, force, STEP).output_tension_N - fine)[1:] ** 2))
    assert found.reproducible
    assert 0.5 * found.error < true < 1.5 * found.error
    assert found.range == pytest.approx(np.ptp(fine), rel=1e-3)
    assert "% of range" in found.text
    assert "not reproducible" not in found.text


def test_stick_slip_is_said_to_be_not_reproducible_with_its_spread(generic: Transmission) -> None:
    chain, force = Chain.of(chattering(generic), Level.ELASTIC, 12), swing(1.5)
    found = check_step(chain, force)
    assert not found.reproducible
    assert found.spread > 0.01 * found.range
    assert f"lie up to {found.spread:.3g} N apart" in found.text
    # The same rig with a soft bristle, or without the Stribeck effect, can be reproduced.
    for calm in (Chain.of(chattering(generic), Level.PRESLIDING, 12), Chain.of(smooth(generic), Level.ELASTIC, 6)):
        assert check_step(calm, force).reproducible


def test_a_check_in_pieces_is_the_check_of_the_whole(generic: Transmission) -> None:
    chain, force = Chain.of(smooth(generic), Level.PRESLIDING, 3), swing(0.6)
    run = simulate(chain, force, STEP)
    halving = StepHalving(chain, STEP, chain.rest_state(30.0), float(force[0]))
    for rows in np.array_split(np.arange(1, len(force)), 7):
        halving.add(run.time_s[rows], run.output_tension_N[rows], lambda t: np.interp(t, run.time_s, force))
    found, whole = halving.result(), check_step(chain, force)
    assert found.error == pytest.approx(whole.error, rel=1e-9)
    assert found.peak == pytest.approx(whole.peak, rel=1e-9)
    assert found.spread == pytest.approx(whole.spread, rel=1e-9)


def test_a_force_that_stands_still_has_no_error(generic: Transmission) -> None:
    found = check_step(Chain.of(generic, Level.PRESLIDING), np.full(50, 30.0))
    assert found.reproducible
    assert found.error < 1e-9
    assert "nan" not in found.text.replace("nanonewton", "")
