"""The exact inverse of a mechanism, and its response to motors that are led or forced."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.integrate.integrator import gave_up
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.mechanism.compiled import CompiledMechanism, RunRows
from tendonff.ocp.mechanism.integrated import IntegratedMechanism
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem, rest
from tendonff.ocp.short import rows_in_short


class MechanismStatus(StrEnum):
    """Outcome of an inverse or a simulation.

    Attributes
    ----------
    DONE
        All rows; every tendon stays taut.
    SLACK
        All rows; a tendon hangs loose on the way.
    FAILED
        A step has no answer; the rows before it are good.
    """

    DONE = "done"
    SLACK = "slack"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismRun:
    """Motion of a mechanism, rows at 0, h, 2 h ...: what an inverse asks for, or what a simulation finds.

    Attributes
    ----------
    status : MechanismStatus
    message : str
        What happened, for the user.
    time_s : ndarray, shape (n,)
    position : ndarray, shape (n, known)
        Of all bodies but the motors [rad or m].
    motor : ndarray, shape (n, motors)
        Of each motor since the start, before a servo or gear that gives way [rad or m].
    effort : ndarray, shape (n, motors)
        Of the tendons on each motor, positive where they pull it back [N m or N].
    tension_N, drum_N : ndarray, shape (n, tendons)
        At the far end, and at the drum.
    slack_m : ndarray, shape (n, tendons)
        Length that hangs loose in a loop; zero of a simulation.
    lowest_N : ndarray, shape (n,)
        Smallest tension along any tendon.
    work : int
        Evaluations of the inverse, or linear solves of the simulation.
    final : MechanismMemory
        State after the last good row.
    """

    status: MechanismStatus
    message: str
    time_s: Array
    position: Array
    motor: Array
    effort: Array
    tension_N: Array
    drum_N: Array
    slack_m: Array
    lowest_N: Array
    work: int
    final: MechanismMemory

    def __repr__(self) -> str:
        return rows_in_short(self, self.status, self.time_s)


@in_turn
def invert_mechanism(
    problem: MechanismProblem,
    position: Array,
    step_s: float,
    *,
    effort: Array | float = 0.0,
    memory: MechanismMemory | None = None,
) -> MechanismRun:
    """Motors whose response is a motion of all driven bodies.

    Parameters
    ----------
    problem : MechanismProblem
    position : ndarray, shape (n, known)
        Of all bodies but the motors at 0, h, 2 h ...; the first where the problem starts [rad or m]. Not used of those
        that follow.
    step_s : float
        h [s], > 0.
    effort : ndarray, shape (n, known), or float, optional
        What the bodies give to what they touch [N m or N].
    memory : MechanismMemory, optional
        Start from here instead; the first position is then not used.

    Raises
    ------
    ParameterError
        If an argument is not usable.
    CodeError
        If no C compiler works here.
    """
    given = _rows("position", position, (None, problem.known), step_s)
    touched = _rows("effort", np.broadcast_to(effort, given.shape), given.shape, step_s)
    wanted = np.r_[: problem.wanted, problem.driven : problem.known]
    if memory is None and np.abs(given[0] - problem.start[: problem.known])[wanted].max() > 1e-9:
        raise ParameterError(f"position starts at {given[0]}, the problem at {problem.start[: problem.known]}")
    memory = rest(problem) if memory is None else memory.copy()
    first = memory.copy()
    given = np.vstack([first.z[: problem.known, 1], given[1:]])
    rows = CompiledMechanism(problem, step_s).invert(memory, given, touched)
    before = (np.array([x[-2] for x in first.x]) - first.start_m)[None, :]
    travel, slack = np.vstack([before, rows.travel_m]), np.vstack([np.zeros_like(before), rows.slack_m])
    drum = np.vstack([first.tension_N, rows.drum_N])
    lowest = np.concatenate([[float(first.tension_N.min())], rows.lowest_N])
    status, message = _inverse_outcome(problem, len(given), lowest, slack, step_s)
    good = len(travel)
    return MechanismRun(
        status=status,
        message=message,
        time_s=np.arange(good, dtype=np.float64) * step_s,
        position=np.vstack([given[:1], rows.position]),
        motor=ahead_of_drums(problem, motors_of(problem, travel, slack), efforts_of(problem, drum)),
        effort=efforts_of(problem, drum),
        tension_N=np.vstack([first.tension_N, rows.tension_N]),
        drum_N=drum,
        slack_m=slack,
        lowest_N=lowest,
        work=rows.evaluations,
        final=memory,
    )


@in_turn
def simulate_mechanism(
    problem: MechanismProblem,
    command: Array,
    step_s: float,
    *,
    known: Array | None = None,
    effort: Array | float = 0.0,
    led: Array | None = None,
    memory: MechanismMemory | None = None,
    method: Method = Method.BDF2,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> MechanismRun:
    """Response of a mechanism to its motors.

    Parameters
    ----------
    problem : MechanismProblem
    command : ndarray, shape (n, motors)
        Coordinate of each motor that a drive or a servo leads [rad or m], torque or force of each other [N m or N].
    step_s : float
        h [s], > 0.
    known : ndarray, shape (n, known), optional
        Coordinates of the bodies that are no motors, used of those that are led; default: where they start.
    effort : ndarray, shape (n, known), or float, optional
        What the bodies give to what they touch [N m or N].
    led : ndarray of bool, shape (known,), optional
        Which of those bodies are led; default: those that a drive leads.
    memory : MechanismMemory, optional
        Start from here instead of from rest.
    method : {"bdf2", "cvodes", "idas", "collocation"}, optional
        How it advances: by the compiled step, or by an integrator of CasADi on `mechanism_equations`, a hundred times
        slower or more, which needs no compiler.
    rtol, atol : float, optional
        Relative and absolute tolerance of an integrator, for every state in its SI unit.

    Raises
    ------
    ParameterError
        If an argument is not usable.
    CodeError
        If the method is "bdf2" and no C compiler works here.
    """
    given = _rows("command", command, (None, problem.motors), step_s)
    count, leads = len(given), np.array(problem.leads)
    if led is not None:
        leads[: problem.known] = led
    at = np.broadcast_to(problem.start[: problem.known], (count, problem.known)) if known is None else known
    at = _rows("known", np.array(at), (count, problem.known), step_s)
    touched = _rows("effort", np.broadcast_to(effort, at.shape), at.shape, step_s)
    forced = ~leads[problem.known :]
    memory = rest(problem) if memory is None else memory.copy()
    first = memory.copy()
    gives = forced & np.isfinite(problem.stiffness)
    pushed = np.where(gives, np.where(gives, problem.stiffness, 0.0) * given + problem.held, given)
    efforts = np.hstack([touched, np.where(forced, -pushed, 0.0)])
    engine = (
        CompiledMechanism(problem, step_s)
        if method is Method.BDF2
        else IntegratedMechanism(problem, step_s, Method(method), Accuracy(rtol=rtol, atol=atol))
    )
    rows = engine.run(memory, np.hstack([at, given]), efforts, leads)
    found = response_of(problem, first, rows, memory, count, step_s, Method(method))
    if gives.any():
        found.motor[:, gives] = given[: len(found.motor), gives]
    return found


def response_of(
    problem: MechanismProblem,
    first: MechanismMemory,
    rows: RunRows,
    final: MechanismMemory,
    count: int,
    step_s: float,
    method: Method = Method.BDF2,
) -> MechanismRun:
    """Response, from the state that it begins with, what an engine found of `count` rows, and the state behind."""
    good = len(rows.lowest_N) + 1
    position = np.vstack([first.z[:, 1], rows.position])
    drum = np.vstack([first.tension_N, rows.drum_N])
    lowest = np.concatenate([[float(first.tension_N.min())], rows.lowest_N])
    status, message = _response_outcome(count, lowest, rows.residual_N, step_s, method)
    return MechanismRun(
        status=status,
        message=message,
        time_s=np.arange(good, dtype=np.float64) * step_s,
        position=position[:, : problem.known],
        motor=position[:, problem.known :],
        effort=efforts_of(problem, drum),
        tension_N=np.vstack([first.tension_N, rows.tension_N]),
        drum_N=drum,
        slack_m=np.zeros_like(drum),
        lowest_N=lowest,
        work=rows.iterations,
        final=final,
    )


def _rows(name: str, values: Array, shape: tuple[int | None, int], step_s: float) -> Array:
    given = np.ascontiguousarray(values, dtype=np.float64)
    if (
        given.ndim != 2
        or given.shape[1] != shape[1]
        or (shape[0] or given.shape[0]) != given.shape[0]
        or not len(given)
    ):
        rows = "at least one" if shape[0] is None else str(shape[0])
        raise ParameterError(f"{name} must have {rows} rows of {shape[1]} columns, got shape {given.shape}")
    bad = ~np.isfinite(given).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise ParameterError(f"{name} must be finite, got {given[row]} at t = {row * step_s:g} s; repair it")
    return given


def motors_of(problem: MechanismProblem, travel_m: Array, slack_m: Array) -> Array:
    """Coordinates of the motors: those of the tendon on each that does not hang."""
    each, wound = travel_m / problem.winding_m, problem.wound_by
    found: Array = each[:, [own[0] for own in wound]]
    if slack_m.any():
        for motor, own in enumerate(wound):
            tight = np.array(own)[np.argmin(slack_m[:, own], axis=1)]
            found[:, motor] = each[np.arange(len(each)), tight]
    return found


def ahead_of_drums(problem: MechanismProblem, drums: Array, effort: Array) -> Array:
    """Coordinates of motors for those of their drums since the start: ahead by what servo or gear give way."""
    found: Array = drums + (effort - problem.held) / problem.stiffness
    return found


def efforts_of(problem: MechanismProblem, drum_N: Array) -> Array:
    """Effort of the tendons on each motor for tensions at the drums, shape (rows, motors)."""
    found = np.zeros((len(drum_N), problem.motors))
    for t, motor in enumerate(problem.motor_of):  # a drum that holds a loose end holds nothing
        found[:, motor] += np.maximum(drum_N[:, t], 0.0) * problem.winding_m[t]
    return found


def _inverse_outcome(
    problem: MechanismProblem, rows: int, lowest: Array, slack: Array, step_s: float
) -> tuple[MechanismStatus, str]:
    if len(lowest) < rows:
        return MechanismStatus.FAILED, (
            f"the inverse stopped at t = {len(lowest) * step_s:.6g} s: no tensions give the torques there; check the "
            "reference for jumps, and whether the tendons reach those torques"
        )
    hanging = slack > 0
    if hanging.any():
        first = int(np.argmax(hanging.any(axis=1)))
        name = problem.mechanism.tendons[int(np.argmax(hanging[first]))].name
        return MechanismStatus.SLACK, f'tendon "{name}" hangs loose from t = {first * step_s:.6g} s; more pretension_N'
    if (lowest <= 0).any():
        first = int(np.argmax(lowest <= 0))
        return MechanismStatus.SLACK, (
            f"a tendon would have to push at t = {first * step_s:.6g} s; keep more tension, or move more slowly"
        )
    return MechanismStatus.DONE, f"{rows} rows, least tension {lowest.min():.4g} N"


def _response_outcome(
    rows: int, lowest: Array, residual_N: float, step_s: float, method: Method
) -> tuple[MechanismStatus, str]:
    if len(lowest) < rows and method is not Method.BDF2:
        return MechanismStatus.FAILED, f"simulation stopped at t = {len(lowest) * step_s:.6g} s: {gave_up(method)}"
    if len(lowest) < rows:
        return MechanismStatus.FAILED, (
            f"simulation stopped at t = {len(lowest) * step_s:.6g} s: the step did not converge although it was split; "
            f"worst balance {residual_N:.3g} N; check the motors there for jumps, or use a step below {step_s:g} s"
        )
    if (lowest <= 0).any():
        first = int(np.argmax(lowest <= 0))
        return MechanismStatus.SLACK, f"a tendon went slack at t = {first * step_s:.6g} s"
    return MechanismStatus.DONE, f"{rows} rows"
