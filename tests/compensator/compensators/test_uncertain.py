"""Samples of what is not known, and errors over them."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.expectation import (
    WITHOUT_WAVES,
    ErrorBand,
    bands_of,
    behind_drives,
    expectation_of,
    two_digits,
)
from tendonff.compensator.compensators.expected import robustness_table
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.superposition import Superposition
from tendonff.compensator.compensators.uncertain import Doubt, sample_systems
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.unit import NEWTON
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Correlation, OtherLaw, Spread, Uncertainty
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert

STEP = 2e-3
TIME = np.arange(0, 1 + STEP / 2, STEP)
TENSION = 30 + 10 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.1, 1)
UNSURE = Uncertainty(mu=0.2, stiffness=0.1, spread=(Spread(keys=("load.stiffness_N_per_m",), half_width=0.3),))


@pytest.fixture(scope="module")
def reference() -> Reference:
    return Reference(time_s=TIME, tension_N=TENSION, initial_tension_N=30.0, step_s=STEP)


def test_samples_are_the_nominal_ones_each_end_alone_and_points_that_fill_all_intervals(generic: Transmission) -> None:
    samples = sample_systems(generic, replace(UNSURE, samples=40))
    assert len(samples) == 40
    assert samples[0].system == generic
    load = generic.load.stiffness_N_per_m
    ends = [dict(sample.numbers) for sample in samples[1:7]]
    assert ends[:4] == [{"mu": 0.8}, {"mu": 1.2}, {"stiffness": 0.9}, {"stiffness": 1.1}]
    assert [end["load.stiffness_N_per_m"] for end in ends[4:]] == pytest.approx([0.7 * load, 1.3 * load])
    inner = np.array([list(sample.numbers.values()) for sample in samples[7:]]) / (1, 1, load)
    assert np.all(np.abs(inner - 1) <= (0.2, 0.1, 0.3))
    assert np.all(np.ptp(inner, axis=0) > np.array((0.2, 0.1, 0.3)) * 1.8)
    last = samples[-1]
    assert last.system.friction.mu_static == pytest.approx(generic.friction.mu_static * last.numbers["mu"])
    assert last.system.load.stiffness_N_per_m == last.numbers["load.stiffness_N_per_m"]


def test_the_points_of_one_seed_are_even_and_those_of_another_are_others(generic: Transmission) -> None:
    """A Sobol sequence has as many points in each half of every interval, to one."""
    many = replace(UNSURE, samples=7 + 64)
    first, again, other = (sample_systems(generic, u) for u in (many, many, replace(many, seed=1)))
    assert [s.numbers for s in first] == [s.numbers for s in again] != [s.numbers for s in other]
    mu = np.array([sample.numbers["mu"] for sample in first[7:]])
    assert abs(int(np.sum(mu > 1)) - 32) <= 1


def test_certainty_needs_one_sample_and_is_doubted_all_the_same(generic: Transmission) -> None:
    assert len(sample_systems(generic, Uncertainty(samples=9))) == 1
    doubt = Doubt.of(generic, Uncertainty(samples=9))
    assert doubt.is_assumed
    assert str(doubt) == "mu ±10 % (assumed; set [robust])"


def test_friction_overestimated_makes_the_output_swing_more_than_the_reference(
    generic: Transmission, reference: Reference
) -> None:
    """Over-compensation: the exact inverse of the nominal rig on rigs with less friction."""
    profile = Profile(force_N=invert(Chain.of(generic, Level.PRESLIDING, 40), TENSION, STEP).force_N)
    of = {"level": Level.PRESLIDING, "reference": reference, "uncertainty": Uncertainty(mu=0.2, samples=3)}
    band = Problem(transmission=generic, **of).expect({"inverse": profile}).bands["inverse"]
    assert band.nominal.rmse < 1e-6
    assert band.amplified_sample.numbers == {"mu": 0.8}
    assert band.amplification > 0.05


def test_the_number_that_does_it_is_the_first_contribution_and_the_corner_of_all_is_the_worst_case(
    generic: Transmission, reference: Reference
) -> None:
    """Every number is simulated here again, on its own plant."""
    profile = Profile(force_N=invert(Chain.of(generic, Level.PRESLIDING), TENSION, STEP).force_N)
    spread = (
        Spread(keys=("tendon.damping_N_s_per_m",), half_width=0.2),
        Spread(keys=("actuator.coulomb_N",), low=0.0, high=4.0),
        Spread(keys=("friction.mu_dynamic", "friction.mu_dynamic_release"), half_width=0.05),
    )
    rig = replace(generic, friction=replace(generic.friction, mu_dynamic_release=0.15))
    of = {"level": Level.PRESLIDING, "reference": reference, "uncertainty": Uncertainty(spread=spread)}
    found = Problem(transmission=rig, **of).expect({"inverse": profile})
    assert found.contributions[0].key == "actuator.coulomb_N"

    def error_N(transmission: Transmission) -> float:
        output = Plant(transmission, Level.PRESLIDING, 40).respond(profile, reference).output_N
        return float(np.sqrt(np.mean((output - TENSION) ** 2)))

    dry = replace(rig, actuator=replace(rig.actuator, coulomb_N=4.0))
    assert found.contributions[0].rmse == pytest.approx(error_N(dry))
    corners = [
        error_N(
            replace(
                dry,
                tendon=replace(rig.tendon, damping_N_s_per_m=damping * rig.tendon.damping_N_s_per_m),
                friction=replace(
                    rig.friction,
                    mu_dynamic=mu * rig.friction.mu_dynamic,
                    mu_static=mu * rig.friction.mu_static,
                    mu_dynamic_release=mu * 0.15,
                    mu_static_release=mu * rig.friction.release_static,
                ),
            )
        )
        for damping in (0.8, 1.2)
        for mu in (0.95, 1.05)
    ]
    assert found.best.worst.rmse == pytest.approx(max(corners), rel=0.01)


@pytest.mark.parametrize(
    ("keys", "values", "message"),
    [
        (("load.stiffness_N_per_m",), {"half_width": 1.0}, "must be > 0 and < 1, got 1"),
        (("actuator.coulomb_N",), {"low": 3.0, "high": 1.0}, r"low < high, got \[3.0, 1.0\]"),
    ],
)
def test_an_interval_without_a_meaning_is_refused(keys: tuple[str, ...], values: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Spread(keys=keys, **values)


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.634, "1.6"), (24.7, "25"), (0.0123, "0.012"), (123.4, "120"), (9.96, "10"), (99.6, "100"), (0.0004, "< 0.001")],
)
def test_headlines_have_two_digits(value: float, text: str) -> None:
    assert two_digits(value) == text


MEASURED = Uncertainty(
    samples=64,
    spread=tuple(
        Spread(keys=(key,), half_width=width)
        for key, width in (
            ("friction.mu_dynamic", 0.05),
            ("tendon.stiffness_N_per_m", 0.1),
            ("load.stiffness_N_per_m", 0.2),
            ("load.mass_kg", 0.1),
        )
    ),
    correlation=Correlation(
        keys=("friction.mu_dynamic", "tendon.stiffness_N_per_m", "load.stiffness_N_per_m"),
        rows=((1.0, 0.9, 0.0), (0.9, 1.0, 0.3), (0.0, 0.3, 1.0)),
    ),
)


def test_numbers_measured_together_are_drawn_together_and_an_end_of_one_moves_the_others(generic: Transmission) -> None:
    samples = sample_systems(generic, MEASURED)
    nominal = np.array([generic.friction.mu_dynamic, generic.tendon.stiffness_N_per_m, generic.load.stiffness_N_per_m])
    keys = [spread.keys[0] for spread in MEASURED.spreads]
    end = samples[4].numbers  # stiffness, high
    moved = np.array([end[key] for key in keys[:3]]) / nominal - 1
    assert moved == pytest.approx([0.9 * 0.05, 0.1, 0.3 * 0.2])
    assert dict(samples[7].numbers) == {keys[3]: pytest.approx(0.9 * generic.load.mass_kg)}
    drawn = np.array([[sample.numbers[key] for key in keys[:3]] for sample in samples[9:]]) / nominal - 1
    assert np.all(np.abs(drawn) <= np.array([0.05, 0.1, 0.2]) * (1 + 1e-12))
    assert np.corrcoef(drawn.T)[0, 1] > 0.7
    assert abs(np.corrcoef(drawn.T)[0, 2]) < 0.3


@pytest.mark.parametrize("seed", range(5))
def test_the_worst_case_of_numbers_measured_together_is_that_of_95_percent_of_all_draws(
    generic: Transmission, seed: int
) -> None:
    """Of any linear errors: 20 000 draws from the joint distribution; less where an interval ends before it."""
    rng = np.random.default_rng(seed)
    measured = replace(MEASURED, spread=MEASURED.spread[:3])
    doubt, slopes = Doubt.of(generic, measured), rng.standard_normal((3, 5)) * rng.uniform(0.1, 2, (3, 1))
    together = np.array(measured.correlation.rows)
    ends = [side * together[k] @ slopes for k in range(3) for side in (-1, 1)]
    corner = np.array(Superposition.of(doubt, np.array([np.zeros(5), *ends])).worst_corner())
    draws = rng.multivariate_normal(np.zeros(3), together / 1.96**2, size=20_000)
    said = np.linalg.norm(corner @ slopes)
    assert 0.87 < np.mean(np.linalg.norm(draws @ slopes, axis=1) < said) < 0.97


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
@pytest.mark.parametrize(
    ("together", "noise", "deviation"),
    [(False, None, None), (True, None, 1.0), (True, ((0.09, 0.0), (0.0, 0.09)), 0.3)],
)
def test_expected_errors_are_quantiles_over_all_draws(
    generic: Transmission,
    together: bool,
    noise: tuple[tuple[float, ...], ...] | None,
    deviation: float | None,
    share: float,
) -> None:
    """Of two errors at different times: a share of the square lies in a circle, or of a normal distribution.

    Doubt about the law, which the intervals hold beside the noise, is no part of it.
    """
    keys = ("tendon.stiffness_N_per_m", "load.stiffness_N_per_m")
    known = Uncertainty(
        spread=tuple(Spread(keys=(key,), half_width=0.1) for key in keys),
        samples=9,
        correlation=Correlation(keys=keys, rows=((1.0, 0.0), (0.0, 1.0)), noise=noise) if together else None,
    )
    ends = np.array([[0.0, 0.0], [-2.0, 0.0], [2.0, 0.0], [0.0, -2.0], [0.0, 2.0]])
    (found,) = Superposition.of(Doubt.of(generic, known), ends).rmse_quantiles([share])
    radius = found * np.sqrt(2) / 2
    if deviation is None:  # beyond 1 the square ends before the circle
        corners = 4 * (np.sqrt(max(radius**2 - 1, 0.0)) - radius**2 * np.arccos(min(1 / radius, 1.0)))
        inside = (np.pi * radius**2 + corners) / 4
    else:
        inside = 1 - np.exp(-((1.96 * radius / deviation) ** 2) / 2)
    assert inside == pytest.approx(share, abs=0.02)


def test_a_law_that_the_measurements_do_not_exclude_is_counted(generic: Transmission) -> None:
    """An output that is off by the load-independent friction: 0.1 N by the noise, 3 N by the other law."""
    system = replace(generic, friction=replace(generic.friction, adhesion_N=0.0))
    spread = Spread(keys=("friction.adhesion_N",), low=0.0, high=0.1)
    law = OtherLaw(keys=("friction.adhesion_N", "friction.mu_dynamic"), values=(3.0, 0.1))
    wanted = np.linspace(20.0, 70.0, 11)

    def bands(other: OtherLaw | None) -> ErrorBand:
        doubt = Doubt.of(system, Uncertainty(spread=(spread,), samples=3, other_law=other))
        found = bands_of(
            doubt, wanted, {"x": 0}, lambda each, _: (wanted + each.friction.adhesion_N, False), lambda _: b"", {}
        )
        row = robustness_table(expectation_of(doubt, Level.PRESLIDING, found), {"x": "x"}, 40).rows[0]
        assert row[-1] == ("friction.adhesion_N = 0.1" if other is None else "[robust.other_law]")
        return found["x"]

    alone, both = bands(None), bands(law)
    assert both.expected_rmse == alone.expected_rmse < 0.1
    assert both.likely_rmse == (alone.likely_rmse[0], pytest.approx(3.0))
    assert both.likely_percent[1] == both.worst.rmse_percent_of_range == pytest.approx(6.0)
    assert both.worst_sample.numbers == law.numbers
    assert (alone.hangs_on_the_law, both.hangs_on_the_law) == (False, True)


@pytest.mark.parametrize(
    ("keys", "values", "said"),
    [
        (("mu",), (1.0, 2.0), "1 keys and 2 values"),
        (("friction.mu_dynamc",), (1.0,), 'unknown key "friction.mu_dynamc'),
    ],
)
def test_another_law_without_meaning_is_refused(
    generic: Transmission, keys: tuple[str, ...], values: tuple[float, ...], said: str
) -> None:
    with pytest.raises(ParameterError, match=f"other_law: .*{said}"):
        OtherLaw(keys=keys, values=values).of(generic)


@pytest.mark.parametrize("goals", [1, 2])
def test_a_drive_that_is_late_misses_a_ramp_by_its_speed_times_lag_and_delay(generic: Transmission, goals: int) -> None:
    """Each goal starts at rest: what the one before it did last is no past of it."""
    doubt, step, speed = Doubt.of(generic, Uncertainty(mu=0.1, samples=3)), 1e-3, 7.0
    ramp = np.tile(speed * step * np.arange(20_000), goals)
    band = SimpleNamespace(errors=Superposition.of(doubt, np.zeros((3, len(ramp)))), expected_rmse=0.0)
    found = behind_drives(doubt, ramp, band, step, goals)
    assert [each.kind for each in found] == ["industrial", "dynamixel", "hobby servo"]
    assert [each.worst.rmse for each in found] == pytest.approx([speed * s for s in (0.006, 0.04, 0.085)], rel=3e-3)


def test_what_comes_late_of_a_cycle_is_the_end_of_the_one_before(generic: Transmission) -> None:
    """A sine that is late by t differs from itself by 2 sin(w t/2) at all times, its first rows included."""
    doubt, step, rows = Doubt.of(generic, Uncertainty(mu=0.1, samples=3)), 1e-3, 501
    sine = 3.0 * np.sin(2 * np.pi * np.arange(rows) / (rows - 1))
    band = SimpleNamespace(errors=Superposition.of(doubt, np.zeros((3, rows))), expected_rmse=0.0)
    found = [each.worst.rmse for each in behind_drives(doubt, sine, band, step, periodic=True)]
    wave = 2 * np.pi / (rows - 1) / step
    assert found == pytest.approx(
        [3.0 / np.sqrt(2) * 2 * np.sin(wave * late / 2) for late in (0.006, 0.04, 0.085)], rel=2e-3
    )


@pytest.mark.parametrize(("fine", "said"), [(0.5, False), (math.nan, True)])
def test_waves_that_could_not_be_simulated_are_said_to_be_missing(
    generic: Transmission, fine: float, said: bool
) -> None:
    """The errors are then those of the coarser steps, as they would be without such a drive."""
    doubt, wanted = Doubt.of(generic, Uncertainty(mu=0.1, samples=3)), np.linspace(0.0, 2.0, 5)
    bands = bands_of(
        doubt,
        wanted,
        {"inverse": wanted},
        lambda _, profile: (profile + 0.25, False),
        lambda profile: profile.tobytes(),
        {},
        lambda _, profile: profile + fine,
    )
    found = expectation_of(doubt, Level.PRESLIDING, bands, "range", NEWTON, None)
    assert found.best.nominal.rmse == pytest.approx(0.25 if said else 0.5)
    assert [text for text in found.warnings if "may be too small" in text] == [WITHOUT_WAVES] * said


def test_a_correlation_that_none_can_have_is_refused() -> None:
    with pytest.raises(ParameterError, match="symmetric, with 1 on the diagonal"):
        Correlation(keys=("a", "b", "c"), rows=((1, 0.9, 0.9), (0.9, 1, -0.9), (0.9, -0.9, 1)))
    with pytest.raises(ParameterError, match="rows must be 2 rows of 2 numbers"):
        Correlation(keys=("a", "b"), rows=((1.0,), (0.5, 1.0)))
    for noise in (((1.1, 0.0), (0.0, 0.5)), ((0.5, 0.6), (0.6, 0.5))):
        with pytest.raises(ParameterError, match="noise must be symmetric, with at most 1 on the diagonal"):
            Correlation(keys=("a", "b"), rows=((1.0, 0.5), (0.5, 1.0)), noise=noise)
    with pytest.raises(ParameterError, match="has no interval"):
        replace(MEASURED, spread=()).check_correlation()
