"""Search for the numbers of a mechanism: of a loop with the effects that logs ask for, of several motors at once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.motors.alternatives import (
    ALTERNATIVES,
    STEPS,
    WIDER,
    Alternative,
    Tried,
    gain_of,
    spanned,
    started,
    with_alternatives,
)
from tendonff.compensator.identification.motors.estimates import Found
from tendonff.compensator.identification.motors.first_look import FirstLook
from tendonff.compensator.identification.motors.law import (
    EFFECT_SHARE,
    FINE_MASSES,
    MechanismLaw,
    covariance_of,
    promises,
    reach_rad,
)
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.motors.numbers import told_N
from tendonff.compensator.identification.parameters import EXTRAS, OF_TENDONS, PARTNERS, Parameter
from tendonff.compensator.identification.searches import Role
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Solution, after_a_step

N = Parameter

LEAST_TENSION_N = 0.1
HELD_OUT_S = 2.0
"""Stretches of a log that are fitted and held out in turn: longer than a reversal, shorter than a level of tension."""

STOP_STIFFNESS_N_M_PER_RAD = 100.0
"""Of a stop that the scenario does not have, before the fit."""

_BY_REVERSALS = (N.MU, N.TENSION, N.STIFFNESS, N.BRISTLE, N.COULOMB, N.GEAR_SLIP)
"""Numbers that only the slope of the torque at reversals separates, if neither a stop nor an encoder does."""

STEEP_EXPONENT, MORE_THAN_NOISE = 1.1, 2.0
"""mu theta of a second search where the first one found no slack, or leaves so many times the noise."""

IN_COUNTS = 1.1
"""Factor by which the law of a motor that moves in counts leaves less, by the slopes of one step and in the end."""

MOST_EXTRAS = 3
FIRST_STEPS, FINE_STEPS = 3, 3
"""Evaluations of each start, of which the best goes on, and on the finer mechanism."""

FINE_PARTS = 2
"""Steps of the last simulations in one row."""

FIRST_OF_SEVERAL, STEPS_OF_SEVERAL = 8, 40
"""The same of several motors: dry friction of the motors and mu part slowly, in up to 30 steps."""


def fit_several(finger: Finger, logs: Sequence[MotorsLog], say: Callable[[str], None]) -> Found:
    """All numbers of a mechanism whose motors each feel their own."""
    coarse = MechanismLaw(mechanism=that_may_stiffen(finger, logs), logs=logs)
    say("whole mechanism")
    start = {n.name: n.start for n in coarse.numbers.values() if n.search.role in (Role.CORE, Role.START)}
    solution = coarse.fit(start, most=FIRST_OF_SEVERAL)
    say("finer mechanism")
    law = replace(coarse, segments=FINE_MASSES, refinement=FINE_PARTS)
    solution = law.fit(solution.values, most=STEPS_OF_SEVERAL)
    promised = promises(law, solution, OF_TENDONS)
    tried = {n: (each.gain, False) for n, each in promised.items()}
    if promised[N.STIFFENING].gain >= max(TUNED.worth_a_constant, *(each.gain for each in promised.values())):
        say(f"with {N.STIFFENING.spec.effect}")
        more = law.fit({**solution.values, N.STIFFENING: EFFECT_SHARE}, most=STEPS_OF_SEVERAL)
        if _better_unseen(law, more, solution):
            solution, tried[N.STIFFENING] = more, (promised[N.STIFFENING].gain, True)
            promised = promises(law, solution, OF_TENDONS)
    if N.STIFFENING not in solution.values:
        law = replace(law, mechanism=finger)
    lacking = {n: each for n, each in promised.items() if each.gain >= TUNED.worth_a_constant}
    found = Found(
        law=law,
        solution=solution,
        covariance=covariance_of(law, solution),
        tried=tuple((n, gain, taken) for n, (gain, taken) in tried.items()),
        lacking=tuple(lacking),
    )
    shifts = [each.shift / found.reach for each in lacking.values()]
    wider: Array = sum((np.outer(s, s) for s in shifts), start=found.covariance)
    return replace(found, covariance=wider)


def that_may_stiffen(finger: Finger, logs: Sequence[MotorsLog]) -> Finger:
    """The mechanism with a tension from which stiffness may grow, which the scenario states or the logs show."""
    tensions = [tension for _, _, tension in told_N(finger.motors, logs)]
    usual = max(float(np.mean(tensions)) if tensions else 0.0, LEAST_TENSION_N)
    tendons = tuple(
        replace(each, tendon=replace(each.tendon, stiffening=0.0, stiffening_tension_N=usual))
        if each.tendon.stiffening is None
        else each
        for each in finger.tendons
    )
    return replace(finger, tendons=tendons)


def _better_unseen(law: MechanismLaw, more: Solution, fewer: Solution) -> bool:
    """Whether a solution of more numbers has the smaller error in stretches of the logs that neither was fitted to."""

    def off(solution: Solution, even: int) -> float:
        seen, unseen = (
            replace(law, logs=[replace(log, counted=log.counted & _in_turn(log, way)) for log in law.logs])
            for way in (even, 1 - even)
        )
        values = seen.fit(solution.values, most=FIRST_OF_SEVERAL).values
        return float(np.sum(np.log1p(unseen.weighted(values) ** 2)))

    return sum(off(more, k) for k in (0, 1)) < sum(off(fewer, k) for k in (0, 1))


def _in_turn(log: MotorsLog, even: int) -> Mask:
    """Rows of every other stretch of a log."""
    rows: Mask = (log.time_s // HELD_OUT_S).astype(int) % 2 == even
    return rows


def with_stops(
    mechanism: Mechanism, looks: Sequence[FirstLook], start_rad: float
) -> tuple[Mechanism, tuple[Parameter, ...]]:
    """The mechanism with those stops alone that were touched, and the numbers of these."""
    ways = {push.way for found in looks for push in found.pushes}
    joint, stops = mechanism.joint, {"stop_low_rad": -1, "stop_high_rad": 1}
    start = next((found.start(mechanism, start_rad) for found in looks if found.pushes), {})
    places = {
        name: (getattr(joint, name) if getattr(joint, name) is not None else start.get(N(name), float(way)))
        if way in ways
        else None
        for name, way in stops.items()
    }
    return _stopped(mechanism, places)


def with_own_stops(mechanism: Mechanism, logs: Sequence[MotorsLog]) -> tuple[Mechanism, tuple[Parameter, ...]]:
    """The mechanism with the stops of the scenario that its motor reaches, and the numbers of these."""
    joint, (low, high) = mechanism.joint, reach_rad(mechanism, logs)
    places = {
        "stop_low_rad": None if joint.stop_low_rad is None or joint.stop_low_rad <= low else joint.stop_low_rad,
        "stop_high_rad": None if joint.stop_high_rad is None or joint.stop_high_rad >= high else joint.stop_high_rad,
    }
    return _stopped(mechanism, places)


def _stopped(mechanism: Mechanism, places: Mapping[str, float | None]) -> tuple[Mechanism, tuple[Parameter, ...]]:
    """The mechanism with these stops alone, and their numbers."""
    numbers = tuple(N(name) for name, place in places.items() if place is not None)
    stiffness = (mechanism.joint.stop_stiffness_N_m_per_rad or STOP_STIFFNESS_N_M_PER_RAD) if numbers else 0.0
    joint = replace(mechanism.joint, **places, stop_stiffness_N_m_per_rad=stiffness)  # type: ignore[arg-type]
    return replace(mechanism, joints=(joint,)), (*numbers, N.STOP_STIFFNESS) if numbers else ()


def fit_loop(
    mechanism: Mechanism,
    logs: Sequence[MotorsLog],
    looks: Sequence[FirstLook],
    touched: tuple[Parameter, ...],
    say: Callable[[str], None],
) -> Found:
    """The law that explains the logs best."""
    free = [N.MU, N.TENSION, N.STIFFNESS, N.BRISTLE, N.COULOMB, N.GEAR_SLIP, *touched]
    if mechanism.joint.gravity_N_m:
        free.append(N.GRAVITY)
    kept, note = dict[str, float](), ""
    if not touched:
        kept, note = {N.MU: N.MU.of(mechanism)}, "no push against a stop in these files"
    not_identifiable: tuple[Parameter, ...] = ()
    if not touched and not any(log.encoders.any() for log in logs):
        not_identifiable = _BY_REVERSALS
        note = "neither a push against a stop nor the angle of the joint in these files"
    law = MechanismLaw(mechanism=mechanism, logs=logs, fixed=kept)
    say("whole mechanism")
    encoded = all(log.encoders.all() for log in logs)
    begun = replace(law, logs=logs[:1]) if encoded else law  # whether anything explains the torque, one file shows
    solution = _from_starts(begun, free, looks)
    if encoded and begun.percent(solution.values) > 2 * TUNED.poor_percent:
        return Found(law=law, solution=solution, covariance=np.full((len(solution.values),) * 2, np.inf))
    if len(begun.logs) < len(logs):
        solution = law.fit(solution.values, most=STEPS)
    some = (N.OFFSET,) if not_identifiable else EXTRAS
    law, solution, tried = _searched(law, solution, some, say)
    if touched and _astray(law, solution):  # other laws bend a push as well
        law, solution, tried = _searched_again((law, solution, tried), free, looks, some, say)
    if touched and not _slack(law, solution):
        note = "the pushes end before a tendon is slack"
        law = replace(law, fixed={N.MU: N.MU.of(mechanism)}, as_read=False)
        law, solution, tried = _searched(law, _from_starts(law, free, looks), some, say)
    alternatives: dict[Parameter, Alternative] = {}
    if touched and N.MU not in law.fixed:
        solution, tried, alternatives = with_alternatives(law, solution, tried, say)
    say("finer mechanism")
    fine = replace(law, segments=FINE_MASSES, refinement=FINE_PARTS)
    before, solution = solution, fine.fit(solution.values, most=FINE_STEPS)
    covariance = covariance_of(fine, solution)
    reached = {n: spanned(solution, covariance, [each], before) for n, each in alternatives.items()}
    return Found(
        law=fine,
        solution=solution,
        covariance=spanned(solution, covariance, list(alternatives.values()), before),
        tried=tried,
        kept_because=note,
        not_identifiable=not_identifiable,
        alternatives=tuple(
            n for n, wide in reached.items() if (np.diag(wide) > WIDER**2 * np.diag(covariance))[:3].any()
        ),
    )


_Search = tuple[MechanismLaw, Solution, Tried]


def _searched(law: MechanismLaw, solution: Solution, some: Sequence[Parameter], say: Callable[[str], None]) -> _Search:
    """The law of a smooth motor or of one that moves in counts, with the effects that the data support.

    Counts take the place of an effect that is still missing, so they are compared once both laws have theirs.
    """
    counted = in_counts(law, solution)
    begun = [(law, solution)] if counted[0] is law else [(law, solution), counted]
    return min(((each, *_with_extras(each, one, some, say)) for each, one in begun), key=lambda search: search[1].cost)


def _searched_again(
    before: _Search,
    free: Sequence[Parameter],
    looks: Sequence[FirstLook],
    some: Sequence[Parameter],
    say: Callable[[str], None],
) -> _Search:
    """The best of a search and of those from a steep start, then with effects that others have taken the place of."""
    smooth, steep = replace(before[0], as_read=False), [replace(found, exponent=STEEP_EXPONENT) for found in looks]
    again = smooth, *_with_extras(smooth, _from_starts(smooth, free, steep), some, say)
    best = min(before, again, key=lambda search: search[1].cost)
    for effect in ALTERNATIVES:
        law, solution, _ = best
        if effect in solution.values or not _astray(law, solution):
            continue
        say(f"with {effect.spec.effect}")
        try:
            begun = smooth.fit(started(smooth, _starts(smooth, free, steep)[-1], effect), most=2 * STEPS)
        except SolveError:
            continue
        more, tried = _with_extras(smooth, begun, some, say)
        if (gain := gain_of(solution, more)) >= TUNED.worth_a_constant:
            best = smooth, more, (*tried, (effect, gain, True))
    return best if best is before else (*in_counts(*best[:2]), best[2])


def in_counts(law: MechanismLaw, solution: Solution) -> tuple[MechanismLaw, Solution]:
    """The same, or the law of a motor that goes from count to count, where that explains the logs clearly better.

    Such a motor shakes a light joint, and its tendons give friction away wherever it is slow.
    """
    if not any(log.run.in_counts for log in law.logs):
        return law, solution
    counted = replace(law, as_read=True)
    try:
        begun = counted.evaluate(solution.values, list(solution.values))
        if IN_COUNTS * after_a_step(begun) > solution.cost:
            return law, solution
        tried = counted.fit(solution.values, begun=begun, most=STEPS)
    except SolveError:
        return law, solution
    return (counted, tried) if IN_COUNTS * tried.cost < solution.cost else (law, solution)


def _from_starts(law: MechanismLaw, free: Sequence[Parameter], looks: Sequence[FirstLook]) -> Solution:
    """The best fit from the scenario's own values and from those of the first look."""
    tried = []
    for start in _starts(law, free, looks):
        try:
            tried.append(law.fit(start, most=FIRST_STEPS))
        except SolveError as error:
            failure = error
    if not tried:
        raise SolveError(f"the mechanism cannot follow the log from any start: {failure}")
    best = min(tried, key=lambda s: s.cost)
    return law.fit(best.values, begun=best.residuals, most=STEPS)


def _starts(law: MechanismLaw, free: Sequence[Parameter], looks: Sequence[FirstLook]) -> list[dict[str, float]]:
    """The scenario's own values, then those of the first look, if there is one."""
    mechanism, start_rad = law.mechanism, float(law.logs[0].run.start_rad[0])
    own: dict[str, float] = {n: n.of(mechanism) for n in free if n not in law.fixed}
    if own[N.COULOMB] == 0 and looks:
        own[N.COULOMB] = 0.1 * looks[0].drive_torque_N_m
    starts = [own]
    if looks and isinstance(mechanism, Mechanism):
        starts.append({**own, **{n: v for n, v in looks[0].start(mechanism, start_rad).items() if n in own}})
    return starts


def _slack(law: MechanismLaw, solution: Solution) -> bool:
    return any(law.respond(log, solution.values).slack for log in law.logs)


def _astray(law: MechanismLaw, solution: Solution) -> bool:
    """Whether pushes ended before a tendon was slack, or a search leaves more than noise."""
    if not _slack(law, solution):
        return True
    noise = max(float((100 * log.noise_N_m / log.range_N_m).max()) for log in law.logs)
    return law.percent(solution.values) > MORE_THAN_NOISE * noise


def _with_extras(
    law: MechanismLaw, solution: Solution, some: Sequence[Parameter], say: Callable[[str], None]
) -> tuple[Solution, Tried]:
    """Take up effects one by one as long as the data support another."""
    tried: dict[Parameter, tuple[float, bool]] = {}
    for _ in range(MOST_EXTRAS):
        extras = [n for n in some if n not in solution.values]
        if not extras:
            break
        blocks = len(np.unique(solution.residuals.blocks))
        worth = {n: each.gain for n, each in promises(law, solution, extras).items()}
        tried |= {n: (gain, False) for n, gain in worth.items()}
        best = max(worth, key=lambda n: worth[n])
        if worth[best] < TUNED.worth_a_constant:
            break
        say(f"with {best.spec.effect}")
        start = law.fixed.get(best, best.of(law.mechanism))
        nudged = start - best.motors.step / 2 if start >= best.motors.high else start + best.motors.step / 10
        partners: dict[str, float] = {n: n.of(law.mechanism) for n in PARTNERS.get(best, ())}
        more = law.fit({**solution.values, best: nudged, **partners}, most=STEPS)
        if blocks / 2 * np.log(solution.cost / more.cost) < TUNED.worth_a_constant:
            break
        solution, tried[best] = more, (worth[best], True)
    return solution, tuple((n, gain, taken) for n, (gain, taken) in tried.items())
