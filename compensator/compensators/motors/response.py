"""Response of a mechanism: the motion that its motors are asked for, or that commands bring about."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tendonff.compensator.files.reading import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorResponse:
    """Motion of a mechanism at the rows of a reference: what an inverse asks for, or what commands bring about.

    Attributes
    ----------
    status : StrEnum
        "exact" or "done" where every tendon stays taut, "slack", or "would_push".
    message : str
        What happened, for the user.
    output : ndarray, shape (rows, goals)
        What the task compares with its reference [rad or N m].
    position_rad : ndarray, shape (rows, joints)
        Of the driven joints, then of those that something else moves.
    motor_rad, torque_N_m : ndarray, shape (rows, motors)
        Angles behind the drives since the start, and torques, inertia and dry friction of the drives included.
    tension_N, drum_N : ndarray, shape (rows, tendons)
        At the far ends, and at the drums.
    lowest_N : ndarray, shape (rows,)
        Smallest tension along any tendon.
    work : int
        Evaluations of an inverse, or linear solves of a simulation.
    """

    status: StrEnum
    message: str
    output: FloatArray
    position_rad: FloatArray
    motor_rad: FloatArray
    torque_N_m: FloatArray
    tension_N: FloatArray
    drum_N: FloatArray
    lowest_N: FloatArray
    work: int

    @property
    def is_taut(self) -> bool:
        """No tendon goes slack, and none would have to push."""
        return self.status in ("exact", "done")

    @property
    def would_push(self) -> bool:
        """A tendon would have to push."""
        return self.status == "would_push"

    @property
    def slack(self) -> str:
        """Which tendon goes slack, and when; empty where none does."""
        return "" if self.is_taut else self.message

    def rows(self, kept: slice) -> "MotorResponse":
        """Some of its rows."""
        return replace(
            self,
            output=self.output[kept],
            position_rad=self.position_rad[kept],
            motor_rad=self.motor_rad[kept],
            torque_N_m=self.torque_N_m[kept],
            tension_N=self.tension_N[kept],
            drum_N=self.drum_N[kept],
            lowest_N=self.lowest_N[kept],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turned:
    """Motion from where the reference starts, under angles of the drums.

    Attributes
    ----------
    response : MotorResponse
    columns : dict of str to ndarray, shape (rows,)
        Of its joints, by name with the unit.
    judged : tuple of str
        Those that the motors decide.
    """

    response: MotorResponse
    columns: dict[str, FloatArray]
    judged: tuple[str, ...]

    @property
    def outputs(self) -> FloatArray:
        """The columns that the motors decide, shape (rows, n)."""
        return np.column_stack([self.columns[name] for name in self.judged])


def finer(rows: FloatArray, parts: int) -> FloatArray:
    """Straight lines between rows, shape (rows, ...), cut into parts each."""
    at = np.arange((len(rows) - 1) * parts + 1) / parts
    columns = np.asarray(rows, dtype=np.float64).reshape(len(rows), -1).T
    found = np.column_stack([np.interp(at, np.arange(len(rows)), column) for column in columns])
    return found.reshape(-1, *rows.shape[1:])
