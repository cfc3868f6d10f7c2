"""Parts of a mechanism: bodies with a coordinate each, tendons whose ends and sections follow them, drives on them.

::

    drive --> [ body ]==near==( tendon: sections of its path follow bodies )==far==[ body ] <-- loads
                                                                                  [ body ] <-- loads

A tendon's coordinate is positive towards its near end, as everywhere. An attachment says how far its end of the tendon
travels that way per unit of the bodies that it follows: a near end moved towards positive stretches the tendon, a far
end moved towards positive releases it, and the tension acts on either body against, and along, that travel.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Protocol

import casadi as ca
import numpy as np

from tendonff.models import parameters
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.layout import Array
from tendonff.models.mechanism.loads import LoadLaw, require_number

Places = dict[str, ca.SX]
"""Coordinate of each body by name [m or rad]."""


class Unit(StrEnum):
    """Unit of a body's coordinate."""

    METRE = "m"
    RADIAN = "rad"

    @property
    def effort(self) -> str:
        """Unit of what acts on the body, as it stands in names."""
        return "N" if self is Unit.METRE else "N_m"


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """Part of a mechanism that moves in one coordinate.

    Parameters
    ----------
    name : str
    unit : Unit
        Metres or radians.
    inertia : float or ca.SX
        Mass [kg] or moment of inertia [kg m2], > 0; without effect where a drive leads the body.
    loads : tuple of LoadLaw, optional
        Dampers, springs, gravity, stops, dry friction.
    span : tuple of float, optional
        Least and largest coordinate of a run [m or rad], which decides how many masses sections that follow it get.
    """

    name: str
    unit: Unit
    inertia: ca.SX
    loads: tuple[LoadLaw, ...] = ()
    span: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", Unit(self.unit))
        require_number(f'inertia of "{self.name}"', self.inertia, above=0, hint="kg, or kg m2 where it turns")
        low, high = self.span
        if not -math.inf < low <= high < math.inf:
            raise ParameterError(f'span of "{self.name}" must be two finite numbers in order, got {low:g}, {high:g}')
        if len(set(self.states)) < len(self.states):
            raise ParameterError(f'"{self.name}" has two dry frictions; make one of them, with the sum of both')

    def at(self, level: Level) -> "Body":
        """The body at a fidelity level."""
        loads = tuple(load.at(level) for load in self.loads)
        return Body(name=self.name, unit=self.unit, inertia=self.inertia, loads=loads, span=self.span)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that its loads bring along."""
        return tuple(name for load in self.loads for name in load.states)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Constant travel of a tendon's end per unit of a body: a drum's radius, a moment arm, or 1.

    Parameters
    ----------
    body : str
    metres_per_unit : float
        Travel towards the near end [m/m or m/rad].
    """

    body: str
    metres_per_unit: ca.SX

    def __post_init__(self) -> None:
        require_number(f'metres_per_unit of "{self.body}"', self.metres_per_unit, hint="positive towards the near end")

    def travel_m(self, q: ca.SX) -> ca.SX:
        """Travel of the end for a coordinate [m]."""
        return self.metres_per_unit * q

    def slope_m(self, q: float) -> float:  # noqa: ARG002
        """Travel per unit of the body at a coordinate [m/m or m/rad]."""
        return float(self.metres_per_unit)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """Travel of a tendon's end by a body's coordinate: cubics between knots, straight beyond them.

    Parameters
    ----------
    body : str
    knots : ndarray, shape (n + 1,)
        Increasing coordinates [m or rad].
    cubics : ndarray, shape (n, 4)
        c0 + c1 s + c2 s^2 + c3 s^3 with s from the knot [m].
    """

    body: str
    knots: Array
    cubics: Array

    def __post_init__(self) -> None:
        knots, cubics = np.array(self.knots, dtype=np.float64), np.array(self.cubics, dtype=np.float64)
        if knots.ndim != 1 or len(knots) < 2 or not (np.diff(knots) > 0).all() or cubics.shape != (len(knots) - 1, 4):
            raise ParameterError(
                f'a table of "{self.body}" needs n + 1 increasing knots and n rows of 4 coefficients, '
                f"got {knots.shape} and {cubics.shape}"
            )
        object.__setattr__(self, "knots", knots)
        object.__setattr__(self, "cubics", cubics)

    def travel_m(self, q: ca.SX) -> ca.SX:
        """Travel of the end for a coordinate [m]."""
        first, last = float(self.knots[0]), float(self.knots[-1])
        within = ca.if_else(q < first, first, ca.if_else(q > last, last, q))
        travel = slope = ca.SX(0)
        for k in reversed(range(len(self.cubics))):
            s, (c0, c1, c2, c3) = within - float(self.knots[k]), map(float, self.cubics[k])
            here, rise = c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2 * c2 + s * 3 * c3)
            before = within < float(self.knots[k + 1])
            travel, slope = (
                (here, rise)
                if k == len(self.cubics) - 1
                else (ca.if_else(before, here, travel), ca.if_else(before, rise, slope))
            )
        return travel + slope * (q - within)

    def slope_m(self, q: float) -> float:
        """Travel per unit of the body at a coordinate [m/m or m/rad]."""
        within = min(max(q, float(self.knots[0])), float(self.knots[-1]))
        k = min(max(int(np.searchsorted(self.knots, within, side="right")) - 1, 0), len(self.cubics) - 1)
        s, (_, c1, c2, c3) = within - float(self.knots[k]), map(float, self.cubics[k])
        return c1 + s * (2 * c2 + s * 3 * c3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """End of a tendon: the bodies that move it; none where it is fixed to the frame.

    Parameters
    ----------
    arms : tuple of Arm or Table, optional
        One for each body that moves it, as a tendon over several joints has moment arms about each of them.
    """

    arms: tuple[Arm | Table, ...] = ()

    def __post_init__(self) -> None:
        bodies = self.bodies
        if len(set(bodies)) != len(bodies):
            raise ParameterError(f"an end of a tendon needs one arm for each body, got {', '.join(bodies)}")

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that move it."""
        return tuple(arm.body for arm in self.arms)

    def travel_m(self, places: Places) -> ca.SX:
        """Where the end is, up to an offset, positive towards the near end [m]."""
        return sum((arm.travel_m(places[arm.body]) for arm in self.arms), ca.SX(0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tendon:
    """A tendon from its near end, where it is pulled, to its far end.

    Parameters
    ----------
    name : str
    path : parameters.Path
        On which it slides; sections name the bodies that they follow (`joint`).
    tendon : parameters.Tendon
        Mass and stiffness.
    friction : parameters.Friction
    near, far : Attachment
        What moves its ends.
    """

    name: str
    path: parameters.Path
    tendon: parameters.Tendon
    friction: parameters.Friction
    near: Attachment
    far: Attachment

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that move its ends or its sections."""
        sections = (joint for section in self.path.sections for joint in section.joints)
        return tuple(dict.fromkeys((*self.near.bodies, *sections, *self.far.bodies)))


class Drive(Protocol):
    """Action on a body from outside.

    A drive that `leads` gives its body's motion; any other has one input, and an effort on the body.
    """

    leads: ClassVar[bool]

    @property
    def body(self) -> str:
        """The body it acts on."""

    def effort(self, q: ca.SX, w: ca.SX, command: ca.SX) -> ca.SX:
        """Force or torque on the body, positive along its coordinate [N or N m]."""

    def command_name(self, unit: Unit) -> str:
        """Name of its input, with its unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """A force or torque on a body: a force drive, or what the body touches."""

    leads: ClassVar[bool] = False

    body: str

    def effort(self, q: ca.SX, w: ca.SX, command: ca.SX) -> ca.SX:  # noqa: ARG002
        """The command itself [N or N m]."""
        return command

    def command_name(self, unit: Unit) -> str:
        """Such as `actuator_force_N`."""
        return f"{self.body}_{'force' if unit is Unit.METRE else 'torque'}_{unit.effort}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo:
    """A position drive that gives way: a spring between its command and the body.

    Parameters
    ----------
    body : str
    stiffness : float
        Effort over position error [N/m or N m/rad], >= 0.
    """

    leads: ClassVar[bool] = False

    body: str
    stiffness: ca.SX

    def __post_init__(self) -> None:
        require_number(f'stiffness of the servo on "{self.body}"', self.stiffness, least=0, hint="from its data sheet")

    def effort(self, q: ca.SX, w: ca.SX, command: ca.SX) -> ca.SX:  # noqa: ARG002
        """K (command - q) [N or N m]."""
        return self.stiffness * (command - q)

    def command_name(self, unit: Unit) -> str:
        """Such as `actuator_command_m`."""
        return f"{self.body}_command_{unit}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """A stiff position drive, or a joint whose motion is known: the body goes where it is said to."""

    leads: ClassVar[bool] = True

    body: str

    def effort(self, q: ca.SX, w: ca.SX, command: ca.SX) -> ca.SX:  # noqa: ARG002
        """None beside the motion."""
        return ca.SX(0)

    def command_name(self, unit: Unit) -> str:
        """Such as `drum_rad`: a place, not an input."""
        return f"{self.body}_{unit}"
