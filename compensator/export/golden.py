"""Golden vectors: what the exported C must answer, computed by the Python model."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.plant import behind_servo
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import StreamDesign, quantised, smoothed, stream_force
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.export.joint_jumps import has_jump, largest_starts_rad
from tendonff.compensator.export.modules import exportable
from tendonff.compensator.export.text.table_index import rounded
from tendonff.models.capstan import CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainInputs
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.protocol import Rows
from tendonff.ocp.step.target import plant_limits
from tendonff.ocp.tendon.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.tendon.simulate import Simulation, Simulator, simulate

_ROWS = 1000
_REVERSAL_ROWS = 240
_GENTLE_ROWS = 900
_LIVE_ROWS = 500
_OTHER_ROWS = 160
_OTHER_ADHESION, _MOST_ADHESION_N = 0.1, 900.0  # more of it: share of the tension, and what every record accepts
_OTHER_RELEASE = 0.9
_LONGER_ROWS = 120
LONGER = 1.5
"""Length of the longer steps, in samples."""

NUDGE, GROWTH = 1e-9, 100.0
"""Relative change of the force, up or down in each row, and the growth of its effect at which comparing ends."""

_TOGETHER = 8
"""Rows that are tried at once: most need two evaluations."""

_SHARE_OF_WORK = 1 / 3
"""Of what the exported plant may do in one call: its line search gives up sooner than that of the simulation."""

_LOST = slice(200, 240)
_LEGS = tuple(0.6**k for k in (0, 3, 1, 4, 2, 6, 3, 8, 1, 5, 2, 7))  # of the range: reversals at many depths
_JUMPS = (0.0, 1.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.2, 0.2, 0.9, 0.0, 0.0)  # places in the range, a sample each


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Inputs and answers, one row per sample."""

    # reference_N, plant_force_N: shape (rows,); inputs, exact in the real type of the export; of a position drive
    # commands [m]
    reference_N: FloatArray
    plant_force_N: FloatArray
    # shape (rows,); answers: inverse, capstan, table (force within limits) and plant (output tension) [N]; of the plant
    # as many rows as rounding leaves alone
    columns: dict[str, FloatArray]
    scale_N: float  # largest force that the course asks for before the limits: what rounding is relative to [N]
    chain: Chain  # the model, with the motion of the course

    @property
    def joint_rad(self) -> FloatArray:
        """Joint angles, shape (rows, joints) [rad]; exact in the real type of the export."""
        motion = self.chain.motion
        return np.zeros((len(self.reference_N), 0)) if motion is None else motion.angle_rad

    @property
    def inputs_N(self) -> dict[str, FloatArray]:
        """Inputs of each module with outputs, by name [N]."""
        rows = len(self.columns.get("plant", ()))
        return {name: self.plant_force_N[:rows] if name == "plant" else self.reference_N for name in self.columns}


@dataclass(frozen=True, slots=True, kw_only=True)
class Golden:
    """All courses of the self test."""

    stride: int  # samples of the scenario's reference per row
    course: Course  # the scenario's reference, then reversals
    jumps: Course  # jumps over the range of the reference, in which forces and rates meet their limits
    # the course as it arrives live: rough, and lost for a while; None where there is no stream module
    live: Course | None = None
    # the end of the course with other friction; None on a path in sections or one that moves
    other: "Other | None" = None
    # the beginning of the course in steps of another length; None of a position drive
    longer: Course | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Other:
    """The last rows of the course, from rest, with friction that was set while the controller runs."""

    # mu_release, adhesion_N: what was set, exact in the real type [-], [N]
    mu_release: float
    adhesion_N: float
    course: Course


def answers(
    problem: Problem, table: LookupTable | None, reference_N: FloatArray, precision: Precision, chain: Chain
) -> Course:
    """Answers to a reference that starts at rest at its first row, and that of the plant to the force of the inverse.

    The table is the one that is exported, where one is; the reference is exact in the real type.
    """
    course = _answered(_following(problem, reference_N, chain), table, precision)
    run = respond(problem, course.plant_force_N, float(reference_N[0]), chain).require()
    return replace(course, columns={**course.columns, "plant": run.output_tension_N})


def _following(problem: Problem, reference_N: FloatArray, chain: Chain | None) -> Problem:
    """The problem of a reference of its own, from rest at its first row."""
    reference = replace(
        problem.reference,
        time_s=np.arange(len(reference_N), dtype=np.float64) * problem.reference.step_s,
        tension_N=reference_N,
        initial_tension_N=float(reference_N[0]),
        periodic=False,
        position_m=None,
    )
    return replace(problem, reference=reference, live=True, model=chain)


def _answered(followed: Problem, table: LookupTable | None, precision: Precision) -> Course:
    """Outputs of each module that follows a reference; without a table those that need none."""
    columns = {}
    for compensator, module in exportable(followed.transmission, moving=followed.chain.motion is not None):
        is_table = isinstance(compensator, CompensationTable)
        if not module.plays_back and not (is_table and table is None):
            exported = CompensationTable(table) if is_table else compensator
            columns[module.name] = exported.profile(followed).force_N
            if servo_of(followed) is not None:
                columns[module.name] = commanded(followed, followed.inversion, columns[module.name])
    return Course(
        reference_N=followed.reference.tension_N,
        plant_force_N=rounded(columns["inverse"], precision),
        columns=columns,
        scale_N=float(np.abs(followed.inversion.force_N).max()),
        chain=followed.chain,
    )


def _other(problem: Problem, course: Course, precision: Precision) -> Other | None:
    """The end of the course with more adhesion, and with less friction when releasing."""
    if problem.chain.moving:
        return None
    reference, friction = course.reference_N[-_OTHER_ROWS:], problem.transmission.friction
    more = min(_OTHER_ADHESION * float(reference[0]), _MOST_ADHESION_N)
    less = _OTHER_RELEASE if CapstanLaw.of(problem.transmission).plays is None else 1.0  # plays keep their wrap angles
    adhesion, release = (
        float(rounded(np.array([value]), precision)[0])
        for value in (friction.adhesion_N + more, less * friction.release_dynamic)
    )
    changed = replace(
        friction,
        adhesion_N=adhesion,
        mu_dynamic_release=release,
        mu_static_release=max(release, less * friction.release_static),
    )
    transmission = replace(problem.transmission, friction=changed)
    followed = _following(replace(problem, transmission=transmission), reference, None)
    if followed.inversion.status is not InverseStatus.EXACT:
        return None
    return Other(mu_release=release, adhesion_N=adhesion, course=_answered(followed, None, precision))


def _longer(problem: Problem, course: Course) -> Course:
    """The beginning of the course as if its samples were further apart."""
    rows = slice(_LONGER_ROWS)
    step, reference, chain = LONGER * problem.reference.step_s, course.reference_N[rows], course.chain
    if (motion := chain.motion) is not None:
        time = np.arange(len(reference), dtype=np.float64) * step
        chain = replace(chain, motion=replace(motion, time_s=time, angle_rad=motion.angle_rad[rows], period_s=None))
    start = float(reference[0])
    exact = invert(chain, reference, step, initial_tension_N=start)
    force = problem.limits.apply(exact.force_N, step, start)
    scale = float(np.abs(exact.force_N).max())
    return Course(reference_N=reference, plant_force_N=force, columns={"inverse": force}, scale_N=scale, chain=chain)


def _moving(problem: Problem, rows: NDArray[np.int_], count: int, precision: Precision) -> Chain:
    """The chain with the joint angles of some samples of the reference, then back to and fro; at rest at the end."""
    motion = problem.chain.motion
    if motion is None:
        return problem.chain
    there_and_back = np.concatenate([rows, rows[-2:0:-1]])  # no sample twice: a joint that starts at once has jumped
    chosen = np.resize(there_and_back, count)
    chosen[-2:] = chosen[-3:-2]
    time = np.arange(count, dtype=np.float64) * problem.reference.step_s
    angle = rounded(motion.at(problem.reference.time_s[chosen]), precision)
    return replace(problem.chain, motion=replace(motion, time_s=time, angle_rad=angle, period_s=None))


def _repeatable(problem: Problem, course: Course) -> Course:
    """The course with the plant's answers as far as small differences stay small, which falling friction may end.

    And as far as no step takes long, which the exported plant with its bounded work may give up.
    """
    force, plant, start = course.plant_force_N, course.columns["plant"], float(course.reference_N[0])
    other = respond(problem, nudged(force, float(np.abs(force).max())), start, course.chain)
    rows = min(len(other.tension_N), len(plant))
    apart = np.abs(other.output_tension_N[:rows] - plant[:rows]) > GROWTH * NUDGE * course.scale_N
    chain, driven = _drive(problem, force, start, course.chain)
    kept = min(
        int(np.argmax(apart)) if apart.any() else rows, easy_rows(chain, driven, problem.reference.step_s, start)
    )
    return replace(course, columns={**course.columns, "plant": plant[: max(kept, 2)]})


def nudged(values: FloatArray, scale: float) -> FloatArray:
    """Inputs that are off by chance from row to row, as roundings are; a regular pattern would move hardly anything."""
    return values + NUDGE * scale * np.random.default_rng(0).choice((-1.0, 1.0), len(values))


def is_easy(steps: Rows) -> bool:
    """Whether none of some steps is split, and all together take less than the exported code may for one."""
    return not steps.splits and steps.evaluations <= _SHARE_OF_WORK * plant_limits(Precision.DOUBLE).evaluations


def easy_rows(chain: Chain, force_N: FloatArray, step_s: float, start_N: float) -> int:
    """Rows of a chain's course before a step that is split or takes long; CasADi alone knows the first only."""
    inputs = ChainInputs.of_force(force_N)
    simulator = Simulator(chain, step_s, chain.rest_state(start_N), inputs[:1])
    row, rows = 1, _TOGETHER
    while row < len(force_N):
        before = simulator.checkpoint()
        steps = simulator.advance(inputs[row : row + rows])
        if is_easy(steps):
            row, rows = row + rows, _TOGETHER
        elif rows == 1:
            return row
        else:  # one by one, where all together take what one of them may
            simulator.restore(before)
            rows = 1
    return len(force_N)


def to_and_fro(course_N: FloatArray, *, step_N: float | None = None, rows: int = _REVERSAL_ROWS) -> FloatArray:
    """A way on from the end of a course that turns round at many depths of the transition, within its range [N].

    Legs that would need more rows than there are at the largest change from row to row (default: what the rows need)
    are shortened; nothing comes back where the course never moves.
    """
    low, high = float(course_N.min()), float(course_N.max())
    if not high > low:
        return np.empty(0)
    way = (high - low) * sum(_LEGS)
    size = 1.0 if step_N is None else min(1.0, rows * step_N / way)
    turns, sign = [float(course_N[-1])], 1.0 if course_N[-1] < 0.5 * (low + high) else -1.0
    for leg in _LEGS:
        turns.append(min(max(turns[-1] + sign * size * leg * (high - low), low), high))
        sign = -sign
    ways = np.abs(np.diff(turns))
    step = float(ways.sum()) / rows
    legs = [
        np.linspace(a, b, 1 + max(2, math.ceil(way / step)))[1:]
        for a, b, way in zip(turns[:-1], turns[1:], ways, strict=True)
        if way > 0
    ]
    return np.concatenate(legs)


def golden_vectors(
    problem: Problem, table: LookupTable | None, precision: Precision, *, stream: StreamDesign | None = None
) -> Golden:
    """Golden vectors along the scenario's own reference, then over reversals, then over jumps; live ones with a stream.

    The reference is thinned so that its whole course fits, and the reversals are quick. Where tendon or joints cannot
    follow that, the course is the beginning of the reference as it is, with reversals no faster than its own motion.
    """
    tension = problem.reference.tension_N
    stride = max(1, -(-len(tension) // _ROWS))
    reference = rounded(np.concatenate([tension[::stride], to_and_fro(tension[::stride])]), precision)
    samples = np.arange(len(tension))
    chain = _moving(problem, samples[::stride], len(reference), precision)
    exact = invert(chain, reference, problem.reference.step_s, initial_tension_N=float(reference[0]))
    starts_rad = largest_starts_rad(problem.chain, problem.reference.step_s)
    torn = chain.motion is not None and has_jump(chain.motion.angle_rad, starts_rad)
    if exact.status is not InverseStatus.EXACT or torn:
        stride, slow = 1, tension[:_ROWS]
        usual = float(np.abs(np.diff(tension)).max())
        reversals = to_and_fro(slow, step_N=usual, rows=_GENTLE_ROWS)
        reference = rounded(np.concatenate([slow, reversals]), precision)
        chain = _moving(problem, samples[:_ROWS], len(reference), precision)
    low, high = float(reference.min()), float(reference.max())
    jumps = rounded(low + np.array(_JUMPS) * (high - low), precision)
    course = answers(problem, table, reference, precision, chain)
    at_jumps = _moving(problem, samples[: len(jumps)], len(jumps), precision)
    return Golden(
        stride=stride,
        course=_repeatable(problem, course),
        jumps=_answered(_following(problem, jumps, at_jumps), table, precision),
        live=None if stream is None else _live(problem, stream, reference, chain, precision),
        other=_other(problem, course, precision),
        longer=None if servo_of(problem) is not None else _longer(problem, course),
    )


def _live(problem: Problem, stream: StreamDesign, course_N: FloatArray, chain: Chain, precision: Precision) -> Course:
    """The course with the noise of a converter, lost for a time in which the reference moves on.

    With a ramp it is the reference as it is, from before where its force is fastest: in and out of the limits.
    """
    if stream.ramp is not None:
        fastest = int(np.argmax(np.abs(np.diff(problem.inversion.force_N))))
        course_N = problem.reference.tension_N[max(0, fastest - _LIVE_ROWS // 2) :][: stream.ahead + _LIVE_ROWS]
    step = max(2 * stream.band_N, 1e-3 * scale_of(course_N))
    rough = rounded(quantised(course_N[: stream.ahead + _LIVE_ROWS], step), precision)
    rough[0] = rounded(course_N[:1], precision)[0]
    rough[_LOST] = np.nan
    start = float(rough[0])
    if (motion := chain.motion) is not None:
        rows = slice(len(rough))
        chain = replace(chain, motion=replace(motion, time_s=motion.time_s[rows], angle_rad=motion.angle_rad[rows]))
    force, step = stream_force(stream, replace(problem, model=chain), rough), problem.reference.step_s
    exact = invert(chain, smoothed(stream, rough, start), step, initial_tension_N=start, record=True)
    if servo_of(problem) is not None:
        force = commanded(problem, exact, force)
    scale = float(np.abs(exact.force_N).max())
    return Course(reference_N=rough, plant_force_N=force, columns={"stream": force}, scale_N=scale, chain=chain)


def servo_of(problem: Problem) -> float | None:
    """Stiffness of a position drive's servo [N/m]; None for a force drive."""
    return problem.transmission.actuator.servo_stiffness_N_per_m


def commanded(problem: Problem, inversion: Inversion, force_N: FloatArray) -> FloatArray:
    """Command of a position drive as exported code tells it [m].

    The travel of the inverse, whose states are needed, plus the stretch of the force within the limits.
    """
    stiffness = servo_of(problem)
    if inversion.states is None or stiffness is None:
        raise ParameterError("a command needs the inverse's states and a position drive; record them")
    start = float(inversion.least_tension_N[0])  # at rest, where it is the same everywhere
    travel = inversion.states[:, -2] - problem.chain.rest_state(start).near_position_m
    return travel + (force_N - start) / stiffness


def respond(problem: Problem, drive: FloatArray, start_N: float, chain: Chain) -> Simulation:
    """The chain, with the motion of the course, under forces [N], or under commands of its servo [m], from rest."""
    chain, drive = _drive(problem, drive, start_N, chain)
    return simulate(chain, drive, problem.reference.step_s, initial_tension_N=start_N)


def _drive(problem: Problem, drive: FloatArray, start_N: float, chain: Chain) -> tuple[Chain, FloatArray]:
    """The chain that forces or commands act on, and the force on it that stands for them [N]."""
    if servo_of(problem) is None:
        return chain, drive
    return behind_servo(chain, problem.transmission.actuator, start_N, drive)
