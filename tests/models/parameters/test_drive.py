import math
from dataclasses import fields, replace

import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.parameters.drive import Motor, Rope

MOTOR = Motor(
    drum_radius_m=0.02,
    gear_ratio=25.0,
    inertia_kg_m2=2e-6,
    torque_max_N_m=0.2,
    speed_max_rad_per_s=900.0,
    torque_rated_N_m=0.09,
    stall_torque_N_m=0.5,
    no_load_speed_rad_per_s=1000.0,
)


def test_power_and_kinetic_energy_are_the_same_on_both_sides_of_the_gear() -> None:
    """torque w = force v and J w^2 = m v^2 for v = w r/n."""
    w, v = 300.0, 300.0 * MOTOR.travel_per_rad_m
    assert MOTOR.torque_max_N_m * w == pytest.approx(MOTOR.force_max_N * v, rel=1e-14)
    assert MOTOR.inertia_kg_m2 * w**2 == pytest.approx(MOTOR.mass_kg * v**2, rel=1e-14)
    assert MOTOR.speed_max_m_per_s == pytest.approx(0.02 * 900 / 25)


@pytest.mark.parametrize(
    ("speed", "limit"), [(-500.0, 0.2), (0.0, 0.2), (600.0, 0.2), (800.0, 0.1), (1000.0, 0.0), (1200.0, 0.0)]
)
def test_the_torque_limit_is_the_lower_of_peak_and_torque_speed_line(speed: float, limit: float) -> None:
    assert MOTOR.torque_limit_N_m(speed) == pytest.approx(limit, abs=1e-15)
    line = replace(MOTOR, stall_torque_N_m=None, no_load_speed_rad_per_s=None)
    assert line.torque_limit_N_m(speed) == 0.2


def test_half_a_torque_speed_line_is_refused() -> None:
    with pytest.raises(ParameterError, match="make the torque-speed line together; give both or none"):
        replace(MOTOR, stall_torque_N_m=None)


ROPE = Rope(elastic_modulus_Pa=60e9, length_m=1.2, diameter_m=1.5e-3, density_kg_per_m3=7900.0)


def test_stiffness_and_mass_are_those_of_a_cylinder() -> None:
    area = math.pi * 1.5e-3**2 / 4
    assert ROPE.stiffness_N_per_m == pytest.approx(60e9 * area / 1.2, rel=1e-14)
    assert ROPE.mass_kg == pytest.approx(7900 * area * 1.2, rel=1e-14)
    assert replace(ROPE, density_kg_per_m3=None).mass_kg is None
    with pytest.raises(ParameterError, match="cross_section_m2 or diameter_m, one of them"):
        replace(ROPE, cross_section_m2=1e-6)


def test_a_rope_in_other_units_is_refused_by_the_keys_of_the_data_sheet_and_all_at_once() -> None:
    with pytest.raises(ParameterError) as refused:
        Rope(elastic_modulus_Pa=110.0, length_m=350.0, cross_section_m2=0.15, density_kg_per_m3=7.9)
    said = str(refused.value)
    for text in ("elastic_modulus_Pa = 110", "length_m = 350", "cross_section_m2 = 0.15", "density_kg_per_m3 = 7.9"):
        assert text in said
    assert "1 GPa is 1e9 Pa" in said


@pytest.mark.parametrize("part", [MOTOR, ROPE], ids=["motor", "rope"])
def test_every_number_is_refused_by_name_when_not_above_zero(part: Motor | Rope) -> None:
    names = [field.name for field in fields(part) if getattr(part, field.name) is not None]
    assert len(names) >= 4
    for name in names:
        for bad in (0.0, -1.0, math.nan):
            with pytest.raises(ParameterError, match=f"{name} must be a finite number > 0, got {bad}"):
                replace(part, **{name: bad})
