import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.compensator.files.reading import InputError, read_csv
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.doubts import largest_tension
from tendonff.compensator.scenario.reference import (
    CsvReference,
    Interpolation,
    Quantity,
    ReferenceSpec,
    Shape,
    SineReference,
    WaypointReference,
)
from tendonff.compensator.scenario.sampled.first_look import first_look
from tendonff.compensator.scenario.sampled.from_file import low_pass, noise_advice, ripple_advice
from tendonff.compensator.scenario.sampled.sampling import (
    Reference,
    initial_tension,
    sample_reference,
)
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Run
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert


@pytest.fixture(scope="module")
def finger(examples: Path) -> Scenario:
    return load_scenario(examples / "finger.toml")


def sampled(scenario: Scenario, spec: ReferenceSpec, step_s: float = 1e-3) -> Reference:
    return sample_reference(replace(scenario, reference=spec, run=Run(step_s=step_s, level=Level.PRESLIDING)))


def test_a_sine_is_the_formula_of_the_contract(finger: Scenario) -> None:
    """T0 + min(t/fade, 1) sum_i a_i sin(2 pi f_i t)."""
    spec = SineReference(
        initial_tension_N=30.0, amplitudes_N=(7.0, -3.0), frequencies_Hz=(0.4, 1.7), duration_s=2.0, fade_in_s=0.5
    )
    reference = sampled(finger, spec)
    assert len(reference.time_s) == 2001
    for k in (0, 1, 137, 500, 2000):
        t = k * 1e-3
        waves = 7 * math.sin(2 * math.pi * 0.4 * t) - 3 * math.sin(2 * math.pi * 1.7 * t)
        assert reference.time_s[k] == t
        assert reference.tension_N[k] == pytest.approx(30 + min(t / 0.5, 1) * waves, rel=1e-14)


def test_a_smooth_fade_has_no_corner_and_is_half_way_in_the_middle(finger: Scenario) -> None:
    """Against 10 u^3 - 15 u^4 + 6 u^5; the linear fade has a corner of amplitude/fade_in_s at its end."""
    fast = {"amplitudes_N": (10.0,), "frequencies_Hz": (5.0,), "duration_s": 1.0, "fade_in_s": 0.45}  # ends on a crest
    linear, smooth = (sampled(finger, SineReference(initial_tension_N=30.0, fade=f, **fast)) for f in Shape)
    u = np.minimum(smooth.time_s / 0.45, 1)
    fade = 10 * u**3 - 15 * u**4 + 6 * u**5
    assert smooth.tension_N == pytest.approx(30 + fade * 10 * np.sin(10 * np.pi * smooth.time_s), abs=1e-12)
    corner = [abs(np.diff(r.tension_N, 2)[449]) / 1e-3 for r in (linear, smooth)]  # jump of the rate at 0.45 s
    assert corner[0] > 20
    assert corner[1] < 11  # what a crest of 10 N at 5 Hz turns in a millisecond: (2 pi 5)^2 10 N/s^2


def test_without_fade_in_a_sine_has_its_full_amplitude_at_once(finger: Scenario) -> None:
    spec = SineReference(
        initial_tension_N=30.0, amplitudes_N=(7.0,), frequencies_Hz=(1.0,), duration_s=1.0, fade_in_s=0.0
    )
    assert sampled(finger, spec).tension_N[250] == pytest.approx(37.0)


@pytest.mark.parametrize(("duration", "step", "rows"), [(0.3, 0.1, 4), (4.0, 1e-3, 4001), (1.0, 0.3, 4), (0.7, 0.1, 8)])
def test_the_grid_ends_at_the_last_whole_step(finger: Scenario, duration: float, step: float, rows: int) -> None:
    spec = SineReference(
        initial_tension_N=30.0, amplitudes_N=(1.0,), frequencies_Hz=(1.0,), duration_s=duration, fade_in_s=0.0
    )
    assert len(sampled(finger, spec, step).time_s) == rows


WAYPOINTS = WaypointReference(times_s=(0.0, 0.7, 1.0, 2.0), tensions_N=(20.0, 40.0, 40.0, 10.0), shape=Shape.SMOOTH)


@pytest.mark.parametrize("shape", Shape)
def test_waypoints_are_met_and_never_overshot(finger: Scenario, shape: Shape) -> None:
    reference = sampled(finger, replace(WAYPOINTS, shape=shape))
    for time, tension in zip(WAYPOINTS.times_s, WAYPOINTS.tensions_N, strict=True):
        assert reference.tension_N[round(time * 1000)] == pytest.approx(tension, rel=1e-12)
    assert reference.tension_N.min() >= 10.0 - 1e-12
    assert reference.tension_N.max() <= 40.0 + 1e-12
    assert reference.initial_tension_N == 20.0


def test_smooth_waypoints_have_continuous_velocity_and_acceleration(finger: Scenario) -> None:
    """The largest jump of the n-th difference quotient shrinks with the step for n = 1, 2."""
    for order in (1, 2):
        jumps = []
        for step in (1e-3, 0.5e-3):
            quotient = np.diff(sampled(finger, WAYPOINTS, step).tension_N, order) / step**order
            jumps.append(np.abs(np.diff(quotient)).max())
        assert jumps[1] < 0.6 * jumps[0]


def csv_reference(folder: Path, time: np.ndarray, tension: np.ndarray, cutoff: float | None = None) -> CsvReference:
    write_csv(folder / "wanted.csv", {"time_s": time, "tension_N": tension})
    return CsvReference(file=str(folder / "wanted.csv"), cutoff_Hz=cutoff)


def test_a_file_without_cut_off_is_taken_as_it_is(finger: Scenario, tmp_path: Path) -> None:
    time = np.array([0.0, 0.013, 0.5, 1.0])
    reference = sampled(finger, csv_reference(tmp_path, time, np.array([20.0, 30.0, 10.0, 40.0])))
    assert reference.tension_N[[0, 13, 500, 1000]] == pytest.approx([20.0, 30.0, 10.0, 40.0], rel=1e-15)
    assert reference.removed_noise_N == 0.0
    assert reference.initial_tension_N == 20.0


@pytest.mark.parametrize("kind", Interpolation)
def test_the_course_between_samples_has_the_continuity_of_its_kind(
    finger: Scenario, tmp_path: Path, kind: Interpolation
) -> None:
    """The largest jump of the rate shrinks with the step for the cubic, and stays for straight lines."""
    time = np.arange(0, 1.01, 0.05)
    spec = replace(csv_reference(tmp_path, time, 30 + 10 * np.sin(2 * np.pi * time)), interpolation=kind)
    jumps = [float(np.abs(np.diff(sampled(finger, spec, step).tension_N, 2)).max() / step) for step in (1e-3, 0.25e-3)]
    assert jumps[1] < 0.3 * jumps[0] if kind is Interpolation.MONOTONE else jumps[1] > 0.9 * jumps[0]


def test_the_cubic_never_leaves_the_range_of_two_samples(finger: Scenario, tmp_path: Path) -> None:
    time = np.array([0.0, 0.1, 0.2, 0.9, 1.0])
    reference = sampled(finger, csv_reference(tmp_path, time, np.array([20.0, 20.0, 60.0, 60.0, 20.0])))
    assert reference.tension_N.min() >= 20.0
    assert reference.tension_N.max() <= 60.0
    assert np.ptp(reference.tension_N[:100]) == 0.0


def test_times_that_seem_to_be_milliseconds_are_asked_about_and_a_named_column_is_the_answer(
    finger: Scenario, tmp_path: Path
) -> None:
    time = np.arange(0, 991.0)
    spec = csv_reference(tmp_path, time, 30 + 5 * np.sin(time / 50))
    with pytest.raises(InputError, match=r"991 rows 1 s apart are 990000 steps .* are the times milliseconds\?"):
        sampled(finger, spec)
    answered = sampled(finger, replace(spec, time_column="time_s"), step_s=0.1)
    assert answered.time_s[-1] == pytest.approx(990.0)


def test_a_long_run_is_announced_with_its_number_of_steps(finger: Scenario) -> None:
    assert first_look(finger) == ()
    long = replace(finger, reference=replace(WAYPOINTS, times_s=(0.0, 1.0, 2.0, 990.0)))
    with pytest.raises(InputError, match=r"990 s in steps of 0\.001 s are 990000 steps.*milliseconds\?"):
        first_look(long)
    assert len(first_look(long, accept=True)) == 1


def test_ripple_of_the_force_rate_is_warned_of_with_straight_lines_and_not_with_the_cubic(
    finger: Scenario, tmp_path: Path
) -> None:
    smooth = sample_reference(finger)
    spec = csv_reference(tmp_path, smooth.time_s[::10], smooth.tension_N[::10])
    force_of = inverse_of(finger)
    found = {}
    for kind in Interpolation:
        reference = sampled(finger, replace(spec, interpolation=kind))
        assert reference.sample_interval_s == pytest.approx(0.01)
        found[kind] = ripple_advice(force_of(reference.tension_N), 1e-3, reference.sample_interval_s, file="wanted.csv")
    assert found[Interpolation.MONOTONE] is None
    assert found[Interpolation.LINEAR] is not None
    assert "within the 0.01 s between two samples" in found[Interpolation.LINEAR]


def test_a_gap_in_a_logged_trace_is_named(finger: Scenario, tmp_path: Path) -> None:
    time = np.delete(np.arange(1001) * 2e-3, slice(400, 550))
    [note] = sampled(finger, csv_reference(tmp_path, time, 30 + 5 * np.sin(2 * np.pi * time))).warnings
    assert note == ("wanted.csv: 1 gap in rows that are 0.002 s apart, the longest from 0.798 to 1.1 s; interpolated")


def test_a_few_rows_written_by_hand_have_no_gaps(finger: Scenario, tmp_path: Path) -> None:
    time, tension = np.array([0.0, 0.1, 0.2, 0.3, 5.0]), np.array([30.0, 35.0, 32.0, 35.0, 30.0])
    assert sampled(finger, csv_reference(tmp_path, time, tension)).warnings == ()


def test_a_cut_off_removes_noise_without_delay_and_says_how_much(finger: Scenario, tmp_path: Path) -> None:
    time = np.arange(4001) * 1e-3
    clean = 30 + 10 * np.sin(2 * np.pi * 0.5 * time)
    noise = np.random.default_rng(3).normal(0, 0.2, len(time))
    reference = sampled(finger, csv_reference(tmp_path, time, clean + noise, cutoff=10.0))
    assert np.std(reference.tension_N - clean) < 0.04
    assert reference.removed_noise_N == pytest.approx(0.2, rel=0.05)
    assert "10 Hz removed 0.19" in reference.warnings[0] or "10 Hz removed 0.2" in reference.warnings[0]


def test_samples_faster_than_the_run_do_not_fold_down(finger: Scenario, tmp_path: Path) -> None:
    """A tone at 95 Hz sampled every 10 ms would appear at 5 Hz."""
    time = np.arange(4001) * 1e-3
    slow = 30 + 10 * np.sin(2 * np.pi * 0.25 * time)
    tone = 5 * np.sin(2 * np.pi * 95 * time)
    reference = sampled(finger, csv_reference(tmp_path, time, slow + tone, cutoff=8.0), step_s=1e-2)
    assert np.abs(reference.tension_N - slow[::10])[30:-30].max() < 0.1


def test_a_cut_off_beyond_the_sampling_rate_is_refused(finger: Scenario, tmp_path: Path) -> None:
    spec = csv_reference(tmp_path, np.array([0.0, 1.0]), np.array([20.0, 30.0]), cutoff=500.0)
    with pytest.raises(InputError, match=r"cutoff_Hz must be < 500 .half the sampling rate., got 500"):
        sampled(finger, spec)


@given(level=st.floats(1.0, 100.0), cutoff=st.floats(1.0, 400.0))
def test_the_low_pass_leaves_a_constant_alone(level: float, cutoff: float) -> None:
    assert low_pass(np.full(500, level), cutoff, 1000.0) == pytest.approx(np.full(500, level), rel=1e-9)


def test_the_low_pass_halves_the_amplitude_at_its_cut_off() -> None:
    """Twice -3 dB, forwards and backwards."""
    wave = np.sin(2 * np.pi * 10 * np.arange(4000) * 1e-3)
    assert np.abs(low_pass(wave, 10.0, 1000.0)[1000:3000]).max() == pytest.approx(0.5, rel=0.01)


def test_an_initial_tension_that_differs_is_kept_and_noted(finger: Scenario) -> None:
    reference = sampled(finger, replace(WAYPOINTS, initial_tension_N=25.0))
    assert reference.initial_tension_N == 25.0
    assert "starts at 20 N but initial_tension_N is 25 N" in reference.warnings[0]


def test_a_reference_below_zero_is_refused_with_its_time(finger: Scenario) -> None:
    spec = SineReference(
        initial_tension_N=5.0, amplitudes_N=(10.0,), frequencies_Hz=(1.0,), duration_s=1.0, fade_in_s=0.0
    )
    with pytest.raises(InputError, match=r"finger\.toml \[reference\]: .* above 0, got -5 N at t = 0.75 s; a tendon"):
        sampled(finger, spec)


def test_the_largest_tension_is_the_capstan_law_with_adhesion(finger: Scenario) -> None:
    """(F_max + p) e^{-mu theta} - p."""
    transmission = replace(finger.transmission, friction=replace(finger.transmission.friction, adhesion_N=3.0))
    assert largest_tension(transmission) == pytest.approx(203 * math.exp(-0.2 * math.pi) - 3, rel=1e-12)


@pytest.mark.parametrize(("share", "fits"), [(0.999, True), (1.001, False)])
def test_a_reference_beyond_reach_is_said_in_one_line_and_refused_only_if_strict(
    finger: Scenario, share: float, fits: bool
) -> None:
    """What the peak needs is T e^{mu theta}."""
    top = share * largest_tension(finger.transmission)
    posed = replace(finger, reference=replace(WAYPOINTS, tensions_N=(20.0, top, top, 10.0)))
    if fits:
        assert sample_reference(posed, strict=True).warnings == ()
        return
    line = (
        "finger.toml [reference]: the peak of 106.8 N at t = 0.7 s needs 200.2 N through the friction, "
        "force_max_N = 200 delivers at most 106.7 N by slow pulling, and more only in passing; lower the reference or "
        "raise force_max_N"
    )
    assert sample_reference(posed).warnings == (line,)
    with pytest.raises(InputError, match=re.escape(line)):
        sample_reference(posed, strict=True)


def test_a_step_longer_than_the_reference_is_refused(finger: Scenario) -> None:
    with pytest.raises(InputError, match=r"\[run\]: step_s must be <= the length of the reference, 2 s, got 3"):
        sampled(finger, WAYPOINTS, 3.0)
    with pytest.raises(InputError, match="makes more than 50000000 steps"):
        sampled(finger, WAYPOINTS, 1e-12)


def test_a_sine_too_fast_for_the_step_is_refused_instead_of_folded_down(finger: Scenario) -> None:
    fast = SineReference(
        initial_tension_N=30.0, amplitudes_N=(5.0, 1.0), frequencies_Hz=(1.0, 500.0), duration_s=0.5, fade_in_s=0.1
    )
    with pytest.raises(InputError, match=r"must be < 500 .*, got 500; use a step of 4e-05 s or less: step_s"):
        sampled(finger, fast)


@pytest.mark.parametrize("name", ["finger", "bowden", "surgical", "finger_fast", "finger_stribeck"])
def test_every_example_can_be_delivered(examples: Path, name: str) -> None:
    scenario = load_scenario(examples / f"{name}.toml")
    assert sample_reference(scenario).initial_tension_N == initial_tension(scenario)


# --- noise


def inverse_of(scenario: Scenario) -> Callable[[np.ndarray], np.ndarray]:
    chain = Chain.of(scenario.transmission, Level.PRESLIDING)
    return lambda tension: invert(chain, tension, 1e-3).force_N


def noisy(noise_N: float) -> Reference:
    time = np.arange(4001) * 1e-3
    tension = 30 + 10 * np.sin(2 * np.pi * 0.5 * time) + np.random.default_rng(5).normal(0, noise_N, len(time))
    return Reference(time_s=time, tension_N=tension, step_s=1e-3, initial_tension_N=30.0)


def test_a_cut_off_is_proposed_that_quietens_the_force(finger: Scenario) -> None:
    force_of = inverse_of(finger)
    advice = noise_advice(noisy(0.3).tension_N, 1e-3, force_of, file="wanted.csv")
    assert advice is not None
    said = re.fullmatch(r"wanted\.csv: noise of ([\d.]+) N RMS .* set cutoff_Hz = ([\d.]+) in \[reference\].*", advice)
    assert said is not None
    assert float(said[1]) == pytest.approx(0.3, rel=0.1)
    quiet = force_of(noisy(0.0).tension_N)
    advised = force_of(low_pass(noisy(0.3).tension_N, float(said[2]), 1000.0))
    raw = force_of(noisy(0.3).tension_N)
    assert np.std(advised - quiet) < 0.2 * np.std(raw - quiet)


def test_a_clean_reference_gets_no_advice(finger: Scenario) -> None:
    assert noise_advice(noisy(0.0).tension_N, 1e-3, inverse_of(finger), file="wanted.csv") is None


def test_noise_that_the_force_does_not_feel_gets_no_advice() -> None:
    assert noise_advice(noisy(0.05).tension_N, 1e-3, lambda tension: 2 * tension, file="wanted.csv") is None


def test_a_measured_trace_becomes_a_reference(finger: Scenario, measured_data: Path, tmp_path: Path) -> None:
    path = measured_data / "band_capstan" / "dataset4_harmonic.csv"
    columns = read_csv(path, ("time_s", "output_tension_N"))
    trace = columns["output_tension_N"]
    scaled = 10 + 40 * (trace - trace.min()) / np.ptp(trace)
    spec = csv_reference(tmp_path, columns["time_s"], scaled, cutoff=20.0)
    reference = sampled(finger, spec)
    assert 0 < reference.removed_noise_N < 2.0
    assert reference.tension_N.min() > 5.0


# --- what else a reference may say


def test_a_reference_that_touches_zero_is_lifted_smoothly_and_says_so(finger: Scenario) -> None:
    touching = WaypointReference(times_s=(0.0, 0.5, 1.0), tensions_N=(0.0, 50.0, 0.0), shape=Shape.SMOOTH)
    default, chosen = sampled(finger, touching), sampled(finger, replace(touching, least_tension_N=4.0))
    assert default.tension_N.min() == pytest.approx(1.0, rel=0.1)  # 2 % of the range
    assert chosen.tension_N.min() == pytest.approx(4.0, rel=0.1)
    assert chosen.tension_N.min() >= 4.0
    assert chosen.initial_tension_N == chosen.tension_N.min()
    assert chosen.tension_N.max() == pytest.approx(50.0, rel=1e-3)
    assert "falls to 0 N and is raised to 4.24 N (least_tension_N) in " in chosen.warnings[0]
    assert "(least_tension_N, default 2 % of range)" in default.warnings[0]
    assert chosen.name == "reference raised to 4.24 N"
    assert sampled(finger, WAYPOINTS).name == "reference"


def test_a_reference_that_stays_above_zero_is_not_lifted(finger: Scenario) -> None:
    assert np.array_equal(
        sampled(finger, replace(WAYPOINTS, least_tension_N=5.0)).tension_N, sampled(finger, WAYPOINTS).tension_N
    )


def test_a_cycle_that_does_not_close_is_refused(finger: Scenario) -> None:
    with pytest.raises(InputError, match="starts at 20 and ends at 10; let one period end where it starts"):
        sampled(finger, replace(WAYPOINTS, periodic=True))
    closed = sampled(finger, replace(WAYPOINTS, tensions_N=(20.0, 40.0, 40.0, 20.0), periodic=True))
    assert closed.tension_N[0] == closed.tension_N[-1]


def test_a_wanted_position_asks_for_the_tension_of_the_loads_balance(finger: Scenario) -> None:
    """At rest in the new place T = T0 + k_l q."""
    wanted = WaypointReference(
        times_s=(0.0, 0.5, 1.0),
        positions_m=(0.0, 0.004, 0.004),
        shape=Shape.SMOOTH,
        quantity=Quantity.POSITION,
        initial_tension_N=30.0,
    )
    reference = sampled(finger, wanted)
    assert reference.position_m is not None
    assert reference.position_m[-1] == 0.004
    assert reference.tension_N[-1] == pytest.approx(30.0 + 0.004 * finger.transmission.load.stiffness_N_per_m)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"quantity": Quantity.POSITION}, 'positions_m is missing: quantity = "position" asks for it'),
        ({"positions_m": (0.0, 0.0, 0.0, 0.0)}, 'positions_m is not for quantity = "tension"; give tensions_N alone'),
        (
            {"quantity": Quantity.POSITION, "tensions_N": None, "positions_m": (0.0, 0.0, 0.0, 0.0)},
            "initial_tension_N is missing",
        ),
        ({"least_tension_N": 0.0}, "least_tension_N must be a finite number > 0, got 0"),
    ],
)
def test_what_does_not_fit_the_quantity_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        replace(WAYPOINTS, **changes)
