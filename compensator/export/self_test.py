"""The shipped self test of a tension's modules: sequences with their results, tolerances, and what is lost in float."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import StreamDesign
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.export.golden import Course, Golden, respond, servo_of
from tendonff.compensator.export.modules import BOUNDS, OBSERVER
from tendonff.compensator.export.observer import ObserverGolden
from tendonff.compensator.export.repeat import InFloat, compared, compared_modules, largest_error
from tendonff.compensator.export.script import Script
from tendonff.compensator.export.tension.checks import check_all
from tendonff.compensator.export.tension.data import limit_cases
from tendonff.compensator.export.tension.estimating import ObserverTest, check_adaptive, check_bounds, check_observer
from tendonff.compensator.export.tension.following import Status
from tendonff.compensator.export.tension.subject import TensionTest
from tendonff.compensator.export.text.parameters import settable_numbers
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.capstan.spread_bounds import PLAYS
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulation


def seen(force_N: FloatArray, limited_N: FloatArray, low_N: float, high_N: float) -> Status:
    """Bits that a course must have set, from its forces before and after the limits.

    Those beyond doubt, a hundredth of the range past the bound.
    """
    margin = 0.01 * min(high_N - low_N, 1e6)
    found = Status.OK
    if np.any((force_N > high_N + margin) | (force_N < low_N - margin)):
        found |= Status.FORCE_LIMITED
    if np.any(np.abs(np.clip(force_N, low_N, high_N) - limited_N) > margin):
        found |= Status.RATE_LIMITED
    return found


_SLACK_ROWS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatLoss:
    """Error of a module in single precision along the golden sequence."""

    module: str
    # rms_N, peak_N: difference from the model in double precision [N]
    rms_N: float
    peak_N: float
    percent_of_range: float  # the root mean square over the range of the course [%]


def float_losses(course: Course, found_N: Mapping[str, FloatArray], problem: Problem) -> tuple[FloatLoss, ...]:
    """Error of each module in single precision, from the outputs of the exported code on the sequence [N].

    Commands [m] count as the tension that they are worth at rest.
    """
    losses = []
    for module, found in found_N.items():
        error = (found - course.columns[module]) / (1.0 if module in ("plant", "observer") else per_newton(problem))
        rms = float(np.sqrt(np.mean(error**2)))
        losses.append(
            FloatLoss(
                module=module,
                rms_N=rms,
                peak_N=float(np.abs(error).max()),
                percent_of_range=100 * rms / scale_of(course.reference_N),
            )
        )
    return tuple(losses)


def per_newton(problem: Problem) -> float:
    """Change of the command for one newton more at rest: 1, or that of a position drive [m/N]."""
    stiffness = servo_of(problem)
    return 1.0 if stiffness is None else problem.chain.rest_state(1.0).near_position_m + 1 / stiffness


def loss_warnings(losses: Sequence[FloatLoss]) -> tuple[str, ...]:
    """Losses above 0.1 % of range, with the way out."""
    return tuple(
        f"{loss.module} in float departs from the model by {loss.rms_N:.2g} N RMS ({loss.percent_of_range:.2g} % of "
        f"range), {loss.peak_N:.2g} N at most: use --precision double, or a larger step_s or fewer segments"
        for loss in losses
        if not loss.percent_of_range <= 0.1
    )


def tension_test(
    problem: Problem,
    table: LookupTable | None,
    profile_N: FloatArray,
    golden: Golden,
    stream: StreamDesign | None,
    script: Script,
    names: Sequence[str],
    found: Sequence[InFloat],
) -> TensionTest:
    """The self test of the modules of these names, before its checks are made.

    There are no answers of the exported code where it was not run.
    """
    actuator, step, precision = problem.transmission.actuator, problem.reference.step_s, script.precision
    course, jumps, live, other = golden.course, golden.jumps, golden.live, golden.other
    start = float(course.reference_N[0])
    force = course.plant_force_N[: len(course.columns["plant"])]
    ends = respond(problem, force, start, course.chain).require()
    still = course.chain.at_rest()
    unit = per_newton(problem)
    lowest, rest = (-start, start) if servo_of(problem) is None else (-3 * start * unit, 0.0)
    pushed = respond(problem, np.append(rest, np.full(_SLACK_ROWS, lowest)), start, still)
    slack = len(pushed.tension_N) > _SLACK_ROWS and float(pushed.output_tension_N[-1]) <= 0
    stiffness = min(problem.transmission.load.stiffness_N_per_m, problem.transmission.tendon.stiffness_N_per_m)
    span = scale_of(problem.reference.tension_N)
    rows = {
        "course": compared_modules(course, precision, [run.course for run in found], unit, span),
        "jumps": compared_modules(jumps, precision, [run.jumps for run in found], unit, span, neighbours=1),
        "live": {} if live is None else compared_modules(live, precision, [run.live for run in found], unit, span),
        "other": {}
        if other is None
        else compared_modules(other.course, precision, [run.other for run in found], unit, span),
        "longer": {}
        if golden.longer is None or precision is Precision.FLOAT
        else compared_modules(golden.longer, precision, (), unit, span),
    }
    of_plant_N = largest_error(course.columns["plant"], [run.course["plant"] for run in found])
    least, most = actuator.force_min_N, actuator.force_max_N
    exact = invert(jumps.chain, jumps.reference_N, step, initial_tension_N=float(jumps.reference_N[0]))
    limited_N = problem.limits.apply(exact.force_N, step, float(jumps.reference_N[0]))  # columns may be commands [m]
    change = actuator.force_rate_max_N_per_s * step
    ramps = live is not None and bool(np.any(np.abs(np.diff(live.plant_force_N)) > 0.999 * change))
    far = float(course.reference_N[np.argmax(np.abs(course.reference_N - start))])
    off_N = max(rows["course"]["plant"].tolerance, of_plant_N)
    return TensionTest(
        problem=problem,
        names=names,
        script=script,
        golden=golden,
        compared=rows,
        table=table,
        profile_N=profile_N,
        stream=stream,
        limit_cases=limit_cases(least, most, change, precision),
        jump_bits={
            name: int(seen(exact.force_N, limited_N, least, most)) if name == "inverse" else 0 for name in jumps.columns
        },
        led_to_N=far if abs(far - start) > 1e-3 * start else None,
        narrow_N=(least + 0.25 * (min(most, 1e6) - least), least + 0.75 * (min(most, 1e6) - least)),
        push_N=_push_N(problem, course, still),
        start_force_N=_start_force_N(problem, start),
        live_ramps=ramps and servo_of(problem) is None,
        plant_ends_m=(float(ends.near_position_m[-1]), float(ends.far_position_m[-1])),
        position_m=off_N / stiffness + _summed_m(ends, precision),
        slack_rows=_SLACK_ROWS if slack else 0,
        slack_drive=lowest,
        settable={
            "capstan": (*_bounds(CapstanLaw.of(problem.transmission)), "adhesion"),
            "inverse": ("mu", "adhesion", *settable_numbers(problem)),
        },
    )


def observer_test(seen: ObserverGolden, most_N: float, precision: Precision, found: Sequence[InFloat]) -> ObserverTest:
    """Golden vectors of the observer; there are no answers of the exported code where it was not run."""
    for run in found:
        seen = seen.as_far_as(run.course[OBSERVER.name][: len(seen.output_N)], most_N)
    answered = [run.course[OBSERVER.name][: len(seen.output_N)] for run in found]
    far = [run.far.get(OBSERVER.name, np.empty(0))[: len(seen.far_output_N)] for run in found]
    scale = float(seen.input_N.max())
    rows = compared(seen.output_N, scale, most_N, precision, answered)
    of_bounds = 3 * rows.tolerance
    return ObserverTest(
        golden=seen,
        compared=rows,
        far=compared(seen.far_output_N, 10 * scale, most_N, precision, far),
        bounds_N=min(of_bounds, most_N) if answered else of_bounds,
    )


def check_tension(test: TensionTest, observer: ObserverTest, adaptive: Mapping[str, Any] | None) -> list[str]:
    """Make all checks of the exported modules; sequences of which only some rows are compared, in words."""
    check_all(test)
    if OBSERVER.name in test.names:
        check_observer(test, observer)
    if adaptive is not None:
        check_adaptive(test, adaptive)
        if BOUNDS.name in test.names:
            check_bounds(test, adaptive)
    return _fewer_rows(test, observer, adaptive)


def _fewer_rows(test: TensionTest, observer: ObserverTest, adaptive: Mapping[str, Any] | None) -> list[str]:
    """Sequences of which the self test compares only some rows, in words."""
    courses = {"course": "", "jumps": " on jumps", "other": " with other friction", "live": ""}
    every = {
        f"{name}{words}": rows
        for course, words in courses.items()
        for name, rows in test.compared[course].items()
        if name in test.names
    }
    if OBSERVER.name in test.names:
        every |= {"observer": observer.compared, "observer with a far end that is moved": observer.far}
    every |= {} if adaptive is None else {"adaptive": adaptive["compared"]}
    means = {name: f" as means of {rows.mean_of} rows" if rows.mean_of > 1 else "" for name, rows in every.items()}
    return [
        f"{rows.rows} of {len(rows.expected)} rows of {name}{means[name]}" for name, rows in every.items() if rows.words
    ]


def _push_N(problem: Problem, course: Course, still: Chain) -> tuple[float, float, int] | None:
    """References of a fall that no tendon follows, and the sample after it in which it pushes most."""
    high, low_end = float(course.reference_N.max()), 1.02 * accepted_range(problem)[0]
    falls = [
        invert(still, np.array([high, drop, drop]), problem.reference.step_s, initial_tension_N=high).least_tension_N
        for drop in (low_end, 2 * low_end)  # the second: beyond doubt
    ]
    row = int(np.argmin(falls[1][1:]))
    return (high, low_end, row) if all(fall[1 + row] <= 0 for fall in falls) else None


def _summed_m(run: Simulation, precision: Precision) -> float:
    """Bound of accumulated rounding in a position, which is the sum of one change a row [m]."""
    if precision is Precision.DOUBLE:
        return 0.0
    largest = max(float(np.abs(end).max()) for end in (run.near_position_m, run.far_position_m))
    return len(run.time_s) * float(np.finfo(np.float32).eps) / 2 * largest


def _start_force_N(problem: Problem, start_N: float) -> tuple[float, float] | None:
    """Tension, and a force half way to full slip at it [N]; None where a start in motion does not know the friction."""
    chain, actuator = problem.chain, problem.transmission.actuator
    slack = chain.rest_state(0.0).vector()[: chain.layout.part("q_a").start]
    if not chain.drive.is_ideal or chain.layout.friction_states != ("f_s",) or np.any(slack):
        return None
    law = CapstanLaw.of(problem.transmission)
    force = start_N + 0.5 * (start_N + law.adhesion_N) * math.expm1(law.pull_exponent)
    if law.load_exponent:
        force = 0.5 * (start_N + float(law.input_for_N(start_N, Branch.PULL)))
    inside = all(actuator.force_min_N < at < actuator.force_max_N for at in (start_N, force))
    return (start_N, force) if inside else None


def _bounds(law: CapstanLaw) -> tuple[str, ...]:
    """Members of the capstan law's state that follow from the coefficients."""
    if law.plays is None:
        return "pull", "release"
    return tuple(f"{side}[{k}]" for side in ("low", "high") for k in (0, PLAYS - 1))
