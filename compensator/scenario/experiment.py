"""Table [experiment]: the two-motor test, its sizes and, optionally, a user-defined state machine.

The states are columns of equal length, one entry a state, so that the table reads like a table::

    [experiment]
    states       = ["S1", "S2",                "S3"]
    motor_1      = ["A",  "A",                 "A_h"]     A acts, L loads, A_h holds its position, A_f its force
    motor_2      = ["L",  "L",                 "L"]
    motor_1_rate = [0.0,  200.0,               0.0]       N/s for A, m/s for L and A_h, 0 for A_f; positive tightens
    motor_2_rate = [0.0,  0.0,                 0.0]
    until        = ["",   "tension_1 >= 80.0", ""]        end tension that ends the state, "" for time alone
    at_most_s    = [0.2,  2.0,                 2.0]       longest time in the state
"""

import math
import re
from dataclasses import dataclass
from enum import StrEnum

from tendonff.compensator.files.dialect import is_number
from tendonff.models.errors import ParameterError, require, require_given, require_whole


class MotorMode(StrEnum):
    """Mode of a motor in a state."""

    ACT = "A"  # its force f_c is commanded, k_c = 0
    LOAD = "L"  # f_c = 0; a spring k towards the commanded rest position x_c
    HOLD = "A_h"  # an actuator that holds its position: the same with a spring that is stiff beside the tendon
    # an actuator that holds the present interaction force: f_c is the end tension at the switch, k_c = 0
    HOLD_FORCE = "A_f"

    @property
    def by_force(self) -> bool:
        """Its command is a force, not a rest position."""
        return self in (MotorMode.ACT, MotorMode.HOLD_FORCE)

    @property
    def holds(self) -> bool:
        """It keeps what it has: its position, or its force."""
        return self in (MotorMode.HOLD, MotorMode.HOLD_FORCE)


class Hold(StrEnum):
    """Quantity that the acting motor of the ten-state cycle holds in S4 and S9."""

    POSITION = "position"
    FORCE = "force"


@dataclass(frozen=True, slots=True, kw_only=True)
class EndTension:
    """Condition on the tension at one end of the tendon.

    Attributes
    ----------
    motor : int
        Which one: 1 at the near end (f_1), 2 at the far end (f_{N+1}).
    rising : bool
        Met at or above the value, else at or below it.
    tension_N : float
        Tension that ends the state [N].
    """

    motor: int
    rising: bool
    tension_N: float

    def met(self, ends_N: tuple[float, float]) -> bool:
        """Whether the end tensions f_1, f_{N+1} [N] meet the condition."""
        tension = ends_N[self.motor - 1]
        return tension >= self.tension_N if self.rising else tension <= self.tension_N

    def __str__(self) -> str:
        """As in a scenario file."""
        return f"tension_{self.motor} {'>=' if self.rising else '<='} {self.tension_N:.6g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentState:
    """State of the machine.

    Attributes
    ----------
    name : str
        S1, S2 ...
    modes : tuple[MotorMode, MotorMode]
        Of motors 1 and 2.
    rates : tuple[float, float]
        Of their commands: force [N/s] where a motor acts, rest position [m/s] where it loads or holds; positive
        tightens.
    until : EndTension or None
        What ends the state; None: time alone.
    at_most_s : float
        Longest time in the state [s].
    purpose : str
        What happens, in words.
    """

    name: str
    modes: tuple[MotorMode, MotorMode]
    rates: tuple[float, float]
    until: EndTension | None
    at_most_s: float
    purpose: str = ""


_CONDITION = re.compile(r"\s*tension_([12])\s*(>=|<=)\s*(\S+)\s*")
_COLUMNS = ("states", "motor_1", "motor_2", "motor_1_rate", "motor_2_rate", "until", "at_most_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """The two-motor test; what is left out is derived from the transmission.

    Attributes
    ----------
    low_tension_N, high_tension_N : float or None
        Tensions between which an acting motor moves its own end [N], 0 < low < high. Default: high is three quarters
        of force_max_N; low is far enough below it that a reversal crosses the whole path.
    pull_time_s : float or None
        Length of a ramp from low to high [s]; default 1, longer where the force rate asks for it.
    hold_s : float or None
        Length of the two holds [s]; default: five relaxation times, between 0.5 and 10 s.
    hold : Hold
        What S4 and S9 hold: the position (the tension relaxes), or the interaction force that a motor has as the state
        begins, as the publication words it (the tendon creeps, the motor travels).
    blend_s : float or None
        Time in which a command takes up and gives up its rate [s]; default: one period of the two motors on the load
        spring, which a blend of that length does not excite.
    rest_s : float
        Rest after a command has stopped, before the next state [s].
    load_stiffness_N_per_m : float or None
        Spring of a motor in mode L [N/m]; default: the load's stiffness.
    hold_stiffness_N_per_m : float or None
        The same in mode A_h [N/m]; default: ten times the tendon's k1 + k2.
    act_damping_N_s_per_m, load_damping_N_s_per_m, hold_damping_N_s_per_m : float or None
        Damper of a motor in modes A and A_f, against the frame, and in modes L and A_h, against its moving rest
        position [N s/m]; default: the actuator's.
    fine_segments : int
        Masses of the finer run that shows the discretisation error, 1 to 1000.
    states : tuple of str or None
        Names of the states of a machine of one's own; its seven columns are given together or not at all.
    motor_1 : tuple of str or None
        Mode of motor 1 in each state.
    motor_2 : tuple of str or None
        Mode of motor 2 in each state.
    motor_1_rate : tuple of float or None
        Rate of motor 1 in each state, in the unit of its mode.
    motor_2_rate : tuple of float or None
        Rate of motor 2 in each state, in the unit of its mode.
    until : tuple of str or None
        What ends each state, such as "T1 > 80"; empty for time alone.
    at_most_s : tuple of float or None
        Longest time in each state [s].
    """

    low_tension_N: float | None = None
    high_tension_N: float | None = None
    pull_time_s: float | None = None
    hold_s: float | None = None
    hold: Hold = Hold.POSITION
    blend_s: float | None = None
    rest_s: float = 0.1
    load_stiffness_N_per_m: float | None = None
    hold_stiffness_N_per_m: float | None = None
    act_damping_N_s_per_m: float | None = None
    load_damping_N_s_per_m: float | None = None
    hold_damping_N_s_per_m: float | None = None
    fine_segments: int = 40
    states: tuple[str, ...] | None = None
    motor_1: tuple[str, ...] | None = None
    motor_2: tuple[str, ...] | None = None
    motor_1_rate: tuple[float, ...] | None = None
    motor_2_rate: tuple[float, ...] | None = None
    until: tuple[str, ...] | None = None
    at_most_s: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name, hint in (
            ("low_tension_N", "a tendon cannot push"),
            ("high_tension_N", "a tendon cannot push"),
            ("pull_time_s", "1 is a good start"),
            ("hold_s", "five relaxation times show all of the relaxation"),
            ("load_stiffness_N_per_m", "leave it out for the load's stiffness"),
            ("hold_stiffness_N_per_m", "leave it out for ten times the tendon's"),
            ("blend_s", "0.05 is a good start, or leave it out"),
        ):
            require_given(name, getattr(self, name), above=0, hint=hint)
        for name in ("act_damping_N_s_per_m", "load_damping_N_s_per_m", "hold_damping_N_s_per_m"):
            require_given(name, getattr(self, name), least=0, hint="leave it out for the actuator's")
        require("rest_s", self.rest_s, least=0, hint="0.1 is a good start")
        low, high = self.low_tension_N, self.high_tension_N
        if low is not None and high is not None and not low < high:
            raise ParameterError(f"high_tension_N must be > low_tension_N = {low:g}, got {high}")
        require_whole("fine_segments", self.fine_segments, least=1, most=1000, hint="40 is a good start")
        self.own_states()  # so that a mistake is found when the file is read

    def own_states(self) -> tuple[ExperimentState, ...] | None:
        """The state machine of the columns; None where there are none, ParameterError where they make no sense."""
        columns = {name: getattr(self, name) for name in _COLUMNS}
        given = [name for name, column in columns.items() if column is not None]
        if not given:
            return None
        if missing := [name for name in _COLUMNS if name not in given]:
            raise ParameterError(
                f"{missing[0]} is missing: the states need the columns {', '.join(_COLUMNS)}, or none of them"
            )
        count = len(columns["states"])
        if count < 1:
            raise ParameterError("states must name at least one state; leave all columns out for the ten-state cycle")
        for name, column in columns.items():
            if len(column) != count:
                raise ParameterError(f"{name} must have one entry for each of the {count} states, got {len(column)}")
        if doubles := [name for k, name in enumerate(columns["states"]) if name in columns["states"][:k]]:
            raise ParameterError(f'states must differ, got "{doubles[0]}" twice; number them')
        return tuple(_own_state(k, *row) for k, row in enumerate(zip(*columns.values(), strict=True)))


def _own_state(
    k: int, name: str, mode_1: str, mode_2: str, rate_1: float, rate_2: float, until: str, at_most_s: float
) -> ExperimentState:
    if not re.fullmatch(r"[\w.-]+", name):
        raise ParameterError(f'states[{k}] must be a name of letters and digits such as "S1", got "{name}"')
    modes = _mode(mode_1, f"motor_1[{k}]"), _mode(mode_2, f"motor_2[{k}]")
    for motor, mode, rate in ((1, modes[0], rate_1), (2, modes[1], rate_2)):
        require(f"motor_{motor}_rate[{k}]", rate, hint="use 0 for a command that stays")
        if rate and mode is MotorMode.HOLD_FORCE:
            raise ParameterError(
                f"motor_{motor}_rate[{k}] must be 0 where motor_{motor} holds its force (A_f), got {rate}; "
                'use "A" for a force that moves'
            )
    require(f"at_most_s[{k}]", at_most_s, above=0, hint="every state ends after some time")
    return ExperimentState(
        name=name, modes=modes, rates=(rate_1, rate_2), until=_condition(until, k), at_most_s=at_most_s
    )


def _mode(text: str, where: str) -> MotorMode:
    try:
        return MotorMode(text)
    except ValueError:
        known = ", ".join(f'"{mode}"' for mode in MotorMode)
        raise ParameterError(f'{where} must be one of {known}, got "{text}"') from None


def _condition(text: str, k: int) -> EndTension | None:
    if not text.strip():
        return None
    found = _CONDITION.fullmatch(text)
    if found is None or not is_number(found[3]) or not math.isfinite(value := float(found[3])):
        raise ParameterError(
            f'until[{k}] must read like "tension_1 >= 80" (motor 1 or 2, >= or <=, a tension in N) or be empty, '
            f'got "{text}"'
        )
    return EndTension(motor=int(found[1]), rising=found[2] == ">=", tension_N=value)
