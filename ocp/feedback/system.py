"""A mechanism behind its drive, with what a feedback measures and what it moves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError, require
from tendonff.models.mechanism import Force, Mechanism, Servo, Spring
from tendonff.models.mechanism.geometry import moment_arms
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem


class Quantity(StrEnum):
    """Measured quantity.

    Attributes
    ----------
    POSITION
        Of a body [m or rad].
    TENSION
        At the far end of a tendon [N]. Loops see logarithms: friction of wraps divides a force by the same factor at
        every tension, so logarithms of force and tension move alike while the tendon slides, either way.
    """

    POSITION = "position"
    TENSION = "tension"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FeedbackSystem:
    """A mechanism with loops, each of which measures one goal and corrects the commands of the motors.

    Parameters
    ----------
    problem : MechanismProblem
    quantity : Quantity
    goals : tuple of int
        Numbers of the bodies or tendons that are measured.
    direction : ndarray, shape (motors, goals)
        Command of each motor [rad, m, N or N m] per unit of each correction; of a tension per newton of its force.
    offset_N : float, optional
        Added to forces and tensions before their logarithm [N], > 0 where tensions are measured.
    lag_s : float, optional
        Time constant with which motors follow their commands [s], >= 0.
    drive_delay_s : float, optional
        Age of a command when it acts [s], >= 0.
    play : float, optional
        Play of the gears [unit of a motor], >= 0.
    """

    problem: MechanismProblem
    quantity: Quantity
    goals: tuple[int, ...]
    direction: Array
    offset_N: float = 0.0
    lag_s: float = 0.0
    drive_delay_s: float = 0.0
    play: float = 0.0

    def __post_init__(self) -> None:
        shape = (self.problem.motors, len(self.goals))
        if np.shape(self.direction) != shape:
            raise ParameterError(f"direction must have shape {shape}, got {np.shape(self.direction)}")
        if self.quantity is Quantity.TENSION:
            require("offset_N", self.offset_N, above=0, hint="a hundredth of the tension")

    @property
    def is_led(self) -> bool:
        """Whether commands are places of the motors, not forces on them."""
        return all(self.problem.leads[self.problem.known :])

    def measured(self, position: Array, tension_N: Array) -> Array:
        """The goals, shape (rows, goals), from positions of the bodies and tensions at the far ends."""
        of = position if self.quantity is Quantity.POSITION else tension_N
        found: Array = of[:, list(self.goals)]
        return found

    def seen(self, goals: Array) -> Array:
        """Values that the loops compare: positions as they are, logarithms of tensions."""
        if self.quantity is Quantity.POSITION:
            return goals
        found: Array = np.log(np.maximum(goals, 0.0) + self.offset_N)
        return found

    def seen_per_unit(self, goals: Array) -> Array:
        """Slope of `seen`."""
        if self.quantity is Quantity.POSITION:
            return np.ones_like(goals)
        return 1 / (np.maximum(goals, 0.0) + self.offset_N)

    def moved(self, corrections: Array, force_N: Array) -> Array:
        """Change of the motors' commands, shape (motors,), by corrections of forces, both of shape (goals,)."""
        if self.quantity is Quantity.TENSION:
            corrections = (force_N + self.offset_N) * np.expm1(corrections)
        found: Array = self.direction @ corrections
        return found

    def moved_per_unit(self, force_N: Array) -> Array:
        """Slope of `moved` by each correction before `direction`, of the shape of the forces."""
        return np.ones_like(force_N) if self.quantity is Quantity.POSITION else force_N + self.offset_N


def motors_per_joint(problem: MechanismProblem, goals: Sequence[int]) -> Array:
    """Motion of the motors, shape (motors, goals), with which each of these bodies moves without stretch, alone.

    The largest of each column is 1: a correction is the motion of the motor that moves most.
    """
    names = [problem.names[goal] for goal in goals]
    arms = moment_arms(problem.mechanism.tendons, names, problem.start[list(goals)])
    found = np.zeros((problem.motors, len(goals)))
    for motor, own in enumerate(problem.wound_by):
        found[motor] = np.mean([arms[t] / problem.winding_m[t] for t in own], axis=0)
    scaled: Array = found / np.abs(found).max(axis=0)
    return scaled


def behind_servos(mechanism: Mechanism) -> tuple[Mechanism, Array]:
    """The mechanism with its servos as springs of their bodies, and the force that a command stands for.

    Returns
    -------
    mechanism : Mechanism
        Whose drives are forces or lead.
    stiffness : ndarray, shape (drives,)
        Force per unit of the command of each drive; 1 where the command is a force or a place.
    """
    servos = {drive.body: drive for drive in mechanism.drives if isinstance(drive, Servo)}
    bodies = tuple(
        replace(body, loads=(*body.loads, Spring(stiffness=servos[body.name].stiffness)))
        if body.name in servos
        else body
        for body in mechanism.bodies
    )
    drives = tuple(Force(body=drive.body) if drive.body in servos else drive for drive in mechanism.drives)
    stiffness = np.array([float(servos[d.body].stiffness) if d.body in servos else 1.0 for d in mechanism.drives])
    return Mechanism(bodies=bodies, tendons=mechanism.tendons, drives=drives), stiffness


def state_of(problem: MechanismProblem, memory: MechanismMemory) -> Array:
    """State of `mechanism_equations` and places of its led bodies from that of the compiled engine."""
    free, places = [], []
    dry = [any(load.states for load in body.loads) for body in problem.mechanism.bodies]
    for body, (speed, position, friction) in enumerate(memory.z):
        if problem.leads[body]:
            places.append(position)
        else:
            free += [position, speed, *([friction] if dry[body] else [])]
    tendons = [
        np.concatenate([x[1 : chain.count + 1], x[chain.count + 2 : -2]])
        for x, chain in zip(memory.x, problem.chains(), strict=True)
    ]
    return np.concatenate([free, *tendons, places])
