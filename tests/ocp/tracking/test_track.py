"""Optimal profiles against independent answers: the exact inverse, the clipped one, and a finer plant."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.optimal.track import TrackStatus, track
from tendonff.ocp.tendon.inverse import InverseStatus, invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking import search
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.problem import PlantRun, TrackingProblem

Array = NDArray[np.float64]
STEP = 1e-3


def reference(seconds: float = 2.0) -> Array:
    time = np.arange(0.0, seconds + STEP / 2, STEP)
    return 30 + np.minimum(time / 0.5, 1) * (12 * np.sin(np.pi * time) + 5 * np.sin(2.6 * np.pi * time))


def limits(rate: float, least: float = 0.0, most: float = 200.0) -> ForceLimits:
    return ForceLimits(minimum_N=least, maximum_N=most, rate_N_per_s=rate)


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def steady(generic: Transmission) -> Transmission:
    """Without the Stribeck effect, which no feedforward can hold on a stiff bristle."""
    return replace(generic, friction=replace(generic.friction, mu_static=0.2, mu_static_release=0.15))


def problem_of(chain: Chain, bounds: ForceLimits, options: TrackOptions = TrackOptions()) -> TrackingProblem:  # noqa: B008
    """The problem of one chain from rest at 30 N."""
    return TrackingProblem.of(
        (chain,),
        (chain.rest_state(30.0),),
        (reference(),),
        STEP,
        bounds,
        options,
        initial_tension_N=30.0,
        start_N=30.0,
        inverse_N=invert(chain, reference(), STEP).force_N,
    )


def replay(transmission: Transmission, level: Level, force: Array) -> Array:
    """Output of N = 40 at a tenth of the step."""
    coarse, fine = np.arange(len(force)) * STEP, np.arange((len(force) - 1) * 10 + 1) * STEP / 10
    chain = Chain.of(transmission, level, 40)
    run = simulate(chain, np.interp(fine, coarse, force), STEP / 10, initial_tension_N=30.0).require()
    return run.output_tension_N[::10]


def test_where_no_limit_binds_the_optimum_is_the_exact_inverse(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    found = track(chain, reference(), STEP, limits(1e6))
    assert found.status is TrackStatus.EXACT
    assert found.iterations == 0
    assert np.abs(found.force_N - invert(chain, reference(), STEP).force_N).max() < 1e-4
    assert np.abs(found.predicted_output_N - reference()).max() < 1e-4
    assert found.reasons == ()


@pytest.mark.parametrize(
    ("level", "rate"), [(Level.ELASTIC, 300.0), (Level.VISCOELASTIC, 150.0), (Level.PRESLIDING, 150.0)]
)
def test_where_the_rate_binds_the_optimum_leaves_less_on_a_finer_plant(
    generic: Transmission, level: Level, rate: float
) -> None:
    """At most 0.6 of the better of clipped inverse and clipped capstan law, on N = 40 at a tenth of the step."""
    rig, bounds = steady(generic), limits(rate)
    chain = Chain.of(rig, level)
    found = track(chain, reference(), STEP, bounds)
    assert found.status in (TrackStatus.OPTIMAL, TrackStatus.ACCEPTABLE)
    assert found.iterations <= 120
    assert bounds.admits(found.force_N, STEP, 1e-6)
    again = simulate(chain, found.force_N, STEP, initial_tension_N=30.0).output_tension_N
    assert np.abs(again - found.predicted_output_N).max() < 1e-9
    others = (invert(chain, reference(), STEP).force_N, law_of(chain).input_history_N(reference()))
    clipped = min(rms(replay(rig, level, bounds.apply(force, STEP, 30.0)) - reference()) for force in others)
    assert rms(replay(rig, level, found.force_N) - reference()) < 0.6 * clipped


def test_no_small_change_of_the_profile_improves_it(generic: Transmission) -> None:
    """Independent of the descent: random admissible bumps, judged by simulation alone."""
    chain, bounds = Chain.of(steady(generic), Level.PRESLIDING), limits(150.0)
    found, problem = track(chain, reference(), STEP, bounds), problem_of(chain, bounds)
    rng, time = np.random.default_rng(1), np.arange(len(reference())) * STEP
    left = best = evaluate(problem, found.force_N).merit
    for _ in range(60):
        centre, width, height = rng.uniform(0.1, 1.9), rng.uniform(0.02, 0.2), rng.normal(scale=0.5)
        bump = height * np.maximum(1 - np.abs(time - centre) / width, 0)
        other = bounds.apply(found.force_N + bump, STEP, 30.0)
        best = min(best, evaluate(problem, other).merit)
    assert best > 0.94 * left


def test_tension_bounds_hold_anywhere_along_the_tendon(generic: Transmission) -> None:
    chain, bounds = Chain.of(steady(generic), Level.PRESLIDING), limits(2000.0)
    free = track(chain, reference(), STEP, bounds)
    low, high = free.least_tension_N + 2.0, free.largest_tension_N - 5.0
    options = TrackOptions(minimum_tension_N=low, maximum_tension_N=high)
    found = track(chain, reference(), STEP, bounds, options)
    assert found.status in {TrackStatus.OPTIMAL, TrackStatus.ACCEPTABLE}
    tension = simulate(chain, found.force_N, STEP, initial_tension_N=30.0).tension_N
    assert tension[1:].min() >= low * (1 - 1e-6)
    assert tension[1:].max() <= high * (1 + 1e-6)
    assert found.rms_error_N < 0.1 * float(np.ptp(reference()))


def test_impossible_tension_bounds_are_reported_by_name_and_time(generic: Transmission) -> None:
    chain = Chain.of(steady(generic), Level.PRESLIDING)
    found = track(
        chain, reference(0.5), STEP, limits(500.0), TrackOptions(minimum_tension_N=31.0, maximum_tension_N=31.5)
    )
    assert found.status is TrackStatus.INFEASIBLE
    assert "minimum_tension_N = 31" in found.message
    with pytest.raises(SolveError, match="no profile keeps the tension in bounds"):
        found.require()


def test_weight_on_effort_lowers_the_force(generic: Transmission) -> None:
    chain, bounds = Chain.of(steady(generic), Level.PRESLIDING), limits(300.0)
    plain = track(chain, reference(1.0), STEP, bounds)
    thrifty = track(chain, reference(1.0), STEP, bounds, TrackOptions(effort_weight=0.02))
    assert np.mean(thrifty.force_N**2) < 0.99 * np.mean(plain.force_N**2)
    assert thrifty.rms_error_N > plain.rms_error_N


def test_a_reference_beyond_the_actuator_ends_in_numbers_the_user_can_act_on(generic: Transmission) -> None:
    """e^{0.2 * 3.1} = 1.859 and p = 0.5 N: (70 + 0.5)/1.859 - 0.5 = 37.43 N arrive."""
    chain = Chain.of(steady(generic), Level.ELASTIC)
    found = track(chain, reference(1.9), STEP, limits(80.0, least=15.0, most=70.0))
    text = " ".join(found.reasons)
    assert "through e^(mu theta) = 1.86 that needs" in text
    assert "force_max_N is 70: at most 37.43 N arrive by slow pulling, and more only in passing" in text
    assert "force_min_N is 15" in text
    assert "N/s at the actuator, limit 80" in text
    assert "reversals the force must cross the deadband" in text
    assert found.departures
    assert found.status is not TrackStatus.FAILED


def test_pieces_give_the_profile_of_the_whole(generic: Transmission, monkeypatch: pytest.MonkeyPatch) -> None:
    """Predicted outputs differ by less than 1 % of the range rms, the errors left by less than 0.1 %."""
    chain, bounds = Chain.of(steady(generic), Level.PRESLIDING), limits(150.0)
    whole = track(chain, reference(1.4), STEP, bounds)
    monkeypatch.setattr(search, "_KNOTS_ALONE", 0)
    monkeypatch.setattr(search, "_KNOTS_KEPT", 50)
    pieces = track(chain, reference(1.4), STEP, bounds)
    assert whole.windows == 1
    assert pieces.windows > 1
    assert bounds.admits(pieces.force_N, STEP, 1e-6)
    assert rms(whole.predicted_output_N - pieces.predicted_output_N) < 0.01 * float(np.ptp(reference(1.4)))
    assert abs(pieces.rms_error_N - whole.rms_error_N) < 0.001 * float(np.ptp(reference(1.4)))


def test_progress_ends_at_its_total(generic: Transmission) -> None:
    reported: list[tuple[int, int]] = []
    chain = Chain.of(generic, Level.PRESLIDING)
    track(chain, reference(0.5), STEP, limits(100.0), progress=lambda done, total: reported.append((done, total)))
    assert reported[-1][0] == reported[-1][1]


def test_the_same_problem_gives_the_same_profile(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    one, two = (track(chain, reference(0.5), STEP, limits(100.0)) for _ in range(2))
    assert one.force_N.tolist() == two.force_N.tolist()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"effort_weight": -1.0}, "effort_weight must be a finite number >= 0, got -1.0"),
        ({"minimum_tension_N": math.nan}, "minimum_tension_N must be >= 0"),
        ({"max_iterations": 1}, "max_iterations must be a whole number from 3 to 10000, got 1"),
        ({"stiffer_weight": math.inf}, "stiffer_weight must be a finite number >= 0, got inf"),
        ({"travel_weight": -1e-4}, "travel_weight must be a finite number >= 0, got -0.0001"),
    ],
)
def test_bad_options_are_refused_by_name_and_value(options: dict[str, float], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        TrackOptions(**options)  # type: ignore[arg-type]


def test_the_descent_gains_on_the_best_start(generic: Transmission) -> None:
    """Jumps spread astride the reversals are a fair start; the search must leave at most 0.7 of what it leaves."""
    chain, bounds = Chain.of(steady(generic), Level.VISCOELASTIC), limits(500.0)
    problem = problem_of(chain, bounds)
    inverse = invert(chain, reference(), STEP).force_N
    wanted = search.starts(problem, inverse, law_of(chain).input_history_N(reference()))
    assert len(wanted) > 5
    begun = [problem.clipped(force) for force in wanted]
    errors = [rms(simulate(chain, f, STEP, initial_tension_N=30.0).output_tension_N - reference()) for f in begun]
    assert track(chain, reference(), STEP, bounds).rms_error_N < 0.7 * min(errors)


@pytest.mark.compiler
def test_a_start_that_cannot_be_simulated_leaves_the_others(generic: Transmission) -> None:
    """A step of 1e200 N is beyond any solver, and no limit forbids it; the capstan law is a start too."""
    chain = Chain.of(steady(generic), Level.ELASTIC)
    wild = ForceLimits(minimum_N=0.0, maximum_N=1e300, rate_N_per_s=1e300)
    force = np.full(200, 30.0)
    force[100:] = 1e200
    assert len(simulate(chain, force, STEP, initial_tension_N=30.0).tension_N) < 200
    inverse = replace(invert(chain, reference(0.199), STEP), force_N=force, status=InverseStatus.WOULD_PUSH)
    found = track(chain, reference(0.199), STEP, wild, TrackOptions(max_iterations=3), inversion=inverse)
    assert found.rms_error_N < 0.5 * float(np.ptp(reference(0.199)))


def test_where_nothing_can_be_simulated_the_status_says_so(
    generic: Transmission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PlantRun, "respond", lambda *_: None)
    found = track(Chain.of(generic, Level.ELASTIC), reference(0.2), STEP, limits(100.0))
    assert found.status is TrackStatus.FAILED
    with pytest.raises(SolveError, match="no profile could be simulated"):
        found.require()


def test_the_search_leaves_the_threads_of_others_alone(generic: Transmission) -> None:
    threads = pytest.importorskip("threadpoolctl").threadpool_info
    before, seen = threads(), []
    chain = Chain.of(generic, Level.PRESLIDING)
    track(chain, reference(0.5), STEP, limits(100.0), progress=lambda *_: seen.append(threads()))
    assert seen
    assert all(each == before for each in seen)
