r"""The equations of any mechanism of bodies and tendons, on one page.

::

    body b        inertia_b dw_b/dt = drives - loads(q, w) - sum over links of f_j (d rate of elongation_j/dw_b)
                  dq_b/dt = w_b
    link j        de_j/dt = v_near - v_far + what the path gains;    f_j = max(k1 e + k2 (e - z) + c de/dt, 0)
    mass i        m_i dv_i/dt = f_i - f_{i+1} - f_f,i;    friction law under f_n = f_i + f_{i+1} + 2 p

A tendon is slack where a link would push: f_j = 0. The effort of a tendon on a body is its links' forces times what the
body takes off their rates of elongation, because their powers are equal: so each section acts with its *local* tension,
whatever its ends and sections follow. Bodies that a drive leads have a given place and rate instead of a balance.

The laws themselves are those of `models.tendon`: `friction`, `link`, `assembly`. Equation numbers there are of Palli,
Borghesan, Melchiorri (ICRA 2010).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.fidelity import Level
from tendonff.models.mechanism.mechanism import CutMechanism, CutTendon, Mechanism
from tendonff.models.mechanism.parts import Body, Places
from tendonff.models.parameters import Transmission
from tendonff.models.path import ANGLE_FLOOR_RAD, CutPath
from tendonff.models.tendon.assembly import normal_force, path_force
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.link import tendon_force
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismEquations:
    """A mechanism as d state/dt = rate(state, inputs, place, place_rate); CasADi columns, and a name for each row.

    Attributes
    ----------
    state, rate : ca.SX, shape (states, 1)
        States of the free bodies (q, w, then those of their loads), then of each tendon (v, e, z, friction), and their
        time derivatives.
    inputs : ca.SX, shape (inputs, 1)
        Commands of the drives that do not lead, in their order.
    place, place_rate : ca.SX, shape (led, 1)
        Coordinates of the led bodies, and their time derivatives.
    tension_N : ca.SX, shape (links, 1)
        Of each link, from near to far, tendon by tendon.
    effort : ca.SX, shape (bodies, 1)
        Of all tendons on each body, positive along its coordinate [N or N m].
    position : ca.SX, shape (bodies, 1)
        Coordinate of each body [m or rad].
    state_names, input_names, place_names, tension_names, effort_names, position_names : tuple of str
        With their units.
    """

    state: ca.SX
    inputs: ca.SX
    place: ca.SX
    place_rate: ca.SX
    rate: ca.SX
    tension_N: ca.SX
    effort: ca.SX
    position: ca.SX
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    place_names: tuple[str, ...]
    tension_names: tuple[str, ...]
    effort_names: tuple[str, ...]
    position_names: tuple[str, ...]

    def rows(self, *names: str) -> list[int]:
        """Rows of states by name."""
        return [self.state_names.index(name) for name in names]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the path of a tendon is, and how it changes; CasADi columns."""

    angle_rad: ca.SX  # shape (N, 1); wrap angle of each mass's piece
    ratio: ca.SX  # shape (N + 1, 1); length of the whole tendon over that of each link [-]
    angle_rate: ca.SX  # shape (N, 1)
    gained_rate: ca.SX  # shape (N + 1, 1); of the path between both ends of each link [m/s]


@in_turn
def mechanism_equations(
    mechanism: Mechanism | Transmission, level: Level, segments: int | None = None
) -> MechanismEquations:
    """Equations of a mechanism as CasADi expressions, for an integrator, a problem of optimal control, a linearisation.

    Parameters
    ----------
    mechanism : Mechanism or Transmission
        A single tendon is the mechanism of two bodies.
    level : Level
    segments : int, optional
        Number of masses of each tendon; default: each path's own.

    Examples
    --------
    >>> import casadi as ca
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> page = tf.mechanism_equations(scenario.transmission, tf.Level.PRESLIDING)
    >>> page.input_names, page.effort_names
    (('actuator_force_N', 'load_force_N'), ('actuator_effort_N', 'load_effort_N'))
    >>> dae = {"x": page.state, "u": page.inputs, "ode": page.rate}
    >>> advance = ca.integrator("advance", "cvodes", dae, 0.0, 1e-3)
    """
    whole = Mechanism.of(mechanism) if isinstance(mechanism, Transmission) else mechanism
    return equations_of(whole.cut(level, segments))


@in_turn
def equations_of(mechanism: CutMechanism, poses: Mapping[str, Pose] | None = None) -> MechanismEquations:
    """The page: balances of all bodies and tendons; poses of tendons by name where not bodies decide them."""
    free, led = mechanism.free, mechanism.led
    place, place_rate = ca.SX.sym("place", len(led)), ca.SX.sym("place_rate", len(led))
    q = {body.name: ca.SX.sym(f"q_{body.name}") for body in free} | _by_name(led, place)
    w = {body.name: ca.SX.sym(f"w_{body.name}") for body in free} | _by_name(led, place_rate)
    every_q, every_w = (ca.vertcat(*(of[body.name] for body in mechanism.bodies)) for of in (q, w))

    # what tendons do to bodies: force times what a body takes off the rate of elongation, link by link
    tendons = [_tendon(tendon, q, every_q, every_w, (poses or {}).get(tendon.name)) for tendon in mechanism.tendons]
    taken = sum((ca.jtimes(part.stretching, every_w, part.force, True) for part in tendons), ca.SX(0))
    effort = ca.SX.zeros(len(mechanism.bodies)) - taken

    # what drives do to them
    commands = [(drive, ca.SX.sym(f"u_{drive.body}")) for drive in mechanism.drives if not drive.leads]
    on_body = _by_name(mechanism.bodies, effort)
    for drive, u in commands:
        on_body[drive.body] = on_body[drive.body] + drive.effort(q[drive.body], w[drive.body], u)

    of_tendons = _by_name(mechanism.bodies, effort)
    bodies = [_body(b, q[b.name], w[b.name], on_body[b.name], of_tendons[b.name]) for b in free]
    parts = [*bodies, *tendons]
    units = {body.name: body.unit for body in mechanism.bodies}
    return MechanismEquations(
        state=ca.vertcat(*(column for part in parts for column in part.state)),
        inputs=ca.vertcat(ca.SX(0, 1), *(u for _, u in commands)),
        place=place,
        place_rate=place_rate,
        rate=ca.vertcat(*(column for part in parts for column in part.rate)),
        tension_N=ca.vertcat(*(part.force for part in tendons)),
        effort=effort,
        position=every_q,
        state_names=tuple(name for part in parts for name in part.names),
        input_names=tuple(drive.command_name(units[drive.body]) for drive, _ in commands),
        place_names=tuple(f"{body.name}_{body.unit}" for body in led),
        tension_names=tuple(f"{t.name}_tension_{k}_N" for t in mechanism.tendons for k in range(1, t.count + 2)),
        effort_names=tuple(f"{name}_effort_{unit.effort}" for name, unit in units.items()),
        position_names=tuple(f"{name}_{unit}" for name, unit in units.items()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """States of a body or a tendon, their rates and names."""

    state: list[ca.SX]
    rate: list[ca.SX]
    names: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class _TendonPart(_Part):
    stretching: ca.SX  # rates of elongation [m/s]
    force: ca.SX


def _body(body: Body, q: ca.SX, w: ca.SX, effort: ca.SX, of_tendons: ca.SX) -> _Part:
    """A body that moves by its balance, under all that acts on it but its loads; part of that is the tendons'."""
    own = [tuple(ca.SX.sym(name) for name in load.states) for load in body.loads]
    loads = list(zip(body.loads, own, strict=True))
    held = sum((load.force(q, w, states) for load, states in loads), ca.SX(0))
    return _Part(
        state=[q, w, *(state for states in own for state in states)],
        rate=[w, (effort - held) / body.inertia, *(rate for load, x in loads for rate in load.rate(w, x, of_tendons))],
        names=[
            f"{body.name}_{body.unit}",
            f"{body.name}_{body.unit}_per_s",
            *(f"{body.name}_{state}_{body.unit.effort}" for state in body.states),
        ],
    )


def _tendon(tendon: CutTendon, q: Places, every_q: ca.SX, every_w: ca.SX, pose: Pose | None) -> _TendonPart:
    """Masses and links of one tendon; where the path is at rest and all masses are alike, no pose is needed."""
    elements, n, name = tendon.elements, tendon.count, tendon.name
    if pose is None and not (elements.uniform and elements.path.still):
        pose = _pose(elements.path, q, every_q, every_w)
    friction, link = elements.laws if pose is None else elements.laws_at(pose.angle_rad, pose.ratio)
    v, e = ca.SX.sym("v", n), ca.SX.sym("e", n + 1)
    links = tuple(ca.SX.sym(state, n + 1) for state in link.states)
    masses = tuple(ca.SX.sym(state, n) for state in friction.states)

    near, far = (ca.jtimes(end.travel_m(q), every_q, every_w) for end in (tendon.near, tendon.far))
    e_rate = ca.vertcat(near, v) - ca.vertcat(v, far)
    if pose is not None:
        e_rate = e_rate + pose.gained_rate
    f = tendon_force(link.unclipped_force(e, e_rate, links) + link.explicit_force(e))
    f_f = friction.state_force(masses) + friction.viscous_force(v)
    mass = elements.piece.mass_kg
    acceleration = path_force(f[:-1], f[1:], f_f) / (ca.DM(mass) if isinstance(mass, np.ndarray) else mass)
    rubbing = friction.rate(v, masses, normal_force(f[:-1], f[1:], elements.piece.adhesion_N))
    if pose is not None:  # contact that is lost takes its bristle force along
        lost = ca.fmin(pose.angle_rate, 0) / ca.fmax(pose.angle_rad, ANGLE_FLOOR_RAD)
        rubbing = tuple(rate + lost * state for rate, state in zip(rubbing, masses, strict=True))

    # The unit of a law's own state is the law's affair.
    of_masses = [f"{name}_v_{k}_m_per_s" for k in range(1, n + 1)]
    of_links = [f"{name}_e_{k}_m" for k in range(1, n + 2)]
    own = [f"{name}_{state}_{k}" for state in link.states for k in range(1, n + 2)]
    own += [f"{name}_{state}_{k}" for state in friction.states for k in range(1, n + 1)]
    return _TendonPart(
        state=[v, e, *links, *masses],
        rate=[acceleration, e_rate, *link.rate(e, links), *rubbing],
        names=[*of_masses, *of_links, *own],
        stretching=e_rate,
        force=f,
    )


def _pose(path: CutPath, q: Places, every_q: ca.SX, every_w: ca.SX) -> Pose:
    """Pose of a path whose sections follow bodies; `CutPath.at` has the same for histories of numbers."""
    bent, gains = zip(*(section.symbolic(q) for section in path.sections), strict=True)
    angle = at_least(ca.SX(ca.vertcat(*bent)), 0.0)[path.section_of.tolist()] / ca.DM(path.pieces)
    gained, parts = ca.SX(ca.vertcat(*gains)), ca.sparsify(ca.DM(path.parts))
    lengths = ca.DM(path.lengths) + (0 if path.length_m is None else gained / path.length_m)
    of_links = ca.mtimes(parts, gained)
    return Pose(
        angle_rad=angle,
        ratio=1 / ca.mtimes(parts, lengths),
        angle_rate=ca.jtimes(angle, every_q, every_w),
        gained_rate=ca.jtimes(of_links, every_q, every_w),
    )


def _by_name(bodies: tuple[Body, ...], column: ca.SX) -> dict[str, Any]:
    """Entries of a column by the names of bodies."""
    return dict(zip((body.name for body in bodies), ca.vertsplit(column) if bodies else (), strict=True))
