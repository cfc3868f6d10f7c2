"""Closed forms of a loop: against the formulas of equal tendons, and against a plant written without the package."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.models.joint.closed_form import GrossSliding, data_sheet, elongation_factor, sweep_pretension
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tests.joint_plant import respond
from tests.joint_rig import ARM, EXPONENT, STIFFNESS, heavier, mechanism

A, T, K = EXPONENT, 15.0, STIFFNESS


@pytest.mark.parametrize("p", [0.0, 1.5])
def test_equal_tendons_have_the_formulas_of_hyperbolic_functions(p: float) -> None:
    law = GrossSliding.of(mechanism(adhesion_N=p), 0.0)
    sheet = data_sheet(law, 0.1)
    lifted = T + p
    assert sheet.least_tension_N == pytest.approx(lifted * A / math.sinh(A) - p)
    assert sheet.lost_motion_rad == pytest.approx(lifted / K * math.tanh(A / 2) / ARM)
    assert sheet.drive_force_N == pytest.approx(2 * A * lifted)
    assert sheet.stop_ratio == pytest.approx(1 + math.exp(-A))
    assert law.stop_slope_N_per_m(1, slack=False) == pytest.approx(K * A / math.tanh(A / 2))
    for load in (0.02, 0.1):
        for direction in (1, -1):
            assert law.net_drum_N(load, direction) == pytest.approx(load / ARM + direction * 2 * A * lifted)


def test_slack_of_equal_tendons() -> None:
    law = GrossSliding.of(mechanism(), 0.0)
    assert law.slack_torque_N_m(1, 1) == pytest.approx(ARM * 2 * A * T / math.expm1(A))
    assert law.slack_torque_N_m(-1, 1) == pytest.approx(ARM * 2 * A * T / -math.expm1(-A))
    assert law.least_pretension_N(0.05) == pytest.approx(0.05 / ARM * math.expm1(A) / (2 * A))
    beyond = law.slide(1.5 * law.slack_torque_N_m(1, 1), 1)
    assert beyond.slack
    assert beyond.tension_N[1] == 0


def test_the_least_pretension_is_where_the_slack_torque_is_the_torque() -> None:
    """Two coefficients, load-independent friction, unequal tendons and drums."""
    rig = uneven()
    law = GrossSliding.of(rig, 0.0)
    torque = 0.07
    least = law.least_pretension_N(torque)
    at = replace(law, tension_N=least)
    assert min(at.slack_torque_N_m(sign, sign) for sign in (1, -1)) == pytest.approx(torque)


def test_more_pretension_costs_lost_motion_and_friction_and_buys_torque() -> None:
    sheets = sweep_pretension(GrossSliding.of(uneven(), 0.0), 0.05, np.array([5.0, 10.0, 20.0]))
    for name in ("lost_motion_rad", "drive_force_N", "slack_torque_N_m"):
        values = [getattr(sheet, name) for sheet in sheets]
        assert values == sorted(values)
        assert values[0] < values[-1]


def test_a_pair_has_no_lost_motion_to_tell() -> None:
    with pytest.raises(ParameterError, match="a pair keeps its least tension"):
        data_sheet(GrossSliding.of(mechanism(DriveKind.PAIR, 3.0), 0.0), 0.1)


def test_a_frictionless_tendon_has_factor_one() -> None:
    assert elongation_factor(0.0) == 1
    assert elongation_factor(1e-9) == pytest.approx(1.0)


def uneven() -> Mechanism:
    rig = mechanism(adhesion_N=0.8)
    first, second = rig.tendons
    ways = replace(first.friction, mu_dynamic_release=0.14)
    return replace(
        rig,
        tendons=(replace(first, friction=ways), replace(second, tendon=second.tendon.scaled(1.6), friction=ways)),
        drive=replace(rig.drive, drum_radius_m=(8e-3, 8e-3)),
    )


def of_example(path: Path) -> Mechanism:
    """Mechanism of an example without load; a pair as the loop that its least tension would make."""
    rig = load_scenario(path).mechanism
    joint = replace(
        rig.joint, gravity_N_m=0.0, coulomb_N_m=0.0, damping_N_m_s_per_rad=0.05 * rig.joint.damping_N_m_s_per_rad
    )
    tension = rig.drive.pretension_N or rig.drive.least_tension_N
    loop = replace(rig.drive, kind=DriveKind.LOOP, pretension_N=tension, least_tension_N=None)
    return replace(rig, joints=(joint,), drive=loop)


def slow_turn(rig: Mechanism) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Drum angle, joint angle and tensions of both tendons at the drum, of a plant turned slowly to and fro."""
    time = np.arange(0.0, 4.0, 1e-3)
    drum = 0.35 * np.sin(2 * np.pi * time / 4) * np.minimum(time / 0.5, 1) ** 2
    heavy = replace(rig, tendons=tuple(replace(t, tendon=replace(t.tendon, mass_kg=4e-3)) for t in rig.tendons))
    tensions = np.full(2, rig.drive.pretension_N)
    response = respond(heavy, drum, 1e-3, 0.0, tensions_N=tensions, soft=False, masses=20, step_s=2e-6)
    ratio = rig.drum_radius_m[0] / rig.arms_at(0.0)[0]
    return ratio * drum, response.angle_rad, np.hstack([response.drum_N, response.tension_N])


@pytest.mark.compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", ["hand_joint", "instrument_pair", "uneven"])
def test_the_data_sheet_is_within_a_percent_of_a_plant(name: str, examples: Path, record_property) -> None:
    """Turned slowly and without load, so that it is quasi-static; tendons of 4 g let an explicit step be 2 us."""
    rig = heavier(uneven(), 0.0) if name == "uneven" else of_example(examples / f"{name}.toml")
    drum, angle, tension = slow_turn(rig)
    sheet = data_sheet(GrossSliding.of(rig, 0.0), 0.0)
    ways = slice(750, 950), slice(1750, 1950)  # on a stroke each way, past the reversal; the mean is free of ringing
    lost = [np.mean((drum - angle)[way]) for way in ways]
    force = [np.mean((tension[:, 0] - tension[:, 1])[way]) for way in ways]
    lost_rad, friction = (lost[0] - lost[1]) / 2, (force[0] - force[1]) / 2
    least = min(tension[way, 2:].mean(axis=0).min() for way in ways)
    record_property(
        "figure",
        f"closed forms over the plant, {name}: lost motion {sheet.lost_motion_rad / lost_rad:.4f}, "
        f"drive force {sheet.drive_force_N / friction:.4f}, least tension {sheet.least_tension_N / least:.4f}",
    )
    assert sheet.lost_motion_rad == pytest.approx(lost_rad, rel=0.01)
    assert sheet.drive_force_N == pytest.approx(friction, rel=0.01)
    assert sheet.least_tension_N == pytest.approx(least, rel=0.01)
