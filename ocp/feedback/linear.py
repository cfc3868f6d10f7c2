"""The loop without its controller, linearised along a motion: how small corrections change a measurement.

::

    correction --[ held for a sample ]--[ delay, lag of the drive ]--> motors --> mechanism --[ delay ]--> measured

All delays together count, so the plant between two samples is exact: modes of the linearised mechanism, held input,
output at a time between two samples. Sliding, the friction of each mass has the sign that the motion gives it;
sticking, bristles are springs. Both branches are there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.models.mechanism.equations import mechanism_equations
from tendonff.models.mechanism.linearise import LinearMechanism, MechanismLineariser
from tendonff.models.turns import in_turn
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity, state_of
from tendonff.ocp.mechanism.problem import Array, MechanismMemory

Complex = NDArray[np.complex128]

_GROWING_PER_S = 0.1
"""Real part above which a mode of the plant counts as growing [1/s]: below it is rounding, and too slow to matter."""
_POINTS, _SLOWEST_RAD_PER_S = 320, 0.3
_NEAREST, _FURTHEST, _BESIDE = 0.25, 0.3, 36
"""Points either way from the frequency of a mode: from a share of its damping to a share of its frequency [-]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Branch:
    """The plant of the loops at one state.

    Attributes
    ----------
    name : str
        Which mechanism, when, and whether it sticks.
    poles : ndarray, shape (modes,)
        Of the plant with its drive [1/s].
    inputs : ndarray, shape (modes, goals)
        Of each mode by each correction.
    outputs : ndarray, shape (goals, modes)
    jumps : bool
        Motors follow their commands without lag: corrections act as jumps of their places.
    """

    name: str
    poles: Complex
    inputs: Complex
    outputs: Complex
    jumps: bool

    @property
    def grows(self) -> bool:
        """Whether the plant is unstable by itself, so that margins of a loop about it mean nothing."""
        return bool(self.poles.real.max() > _GROWING_PER_S)

    def damped(self, ratio: float) -> "Branch":
        """The same with no oscillation damped less than a share of critical damping [-].

        Friction damps an oscillation as soon as it turns sliding round, which no linearisation while it slides can see.
        """
        size = np.abs(self.poles)
        oscillates = np.abs(self.poles.imag) > _SLOWEST_RAD_PER_S
        little = oscillates & (-self.poles.real < ratio * size)
        moved = -ratio * size + 1j * np.sign(self.poles.imag) * np.sqrt(1 - ratio**2) * size
        return replace(self, poles=np.where(little, moved, self.poles))

    def scaled(self, corrections: Array, goals: Array) -> "Branch":
        """The same with other units: the plant's of each correction and the loops' of each goal, in the new ones."""
        return replace(self, inputs=self.inputs * corrections, outputs=self.outputs * goals[:, None])

    def frequencies(self, sample_s: float) -> Array:
        """A grid up to half the sampling rate [rad/s], dense about modes that hardly are damped."""
        highest = np.pi / sample_s
        grid = np.geomspace(_SLOWEST_RAD_PER_S, highest * (1 - 1e-6), _POINTS)
        ringing = self.poles[(self.poles.imag > _SLOWEST_RAD_PER_S) & (self.poles.imag < 1.5 * highest)]
        size = np.abs(ringing)
        away = np.geomspace(_NEAREST * np.maximum(-ringing.real, 1e-6 * size), _FURTHEST * size, _BESIDE).ravel()
        beside = np.abs(np.concatenate([middle := np.tile(ringing.imag, _BESIDE), middle - away, middle + away]))
        aliased = np.abs(np.mod(beside + highest, 2 * highest) - highest)
        found: Array = np.unique(np.concatenate([grid, aliased[aliased > _SLOWEST_RAD_PER_S]]))
        return found

    def response(self, rad_per_s: Array, sample_s: float, delay_s: float) -> Complex:
        """Measurement over held corrections, shape (frequencies, goals, goals), at frequencies of shape (n,)."""
        whole = int(delay_s / sample_s + 1e-9)
        rest = sample_s - max(delay_s - whole * sample_s, 0.0)  # from a new command to the instant that is measured
        z = np.exp(1j * np.asarray(rad_per_s) * sample_s)[:, None]
        step, part = np.exp(self.poles * sample_s), np.exp(self.poles * rest)
        if self.jumps:
            modes = part * (z - 1) / (z - step) * z ** (-whole - 1)
        else:
            grown, begun = _held(self.poles, sample_s), _held(self.poles, rest)
            modes = (part * grown / (z - step) + begun) * z ** (-whole - 1)
        found: Complex = np.einsum("gm,wm,mk->wgk", self.outputs, modes, self.inputs)
        return found


def _held(poles: Complex, time_s: float) -> Complex:
    """(e^{pole t} - 1)/pole, t where the pole vanishes."""
    small = np.abs(poles * time_s) < 1e-9
    found: Complex = np.where(small, time_s, np.expm1(poles * time_s) / np.where(small, 1.0, poles))
    return found


@in_turn
def branches(
    system: FeedbackSystem, memories: Sequence[MechanismMemory], names: Sequence[str], *, sticking: Sequence[bool]
) -> tuple[Branch, ...]:
    """The plant at states of a run, each sliding as it does there or sticking.

    Parameters
    ----------
    system : FeedbackSystem
    memories : sequence of MechanismMemory
    names : sequence of str
        Of the branches.
    sticking : sequence of bool
    """
    problem = system.problem
    lineariser = MechanismLineariser(mechanism_equations(problem.mechanism, problem.level, problem.segments))
    signals = lineariser.signals
    motors = problem.names[problem.known :]
    kinds = problem.leads[problem.known :]
    units = {body.name: body.unit for body in problem.mechanism.bodies}
    commands = {drive.body: drive.command_name(units[drive.body]) for drive in problem.mechanism.drives}
    columns = [
        signals.inputs.index(f"{name}_{units[name]}_per_s" if led else commands[name])
        for name, led in zip(motors, kinds, strict=True)
    ]
    rows = [signals.outputs.index(name) for name in _output_names(system)]
    found = []
    for memory, name, sticks in zip(memories, names, sticking, strict=True):
        linear = lineariser.at(state_of(problem, memory), sticking=sticks)
        found.append(_branch(system, linear, columns, rows, name))
    return tuple(found)


def _output_names(system: FeedbackSystem) -> list[str]:
    problem = system.problem
    if system.quantity is Quantity.POSITION:
        return [f"{body.name}_{body.unit}" for body in (problem.mechanism.bodies[k] for k in system.goals)]
    chains = problem.chains()
    return [f"{problem.mechanism.tendons[k].name}_tension_{chains[k].count + 1}_N" for k in system.goals]


def _branch(system: FeedbackSystem, linear: LinearMechanism, columns: list[int], rows: list[int], name: str) -> Branch:
    a, b, c = linear.a, linear.b[:, columns] @ system.direction, linear.c[rows]
    jumps = system.is_led and system.lag_s == 0
    if system.lag_s > 0:
        n, loops, lag = len(a), b.shape[1], system.lag_s
        follow = -np.eye(loops) / lag
        a = np.block([[a, -b / lag if system.is_led else b], [np.zeros((loops, n)), follow]])
        b = np.vstack([b / lag if system.is_led else np.zeros_like(b), -follow])
        c = np.hstack([c, np.zeros((len(c), loops))])
    poles, vectors = np.linalg.eig(a)
    inputs = np.linalg.solve(vectors, b.astype(np.complex128))
    return Branch(
        name=name,
        poles=poles.astype(np.complex128),
        inputs=inputs,
        outputs=(c @ vectors).astype(np.complex128),
        jumps=jumps,
    )
