"""The tension that a motion of the load asks for, and the motion under a tension."""

import numpy as np
import pytest

from tendonff.models.parameters import Load
from tendonff.ocp.reference.motion import motion_of_tension, tension_of_motion

LOAD = Load(mass_kg=0.3, stiffness_N_per_m=2000.0, damping_N_s_per_m=7.0)


def error(step: float, *, periodic: bool) -> float:
    """Largest distance from T0 + m a + b v + k q of a sine, away from the start."""
    w = 2 * np.pi
    time = np.arange(round(1 / step) + 1) * step
    course = 0.01 * np.sin(w * time)
    found = tension_of_motion(LOAD, course, step, 50.0, periodic=periodic)
    exact = 50 + 0.01 * ((2000 - 0.3 * w**2) * np.sin(w * time) + 7 * w * np.cos(w * time))
    return float(np.abs(found - exact)[0 if periodic else 10 :].max())


@pytest.mark.parametrize("periodic", [True, False])
def test_it_is_the_balance_of_the_load_to_second_order(periodic: bool) -> None:
    coarse, fine = error(2e-3, periodic=periodic), error(1e-3, periodic=periodic)
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_a_load_that_stays_keeps_its_tension() -> None:
    assert tension_of_motion(LOAD, np.zeros(20), 1e-3, 50.0) == pytest.approx(np.full(20, 50.0))


@pytest.mark.parametrize("periodic", [True, False])
def test_the_motion_under_a_tension_is_the_one_that_asks_for_it(periodic: bool) -> None:
    time = np.arange(1001) * 1e-3
    course = 0.01 * (np.sin(2 * np.pi * time) + (0.3 * np.cos(6 * np.pi * time) if periodic else 0))
    tension = tension_of_motion(LOAD, course, 1e-3, 50.0, periodic=periodic)
    assert motion_of_tension(LOAD, tension, 1e-3, 50.0, periodic=periodic) == pytest.approx(course, abs=1e-12)
