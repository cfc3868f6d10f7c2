"""The recursion of a joint on a loop in full sliding, where the closed forms are exact."""

import math
from dataclasses import asdict

import casadi as ca
import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.joint import JointTuning, between_law, tuning_law

STEP, HALF_LOST, EXPONENT, LOW, HIGH = 4e-3, 0.02, 0.6, 0.5, 2.0
ANGLE = 0.6 * np.sin(2 * np.pi * STEP * np.arange(1500) / 1.0)
BETWEEN = between_law().function()


def half_lost(factor):
    """(T/k) tanh(a/2) with a factor on T and a."""
    return HALF_LOST * factor * math.tanh(factor * EXPONENT / 2) / math.tanh(EXPONENT / 2)


def tune(true, *, zero_rad=0.0, stuck_from=None, missing=()):
    """State after every sample of a loop that is off by a factor, as rows of names and values."""
    tuning = JointTuning.of(
        low=LOW,
        high=HIGH,
        ratio=1.0,
        span_rad=float(np.ptp(ANGLE)),
        lost_motion_rad=HALF_LOST,
        noise_rad=0.0,
        delay_samples=0,
        step_s=STEP,
    )
    law = tuning_law()
    function, inputs = law.function(), [symbol.name() for symbol in law.inputs]
    numbers = asdict(tuning)
    numbers["slow_share"] = numbers.pop("slow")
    state, rows, stuck = tuning.start(), [], 0.0
    for k in range(1, len(ANGLE)):
        way = math.copysign(1.0, ANGLE[k] - ANGLE[k - 1])
        nodes = [ANGLE[k] + way * half_lost(f) for f in (LOW, 1.0, HIGH)]
        commanded = float(BETWEEN(state["used"], LOW, HIGH, *nodes))
        measured = commanded - way * half_lost(true) + zero_rad
        stuck = measured if stuck_from is None or k < stuck_from else stuck
        sample = {"measured": stuck, "angle": ANGLE[k], "moved": abs(ANGLE[k] - ANGLE[k - 1]), "samples": 1.0}
        sample |= {"taught": float(k not in missing), "commanded": commanded}
        sample |= {f"v{j}": value for j, value in enumerate(nodes)}
        known = sample | numbers | state
        found = dict(zip(law.outputs, map(float, function(*(known[name] for name in inputs))), strict=True))
        state = {name: found[f"{name}_new"] for name in state}
        rows.append(state)
    return rows


def test_what_is_commanded_goes_through_the_values_at_the_ends_and_at_1():
    for factor, value in ((LOW, 3.0), (1.0, 5.0), (HIGH, 4.0)):
        assert float(BETWEEN(factor, LOW, HIGH, 3.0, 5.0, 4.0)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("true", [0.7, 1.5])
def test_the_factor_of_a_loop_is_found(true):
    """Within what the parabola leaves of the lost motion."""
    assert tune(true)[-1]["used"] == pytest.approx(true, rel=0.05)


def test_a_zero_of_the_encoder_that_is_off_is_no_friction():
    assert tune(1.0, zero_rad=0.03)[-1]["used"] == pytest.approx(1.0, abs=0.03)


def test_a_sensor_that_stops_moving_keeps_the_last_good_factor():
    rows = tune(1.4, stuck_from=900)
    assert rows[899]["used"] == pytest.approx(1.4, rel=0.05)
    assert rows[1100]["frozen"] == 1
    assert all(abs(row["used"] - rows[899]["used"]) < 0.05 for row in rows[900:])


def test_samples_that_teach_nothing_change_nothing():
    rows = tune(1.4, missing=range(len(ANGLE)))
    assert {row["used"] for row in rows} == {1.0}
    assert {row["P00"] for row in rows} == {rows[0]["P00"]}


def test_a_loop_without_lost_motion_is_refused():
    with pytest.raises(ParameterError, match="lost motion"):
        JointTuning.of(
            low=LOW,
            high=HIGH,
            ratio=1.0,
            span_rad=1.0,
            lost_motion_rad=0.0,
            noise_rad=0.0,
            delay_samples=0,
            step_s=STEP,
        )


def test_lost_motion_and_friction_of_the_drive_hardly_separate_friction_from_tension():
    """What a relative change of a does to the drive's friction over the lost motion, as the module states it."""
    a, k = ca.SX.sym("a"), EXPONENT
    ratio = ca.Function("r", [a], [ca.jacobian(ca.log(a / ca.tanh(a / 2)), a) * a])
    assert float(ratio(k)) == pytest.approx(1 - k / math.sinh(k), abs=1e-12)
