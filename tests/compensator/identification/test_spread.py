"""Intervals of a fit become the uncertainty of the scenario that goes on with it."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.spread import with_other_law, with_spread
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario

NAMES = ("mu_dynamic", "mu_dynamic_release", "adhesion_N")


def estimate(name, value, half):
    return Estimate(name=name, value=value, interval=(value - half, value + half), fitted=True, why="dynamic stage")


@pytest.fixture
def fitted(examples):
    found = load_scenario(examples / "finger.toml")
    t = found.transmission
    friction = replace(t.friction, mu_dynamic_release=0.18, mu_static_release=0.18, adhesion_N=1.0)
    robust = replace(found.robust, mu=0.1)
    return replace(found, transmission=replace(t, friction=friction), robust=robust)


VALUES = (
    estimate("mu_theta", 0.63, 0.01),
    estimate("mu_dynamic", 0.2, 0.004),
    estimate("mu_dynamic_release", 0.18, 0.009),
    estimate("adhesion_N", 1.0, 1.5),
    estimate("input_offset_N", 0.2, 0.1),
)


def test_each_identified_value_has_its_own_spread_and_the_file_keeps_it(fitted):
    found = with_spread(fitted, VALUES, NAMES, np.eye(3), np.eye(3))
    widths = {spread.keys: (spread.half_width, spread.low, spread.high) for spread in found.robust.spread}
    assert widths == {
        ("friction.mu_dynamic",): (0.02, None, None),
        ("friction.mu_dynamic_release",): (0.05, None, None),
        ("friction.adhesion_N",): (None, 0.0, 2.5),
    }
    assert found.robust.mu == 0  # a guess, which the fit supersedes
    assert parse_scenario(scenario_to_toml(found)).robust == found.robust


def test_directions_that_are_known_only_together_vary_together(fitted):
    matrix = np.eye(3)
    matrix[0, 1] = matrix[1, 0] = 0.99
    (first, *_) = with_spread(fitted, VALUES, NAMES, matrix, matrix).robust.spread
    assert first.keys == ("friction.mu_dynamic", "friction.mu_dynamic_release")
    assert first.half_width == 0.05


def test_a_value_that_was_not_fitted_has_no_interval(fitted):
    kept = replace(VALUES[1], fitted=False)
    assert not with_spread(fitted, (kept,), (), np.eye(0), np.eye(0)).robust.spread


@pytest.mark.parametrize(("stated", "assumed"), [(0.0, 0.1), (0.3, 0.3)])
def test_friction_that_is_kept_has_the_width_that_is_stated_or_assumed(fitted, stated, assumed):
    """Beside the interval of another value it would count as known exactly."""
    asked = replace(fitted, robust=replace(fitted.robust, mu=stated))
    found = with_spread(asked, (estimate("stiffness_N_per_m", 1.5e4, 300.0),), (), np.eye(0), np.eye(0)).robust
    assert [spread.name for spread in found.spread] == ["tendon.stiffness_N_per_m"]
    assert found.mu == assumed
    one = with_spread(asked, VALUES[1:2], ("mu_dynamic",), np.eye(1), np.eye(1)).robust  # the release is kept
    assert {spread.name: spread.half_width for spread in one.spread} == {
        "friction.mu_dynamic": 0.02,
        "friction.mu_dynamic_release": assumed,
    }
    assert one.mu == 0


def test_a_value_that_must_be_positive_has_an_interval_that_can_be_simulated(fitted):
    """One as wide as its value goes down by the factor by which it goes up: a file with an end at 0 was refused."""
    wide = estimate("stiffness_N_per_m", 1e4, 3e4)
    (found,) = with_spread(fitted, (wide,), ("stiffness_N_per_m",), np.eye(1), np.eye(1)).robust.spread
    assert (found.low, found.high) == (pytest.approx(2500.0), 4e4)


def test_what_noise_alone_makes_stands_beside_the_correlation(fitted):
    """The interval is one of Student's t, and has doubt about the law in it: the draws by noise are narrower."""
    share = np.array([[0.25, -0.1, 0.0], [-0.1, 0.5, 0.0], [0.0, 0.0, 1.0]])
    known = tuple(replace(v, standard_error=(v.interval[1] - v.value) / 2.5) for v in VALUES)
    matrix = np.array([[1, -0.7, 0.4], [-0.7, 1, 0.2], [0.4, 0.2, 1]])
    found = with_spread(fitted, known, NAMES, matrix, share).robust.correlation
    assert found.rows == ((1.0, -0.7), (-0.7, 1.0))
    assert np.array(found.noise) == pytest.approx(share[:2, :2] * (1.96 / 2.5) ** 2, abs=1e-3)


def test_a_law_that_the_data_do_not_exclude_goes_into_the_file(fitted):
    """Each dependence on the load has the numbers of the other taken out."""
    known, t = with_spread(fitted, VALUES, NAMES, np.eye(3), np.eye(3)), fitted.transmission
    falling = replace(t.friction, adhesion_N=0.0, load_exponent=0.1, reference_tension_N=40.0)
    found = with_other_law(known, replace(t, friction=falling))
    assert parse_scenario(scenario_to_toml(found)).robust == found.robust
    assert found.robust.other_law.of(t).friction == falling
    back = with_other_law(replace(found, transmission=replace(t, friction=falling)), t).robust.other_law
    again = back.of(replace(t, friction=falling)).friction
    assert (again.adhesion_N, again.load_exponent) == (1.0, 0.0)
    assert with_other_law(known, None) == known
    assert with_spread(found, VALUES, NAMES, np.eye(3), np.eye(3)).robust.other_law is None  # of another log


def test_where_nothing_is_stated_or_identified_nothing_is_written(fitted):
    asked = replace(fitted, robust=replace(fitted.robust, mu=0.0))
    assert with_spread(asked, (), (), np.eye(0), np.eye(0)).robust == asked.robust


def test_values_that_a_fit_knows_together_stay_together_in_the_file(fitted):
    """One cut off at nothing has no middle that the others could go with."""
    matrix = np.array([[1, -0.7, 0.4], [-0.7, 1, 0.2], [0.4, 0.2, 1]])
    found = with_spread(fitted, VALUES, NAMES, matrix, matrix).robust
    assert found.correlation.keys == ("friction.mu_dynamic", "friction.mu_dynamic_release")
    assert found.correlation.rows == ((1.0, -0.7), (-0.7, 1.0))
    text = scenario_to_toml(replace(fitted, robust=found))
    assert parse_scenario(text).robust == found
    with pytest.raises(InputError, match='mu_dynamic" has no interval'):
        parse_scenario(text.replace('"friction.mu_dynamic" = 0.02\n', ""))
