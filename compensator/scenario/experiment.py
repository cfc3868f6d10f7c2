"""Table [experiment]: the two-motor test, its sizes and, if wanted, a state machine of one's own.

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

from tendonff.models.errors import ParameterError, require, require_given, require_whole


class MotorMode(StrEnum):
    """What a motor does in a state."""

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
    """What the acting motor of the ten-state cycle holds in S4 and S9."""

    POSITION = "position"
    FORCE = "force"


@dataclass(frozen=True, slots=True, kw_only=True)
class EndTension:
    """Condition on the tension at one end of the tendon."""

    motor: int  # 1 near end (f_1), 2 far end (f_{N+1})
    rising: bool  # met at or above the value, else at or below it
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
    """One state of the machine."""

    name: str  # S1, S2 ...
    modes: tuple[MotorMode, MotorMode]  # of motors 1 and 2
    # of their commands: force [N/s] where a motor acts, rest position [m/s] where it loads or holds; positive tightens
    rates: tuple[float, float]
    until: EndTension | None  # what ends the state; None: time alone
    at_most_s: float  # longest time in the state
    purpose: str = ""  # what happens, in words


_CONDITION = re.compile(r"\s*tension_([12])\s*(>=|<=)\s*(\S+)\s*")
_COLUMNS = ("states", "motor_1", "motor_2", "motor_1_rate", "motor_2_rate", "until", "at_most_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """The two-motor test; what is left out is derived from the transmission.

    Parameters
    ----------
    low_tension_N, high_tension_N : float, optional
        Tensions between which an acting motor moves its own end [N], 0 < low < high. Default: high is three quarters of
        force_max_N; low is far enough below it that a reversal crosses the whole path.
    pull_time_s : float, optional
        Time of a ramp from low to high [s], > 0. Default 1, longer where force_rate_max_N_per_s asks for it.
    hold_s : float, optional
        Length of the two holds [s], > 0. Default: five relaxation times, between 0.5 and 10 s.
    hold : Hold, optional
        What S4 and S9 hold: "position" (default; the tension relaxes) or "force", the interaction force that a motor
        has as the state begins, as the paper words it (the tendon creeps, the motor travels).
    blend_s : float, optional
        Time in which a command takes up and gives up its rate [s], > 0. Default: one period of the two motors on the
        load spring, which a blend of that length does not excite.
    rest_s : float, optional
        Rest after a command has stopped, before the next state [s], >= 0. Default 0.1.
    load_stiffness_N_per_m : float, optional
        Spring of a motor in mode L [N/m], > 0. Default: the load's stiffness.
    hold_stiffness_N_per_m : float, optional
        Spring of a motor in mode A_h [N/m], > 0. Default: ten times the tendon's k1 + k2.
    act_damping_N_s_per_m, load_damping_N_s_per_m, hold_damping_N_s_per_m : float, optional
        Damper of a motor in modes A and A_f, against the frame, and in modes L and A_h, against its moving rest
        position [N s/m], >= 0. Default: the actuator's.
    fine_segments : int, optional
        Number of masses of the finer run that shows the discretisation error, 1 to 1000. Default 40.
    states, motor_1, motor_2, until : tuple of str, optional
        Columns of a state machine of one's own: name, modes (A, L, A_h, A_f), end condition ("tension_1 >= 80" or "").
    motor_1_rate, motor_2_rate, at_most_s : tuple of float, optional
        Columns: rates of the commands [N/s or m/s], longest time in the state [s]. All seven columns or none.
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
        return tuple(self._own_state(columns, k) for k in range(count))

    @staticmethod
    def _own_state(columns: dict[str, tuple[object, ...]], k: int) -> ExperimentState:
        name = str(columns["states"][k])
        if not re.fullmatch(r"[\w.-]+", name):
            raise ParameterError(f'states[{k}] must be a name of letters and digits such as "S1", got "{name}"')
        modes = _mode(columns, 1, k), _mode(columns, 2, k)
        rates = tuple(float(str(columns[f"motor_{motor}_rate"][k])) for motor in (1, 2))
        for motor, rate in enumerate(rates, start=1):
            require(f"motor_{motor}_rate[{k}]", rate, hint="use 0 for a command that stays")
            if rate and modes[motor - 1] is MotorMode.HOLD_FORCE:
                raise ParameterError(
                    f"motor_{motor}_rate[{k}] must be 0 where motor_{motor} holds its force (A_f), got {rate}; "
                    'use "A" for a force that moves'
                )
        longest = float(str(columns["at_most_s"][k]))
        require(f"at_most_s[{k}]", longest, above=0, hint="every state ends after some time")
        return ExperimentState(
            name=name,
            modes=modes,
            rates=(rates[0], rates[1]),
            until=_condition(str(columns["until"][k]), k),
            at_most_s=longest,
        )


def _mode(columns: dict[str, tuple[object, ...]], motor: int, k: int) -> MotorMode:
    text = str(columns[f"motor_{motor}"][k])
    try:
        return MotorMode(text)
    except ValueError:
        known = ", ".join(f'"{mode}"' for mode in MotorMode)
        raise ParameterError(f'motor_{motor}[{k}] must be one of {known}, got "{text}"') from None


def _condition(text: str, k: int) -> EndTension | None:
    if not text.strip():
        return None
    found = _CONDITION.fullmatch(text)
    try:
        value = float(found[3]) if found else math.nan
    except ValueError:
        value = math.nan
    if found is None or not math.isfinite(value):
        raise ParameterError(
            f'until[{k}] must read like "tension_1 >= 80" (motor 1 or 2, >= or <=, a tension in N) or be empty, '
            f'got "{text}"'
        )
    return EndTension(motor=int(found[1]), rising=found[2] == ">=", tension_N=value)
