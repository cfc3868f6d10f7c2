import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.stability import predict_stick_slip

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


def test_the_prediction_needs_no_control_or_drawing_library() -> None:
    loaded = "import sys, tendonff.ocp.stability; print(sorted({'control', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True).stdout == "[]\n"
