import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.mechanism.linearise import Lineariser
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tendon.stability import predict_stick_slip

STEP = 1e-3
TIME = np.arange(0, 2 + STEP / 2, STEP)
REFERENCE = 30 + np.minimum(TIME / 0.5, 1) * (12 * np.sin(np.pi * TIME) + 5 * np.sin(2.6 * np.pi * TIME))


def with_static(generic: Transmission, ratio: float) -> Transmission:
    friction = replace(generic.friction, mu_static=0.2 * ratio, mu_dynamic_release=None, mu_static_release=None)
    return replace(generic, friction=friction)


def error_on_a_finer_plant(rig: Transmission, level: Level) -> float:
    """Of the exact inverse on N = 30 at a fifth of the step, rms in N."""
    force = invert(Chain.of(rig, level), REFERENCE, STEP).force_N
    fine = np.arange((len(force) - 1) * 5 + 1) * STEP / 5
    run = simulate(Chain.of(rig, level, 30), np.interp(fine, TIME, force), STEP / 5, initial_tension_N=30.0).require()
    return float(np.sqrt(np.mean((run.output_tension_N[::5] - REFERENCE) ** 2)))


def test_friction_that_does_not_weaken_raises_no_alarm(generic: Transmission) -> None:
    rig = with_static(generic, 1.0)
    seen = predict_stick_slip(Chain.of(rig, Level.VISCOELASTIC), REFERENCE, STEP)
    assert seen.warnings == ()
    assert seen.largest_growth_per_s < 0
    assert seen.expected_error_N < 0.005 * float(np.ptp(REFERENCE))


def test_stick_slip_is_seen_coming_with_the_error_it_will_cause(generic: Transmission) -> None:
    """The forecast is within a factor 1.5 of the error on an independent, finer plant."""
    rig = with_static(generic, 1.2)
    seen = predict_stick_slip(Chain.of(rig, Level.VISCOELASTIC), REFERENCE, STEP)
    assert len(seen.warnings) == 1
    assert "stick-slip: friction weakens with speed" in seen.warnings[0]
    assert seen.unstable_share > 0.2
    assert seen.largest_growth_per_s > 100
    assert all(0 <= s.start_s < s.end_s <= 2.01 for s in seen.stretches)
    actual = error_on_a_finer_plant(rig, Level.VISCOELASTIC)
    assert actual > 0.01 * float(np.ptp(REFERENCE))
    assert seen.expected_error_N == pytest.approx(actual, rel=0.5)


def test_a_soft_bristle_outlives_the_stribeck_effect_without_alarm(generic: Transmission) -> None:
    rig = with_static(generic, 1.2)
    seen = predict_stick_slip(Chain.of(rig, Level.PRESLIDING), REFERENCE, STEP)
    assert seen.warnings == ()
    assert error_on_a_finer_plant(rig, Level.PRESLIDING) < 0.005 * float(np.ptp(REFERENCE))


def lively(generic: Transmission) -> Chain:
    """A chain with little damping and much friction that does not weaken with speed: what follows tension feeds it."""
    mus = {"mu_dynamic": 0.4, "mu_static": 0.4, "mu_dynamic_release": None, "mu_static_release": None}
    rig = replace(
        generic,
        friction=replace(generic.friction, viscous_N_s_per_m=0.01, **mus),
        tendon=replace(generic.tendon, damping_N_s_per_m=0.01),
        load=replace(generic.load, damping_N_s_per_m=0.01, mass_kg=0.2),
        actuator=replace(generic.actuator, damping_N_s_per_m=0.1),
    )
    return Chain.of(rig, Level.ELASTIC)


def test_the_mode_that_grows_has_the_frequency_and_the_growth_of_a_disturbance_that_is_simulated(
    generic: Transmission,
) -> None:
    """Two runs of the chain at a 200th of the step, one with a kick of 0.2 ms: what grows of their difference."""
    chain = lively(generic)
    worst = max(predict_stick_slip(chain, REFERENCE, STEP).stretches, key=lambda s: s.growth_exponent)
    inversion = invert(chain, REFERENCE, STEP, record=True)
    row = round(worst.start_s / STEP) + 100
    state = ChainState.from_vector(inversion.states[row], chain.layout, 0.0)
    fine = np.arange(20_000) * STEP / 200
    force = np.interp(fine + row * STEP, TIME, inversion.force_N)
    kicked = force + 1e-4 * ((fine > 5e-4) & (fine < 7e-4))
    runs = [simulate(chain, each, STEP / 200, state=state).require().output_tension_N for each in (force, kicked)]
    apart = np.diff(runs[1] - runs[0], n=2)[10_000:]  # twice: what moves slowly goes
    spectrum = np.abs(np.fft.rfft(apart * np.hanning(len(apart))))
    seen_Hz = float(np.fft.rfftfreq(len(apart), STEP / 200)[np.argmax(spectrum)])
    assert worst.frequency_Hz == pytest.approx(seen_Hz, rel=0.03)
    early, late = (np.sqrt(np.mean(part**2)) for part in np.split(apart[: 2 * (len(apart) // 2)], 2))
    assert 0.2 * worst.growth_per_s < np.log(late / early) / 0.025 < 1.2 * worst.growth_per_s


def test_a_mode_that_grows_in_the_only_step_there_is_counts_for_all_of_it(generic: Transmission) -> None:
    seen = predict_stick_slip(lively(generic), np.array([30.0, 20.0]), 0.2)
    (stretch,) = seen.stretches
    assert stretch.growth_exponent == pytest.approx(0.2 * stretch.growth_per_s)
    assert stretch.end_s == pytest.approx(0.2)


@pytest.mark.parametrize("rows", [1, 2])
def test_a_reference_of_one_row_or_two_is_answered(generic: Transmission, rows: int) -> None:
    """One row takes no time, so nothing grows; the poles are those of rest."""
    chain = Chain.of(with_static(generic, 1.2), Level.VISCOELASTIC)
    seen = predict_stick_slip(chain, np.array([30.0, 30.02])[:rows], STEP)
    assert seen.expected_error_N < 0.02
    assert seen.unstable_share <= 1.0
    if rows == 1:
        assert (seen.stretches, seen.unstable_share) == ((), 0.0)
        rest = Lineariser(chain).at(chain.rest_state(30.0)).poles
        assert seen.largest_growth_per_s == pytest.approx(float(rest.real.max()), rel=1e-6, abs=1e-6)


def test_the_prediction_needs_no_control_or_drawing_library() -> None:
    loaded = "import sys, tendonff.ocp.tendon.stability; print(sorted({'control', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.compiler
def test_a_tendon_that_no_matrix_describes_is_answered(generic: Transmission) -> None:
    """A stiffness beyond all measure is asked about elsewhere; a forecast does not end the design."""
    soft = replace(generic, tendon=replace(generic.tendon, stiffness_N_per_m=1e-300))
    found = predict_stick_slip(Chain.of(soft, Level.PRESLIDING), 30 + 5 * np.sin(np.linspace(0, 6, 100)), 1e-3)
    assert found.stretches == ()
