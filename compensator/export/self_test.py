"""Data of the shipped self test: sequences with their results, tolerances, bounds and checksums.

Limits, status bits and checksums are computed apart from the C.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.export.golden import LONGER, Course, Golden, respond, servo_of
from tendonff.compensator.export.repeat import InFloat, compared_modules, largest_error
from tendonff.compensator.export.text.parameters import settable_numbers
from tendonff.compensator.export.text.table_index import share_index
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.capstan.spread_bounds import PLAYS
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulation

_FNV_START, _FNV_PRIME, _MASK = 2166136261, 16777619, 0xFFFFFFFF


class Status(IntFlag):
    """Status bits of the exported modules."""

    OK = 0
    INPUT_HELD = 1
    FORCE_LIMITED = 2
    RATE_LIMITED = 4
    WOULD_PUSH = 8
    FAILED = 16
    ENDED = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCase:
    """Call of the limiter."""

    # before_N, wanted_N: last output, and the force that is asked for [N]
    before_N: float
    wanted_N: float
    force_N: float  # what must come out [N]
    status: Status


def limit_cases(low_N: float, high_N: float, change_N: float, precision: Precision) -> list[LimitCase]:
    """Calls of the limiter that reach each of its branches, with the right answers.

    The range is that of the force, the change the largest per sample. The last output is set by hand, so that the rate
    binds also where no course of forces could make it.
    """
    real = np.float32 if precision is Precision.FLOAT else np.float64
    given = (float(np.clip(v, -1e30, 1e30)) for v in (low_N, high_N, change_N))
    low, high, change = (real(float(literal(v, precision).rstrip("f"))) for v in given)  # as the header is read
    span = high - low
    middle = low + real(0.5) * span
    small = real(0.25) * min(change, span)
    far = [low - real(8) * change, high + real(8) * change]
    wanted = [middle, middle + small, middle - small, low, high, low - small, high + small, real(1e29), real(-1e29)]
    wanted += [real(v) for v in (np.nan, np.inf, -np.inf, 3e30, -3e30)]
    cases = []
    for before in (middle, low, high, *far):
        if not abs(before) < real(1e29):
            continue
        for want in wanted:
            force, status = _limited(before, want, low, high, change)
            if abs(force - before) < change * real(0.999) or status & (Status.RATE_LIMITED | Status.FAILED):
                cases.append(
                    LimitCase(before_N=float(before), wanted_N=float(want), force_N=float(force), status=status)
                )
    return cases


def _limited(
    before: np.floating, wanted: np.floating, low: np.floating, high: np.floating, change: np.floating
) -> tuple[np.floating, Status]:
    """The rules of the limiter, stated apart from the template that prints them."""
    if not abs(wanted) <= 1e30:
        force, status = before, Status.FAILED
    else:
        force = min(max(wanted, low), high)
        status = Status.OK if force == wanted else Status.FORCE_LIMITED
    within = min(max(force, before - change), before + change)
    return within, status if within == force else status | Status.RATE_LIMITED


def checksum(values: Iterable[float], precision: Precision) -> int:
    """FNV-1a over the bytes of numbers as C reads their literals, least significant byte first."""
    kind = "<f4" if precision is Precision.FLOAT else "<f8"
    read = [float(literal(float(value), precision).rstrip("f")) for value in values]
    return _fnv(np.asarray(read, dtype=kind).tobytes())


def integer_checksum(values: Iterable[int]) -> int:
    """FNV-1a over integers below 65536 as two bytes each, least significant first."""
    return _fnv(np.asarray(list(values), dtype="<u2").tobytes())


def _fnv(data: bytes) -> int:
    value = _FNV_START
    for byte in data:
        value = ((value ^ byte) * _FNV_PRIME) & _MASK
    return value


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


def self_test_context(
    problem: Problem,
    table: LookupTable | None,
    profile_N: FloatArray,
    golden: Golden,
    precision: Precision,
    found: Sequence[InFloat],
) -> dict[str, object]:
    """Values for the template of the self test.

    There are no answers of the exported code where it was not run.
    """
    actuator, step = problem.transmission.actuator, problem.reference.step_s
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
    compared = {
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
    high, low_end = float(course.reference_N.max()), 1.02 * accepted_range(problem)[0]
    dropped = (np.array([high, drop, drop]) for drop in (low_end, 2 * low_end))  # the second: beyond doubt
    pushes = all((invert(still, fall, step, initial_tension_N=high).least_tension_N <= 0).any() for fall in dropped)
    change = actuator.force_rate_max_N_per_s * step
    ramps = live is not None and bool(np.any(np.abs(np.diff(live.plant_force_N)) > 0.999 * change))
    far = float(course.reference_N[np.argmax(np.abs(course.reference_N - start))])
    return {
        "golden": golden,
        "compared": compared,
        "longer": LONGER,
        "led_to": far if abs(far - start) > 1e-3 * start else None,
        "start_force_N": _start_force_N(problem, start),
        "live_ramps": ramps and servo_of(problem) is None,
        "limit_cases": limit_cases(least, most, change, precision),
        "checksums": {
            "profile": checksum(profile_N, precision),
            **({} if table is None else _table_checksums(table, precision)),
        },
        "tolerances": {
            "position": max(compared["course"]["plant"].tolerance, of_plant_N) / stiffness + _summed_m(ends, precision),
        },
        "jump_bits": {
            name: int(seen(exact.force_N, limited_N, least, most)) if name == "inverse" else 0 for name in jumps.columns
        },
        "plant_ends": (float(ends.near_position_m[-1]), float(ends.far_position_m[-1])),
        "settable": {
            "capstan": (*_bounds(CapstanLaw.of(problem.transmission)), "adhesion"),
            "inverse": ("mu", "adhesion", *settable_numbers(problem)),
        },
        "narrow_N": (least + 0.25 * (min(most, 1e6) - least), least + 0.75 * (min(most, 1e6) - least)),
        "push_N": (high, low_end) if pushes else None,
        "slack_rows": _SLACK_ROWS if slack else 0,
        "slack_drive": lowest,
    }


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


def _table_checksums(table: LookupTable, precision: Precision) -> dict[str, int]:
    """Of shares and ratios of each branch in the order of the C arrays, and of the cells that the C looks up."""
    numbers = {b.value: checksum([*table.branch(b).share, *table.ratio(b).ravel()], precision) for b in Branch}
    cells = {f"{b}_cell": integer_checksum(share_index(table.branch(b).share, precision).cell) for b in Branch}
    return numbers | cells
