"""Profile of a compensator: the force of the actuator over time, or its command, and its quality."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tendonff.models.parameters.drive import Drive
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tracking.result import Tracking

FloatArray = NDArray[np.float64]


class ProfileStatus(StrEnum):
    """Score of a profile."""

    GOOD = "good"  # what the compensator is meant to give
    DOUBTFUL = "doubtful"  # usable; the message states what is missing
    FAILED = "failed"  # not to be sent to an actuator; the message states the reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """The answer of a compensator.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
        Force of the actuator at the rows of the reference [N].
    travel_m, command_m : ndarray, shape (n,), or None
        Travel of the actuator's end from rest that belongs to the force, where the compensator knows it, and command of
        a position drive relative to the start [m].
    command_N : ndarray, shape (n,), or None
        Command of a force drive that is not ideal [N]; None where the command is the force.
    message : str
        Why the status is not good; empty where it is.
    warnings : tuple of str
        All that the user should know of this profile, the message included.
    tracking : Tracking or None
        How an optimisation ended; None where nothing was optimised.
    status : ProfileStatus
        How it ended.
    """

    force_N: FloatArray
    travel_m: FloatArray | None = None
    command_m: FloatArray | None = None
    command_N: FloatArray | None = None
    status: ProfileStatus = ProfileStatus.GOOD
    message: str = ""
    warnings: tuple[str, ...] = ()
    tracking: Tracking | None = None

    @classmethod
    def of_setpoint(cls, values: FloatArray, drive: Drive) -> "Profile":
        """A profile of which only the drive's setpoint is known: its force [N], or its command [m]."""
        if drive is Drive.POSITION:
            return cls(force_N=np.full(len(values), np.nan), command_m=values)
        return cls(force_N=values)

    @property
    def given(self) -> FloatArray:
        """Values sent to the drive, shape (n,): a command where there is one, else the force [N]."""
        commands = (values for values in (self.command_m, self.command_N) if values is not None)
        return next(commands, self.force_N)

    def setpoint(self, drive: Drive) -> FloatArray:
        """Setpoint of the drive, shape (n,): the force [N], or the command of a position drive [m].

        SolveError where there is no command, because the motion could not be simulated.
        """
        if drive is not Drive.POSITION:
            return self.force_N if self.command_N is None else self.command_N
        if self.command_m is None:
            raise SolveError("the profile has no command for the position drive: its motion could not be simulated")
        return self.command_m

    def require(self) -> "Profile":
        """Return itself, or raise `SolveError` with the diagnosis where it must not be used."""
        if self.status is ProfileStatus.FAILED:
            raise SolveError(" ".join([self.message, *(w for w in self.warnings if self.message not in w)]))
        return self
