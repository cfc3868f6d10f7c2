"""Tensions with which a mechanism rests at its start, and torques that tendons cannot give."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import scipy  # loads its parts when they are used

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.mechanism import Mechanism
from tendonff.models.mechanism.geometry import Geometry
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.mechanism.static import local_arms_m
from tendonff.models.turns import in_turn
from tendonff.ocp.mechanism.problem import Array, MechanismProblem, winding

MOST_MOVES = 200


@in_turn
def mechanism_problem(
    mechanism: Mechanism,
    level: Level,
    start: Mapping[str, float],
    *,
    following: Sequence[str] = (),
    effort: Mapping[str, float] | None = None,
    pretension_N: Mapping[str, float] | None = None,
    sharing: Sharing | None = None,
    segments: int | None = None,
) -> MechanismProblem:
    """Put a mechanism at rest, its bodies in the order of the compiled engine.

    Parameters
    ----------
    mechanism : Mechanism
        Motors are the bodies that near ends follow.
    level : Level
    start : mapping of str to float
        Coordinate of each body but the motors [rad or m]; of those that follow, where to look for it first.
    following : sequence of str, optional
        Free bodies without a wanted motion, which follow from their balances: fewer tendons than joints.
    effort : mapping of str to float, optional
        What bodies give to what they touch at the start [N m or N].
    pretension_N : mapping of str to float, optional
        Of each motor that winds several tendons: their tension after tensioning, where bodies carry nothing [N].
    sharing : Sharing, optional
    segments : int, optional
        Number of masses of each tendon; default: each path's own.

    Raises
    ------
    ParameterError
        If the tendons cannot hold the bodies at rest there.
    """
    drums = {winding(tendon).body for tendon in mechanism.tendons}
    led = {drive.body for drive in mechanism.drives if drive.leads}
    free = [b for b in mechanism.bodies if b.name not in drums | led]
    driven = [b for b in free if b.name not in following] + [b for b in free if b.name in following]
    known = [b for b in mechanism.bodies if b.name in led - drums]
    motors = [b for b in mechanism.bodies if b.name in drums]
    ordered = Mechanism(bodies=(*driven, *known, *motors), tendons=mechanism.tendons, drives=mechanism.drives)
    sharing = Sharing() if sharing is None else sharing
    at = np.array([start[body.name] for body in (*driven, *known)] + [0.0] * len(motors))
    problem = MechanismProblem(
        mechanism=ordered,
        level=level,
        segments=segments,
        driven=len(driven),
        wanted=len(driven) - len(following),
        motors=len(motors),
        start=at,
        tension_N=np.zeros(len(mechanism.tendons)),
        sharing=sharing,
    )
    touched = np.array([(effort or {}).get(body.name, 0.0) for body in driven])
    if following:
        return _settled(problem, touched)
    return problem.starting(_tensions(problem, held_at(problem, at[: len(driven)]) + touched, pretension_N or {}))


def _settled(problem: MechanismProblem, touched: Array) -> MechanismProblem:
    """At rest where the bodies that follow find their balance: tensions and their positions, without friction."""
    n, wanted, count = problem.driven, problem.wanted, len(problem.mechanism.tendons)
    if count + (n - wanted) != n or not all(problem.alone):
        raise ParameterError(
            f"{n - wanted} joints follow, so {wanted} tendons alone on their motors must move {wanted} wanted joints, "
            f"got {count}; give a joint a reference, or none"
        )
    geometry = Geometry(tendons=problem.mechanism.tendons, bodies=problem.names[: problem.known])
    scale, at = problem.scale_m()[:n], problem.start.copy()

    def off(unknown: Array) -> Array:
        at[wanted:n] = unknown[count:]
        arms = geometry.moment_arm_m(at[None, : problem.known])[0, :, :n]
        found: Array = (held_at(problem, at[:n]) + touched - arms.T @ unknown[:count]) / scale
        return found

    guess = np.concatenate([np.full(count, problem.sharing.least_tension_N), at[wanted:n]])
    found = scipy.optimize.least_squares(off, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    at[wanted:n] = found.x[count:]
    if np.abs(found.fun).max() > 1e-6 or (found.x[:count] < 0).any():
        pose = ", ".join(f"{name} {np.degrees(q):.3g} deg" for name, q in zip(problem.names, at[:n], strict=False))
        raise ParameterError(
            f"the joints that follow find no balance at the start ({pose}, tensions {found.x[:count]} N); they need "
            "springs that the tendons work against"
        )
    return replace(problem, start=at, tension_N=found.x[:count])


@in_turn
def held_at(problem: MechanismProblem, position: Array) -> Array:
    """Torque that tendons hold at rest where driven bodies stand, shape (rows, driven) or (driven,) [N m or N]."""
    q = ca.SX.sym("q", problem.driven)
    held = []
    for body, at in zip(problem.mechanism.bodies[: problem.driven], ca.vertsplit(q), strict=True):
        states = {load: tuple(ca.SX(0) for _ in load.states) for load in body.loads}
        held.append(sum((load.force(at, ca.SX(0), own) for load, own in states.items()), ca.SX(0)))
    found = np.array(ca.Function("held", [q], [ca.vertcat(*held)])(np.atleast_2d(position).T)).T
    return found.reshape(np.shape(position))


def _tensions(problem: MechanismProblem, held: Array, pretension_N: Mapping[str, float]) -> Array:
    """Tensions at rest: balances without friction, closures of shared drums, and least sums with the barrier."""
    mechanism, sharing = problem.mechanism, problem.sharing
    n, m, bodies = problem.driven, len(mechanism.tendons), problem.names[: problem.known]
    arms = Geometry(tendons=mechanism.tendons, bodies=bodies).moment_arm_m(problem.start[None, : problem.known])[0]
    scale = problem.scale_m()
    rows, right = [arms[:, b] / scale[b] for b in range(n)], list(held / scale[:n])
    compliance = [1 / tendon.tendon.stiffness_N_per_m for tendon in mechanism.tendons]
    for t, other in enumerate(problem.partner):
        if other >= 0:  # both are wound on by the same angle since they were tensioned
            motor = winding(mechanism.tendons[t]).body
            if motor not in pretension_N:
                raise ParameterError(f'motor "{motor}" winds two tendons, so it needs pretension_N; give it one')
            row = np.zeros(m)
            row[t], row[other] = compliance[t] / problem.winding_m[t], -compliance[other] / problem.winding_m[other]
            size = np.abs(row).max()
            rows.append(row / size)
            right.append(float(pretension_N[motor] * row.sum() / size))
    balances, wanted, alone = np.array(rows).reshape(len(rows), m), np.array(right), np.array(problem.alone)
    u = np.full(m, float(sharing.least_tension_N + 5 * sharing.smooth_N))
    _require_reachable(problem, balances, wanted)
    for _ in range(MOST_MOVES):
        room = np.where(alone, u - sharing.least_tension_N, 1.0)
        slope = np.where(alone, 1 - sharing.smooth_N / room, 0.0)
        bend = np.where(alone, sharing.smooth_N / room**2, 1e-9)
        zero = np.zeros((len(rows), len(rows)))
        system = np.block([[np.diag(bend), balances.T], [balances, zero]])
        move = np.linalg.lstsq(system, np.concatenate([-slope, wanted - balances @ u]), rcond=None)[0][:m]
        falling = alone & (move < -0.9 * room)
        u += min([1.0, *(-0.9 * room / np.where(move < 0, move, -1.0))[falling]]) * move
        if np.abs(move).max() < 1e-12 * (1 + np.abs(u).max()):
            break
    loose = ~alone & (u < 0)
    if loose.any():
        name = mechanism.tendons[int(np.argmax(loose))].name
        raise ParameterError(f'tendon "{name}" would hang loose at the start; more pretension_N keeps it taut')
    return u


def _require_reachable(problem: MechanismProblem, balances: Array, wanted: Array) -> None:
    alone = np.array(problem.alone)
    least = problem.sharing.least_tension_N
    bounds = [(least if each else 0.0, None) for each in alone]
    found = scipy.optimize.linprog(np.ones(len(bounds)), A_eq=balances, b_eq=wanted, bounds=bounds)
    if found.status != 0:
        bodies = zip(problem.names, problem.start, strict=True)
        pose = ", ".join(f"{name} {np.degrees(q):.3g} deg" for name, q in list(bodies)[: problem.driven])
        raise ParameterError(
            f"no tensions of at least {least:g} N hold the joints at the start ({pose}); check the signs of the moment "
            "arms, pretension_N, and whether the tendons can pull every joint both ways"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Unreachable:
    """A torque that no tensions give, friction counted.

    Attributes
    ----------
    row : int
        Of the motion.
    body : str
        Whose torque is missing most.
    missing : float
        By so much, where tensions come closest [N m or N].
    """

    row: int
    body: str
    missing: float


@in_turn
def unreachable(problem: MechanismProblem, position: Array, torque: Array, *, checks: int = 200) -> Unreachable | None:
    """First pose of a motion whose torques no tensions give, by the capstan law with friction.

    Parameters
    ----------
    problem : MechanismProblem
    position : ndarray, shape (rows, known)
        Of all bodies but the motors.
    torque : ndarray, shape (rows, driven)
        That the tendons must give.
    checks : int, optional
        Number of poses that are looked at.

    Notes
    -----
    Between the far end and a section, tension changes by e^{+-mu phi} with the way the tendon slides there: friction
    shrinks the cone of torques that tendons reach.
    """
    rows = np.unique(np.linspace(0, len(position) - 1, min(checks, len(position))).astype(int))
    speed = np.gradient(position, axis=0) if len(position) > 1 else np.zeros_like(position)
    scale, least = problem.scale_m()[: problem.driven], problem.sharing.least_tension_N
    bounds = [(least if alone else 0.0, None) for alone in problem.alone]
    names = problem.names[: problem.known]
    for row in rows:
        places, speeds = (dict(zip(names, each[row], strict=True)) for each in (position, speed))
        local = [local_arms_m(tendon, places, speeds) for tendon in problem.mechanism.tendons]
        arms = np.array([[each.get(name, 0.0) for name in names[: problem.driven]] for each in local])
        balance = (arms / scale).T
        m, n = len(bounds), problem.driven
        slack = np.hstack([balance, np.eye(n), -np.eye(n)])
        found = scipy.optimize.linprog(
            np.concatenate([np.zeros(m), np.ones(2 * n)]),
            A_eq=slack,
            b_eq=torque[row] / scale,
            bounds=[*bounds, *([(0.0, None)] * (2 * n))],
        )
        if found.status == 0 and found.fun <= 1e-6 * (1 + np.abs(torque[row] / scale).max()):
            continue
        missing = (found.x[m : m + n] + found.x[m + n :]) * scale if found.status == 0 else np.full(n, np.inf)
        worst = int(np.argmax(missing / scale))
        return Unreachable(row=int(row), body=names[worst], missing=float(missing[worst]))
    return None
