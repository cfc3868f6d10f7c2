"""The state machine of the two-motor test, as data: the ten states, and how they follow one another.

The paper shows its work flow as a picture (Fig. 7) whose text cannot be read. The cycle here is chosen to do what the
paper states: motor 1 acts first and motor 2 second, the acting motor holds in S4 and S9, and the tendon reverses
its direction, and with it the friction, in S5 and in S7 and nowhere else.

====  ========  ========  ==================================================================  ========
state motor 1   motor 2   what happens                                                        sliding
====  ========  ========  ==================================================================  ========
S1    A         L         both rest at uniform low tension                                    none
S2    A         L         motor 1 pulls until the sliding reaches motor 2                     to 1
S3    A         L         motor 1 pulls on to the high tension, all of the tendon slides      to 1
S4    A_h, A_f  L         motor 1 holds its position or its force: relaxation, or creep       none
S5    A         L         motor 1 releases to the low tension: friction reverses              to 2
S6    L         A         the motors change roles; motor 2 pulls to the high tension          to 2
S7    L         A         motor 2 releases until it reaches motor 1: friction reverses        to 1
S8    L         A         motor 2 releases to the low tension, all of the tendon slides       to 1
S9    L         A_h, A_f  motor 2 holds its position or its force: recovery upwards           none
S10   A         L         the motors change roles back and rest; the next S2 slides on to 1   none
====  ========  ========  ==================================================================  ========

A_h holds the position, A_f "the current interaction force", as the paper words its A_h: then a creeping tendon only
lengthens, and the tension of the held end stays. Every state takes up the rates of its commands over a blend, keeps
them until its condition or its longest time, gives them up over a blend and rests, so that motors change their modes at
standstill.
"""

import math
from dataclasses import dataclass

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.experiment import EndTension, Experiment, ExperimentState, Hold, MotorMode
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.experiment.rig import Plan
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.assembly import End

_A, _L, _H = MotorMode.ACT, MotorMode.LOAD, MotorMode.HOLD

_HIGH_SHARE = 0.75  # of force_max_N: leaves room for an own table and for overshoot
_CROSSING_MARGIN = 1.5  # a release goes this much further in T + p than the reversal needs to cross the path
_MOST_STEPS = 500_000  # half a minute, twenty times a usual test
_LEAST_LOW_SHARE = 0.03  # of the high tension, where the wrap angle is too large for a reversal to cross
_REACH_MARGIN = 1.1  # S2 and S7 go this much further than the quasi-static law needs for sliding to reach the other end
_LEAST_RAMP = 1.05  # factor of tension that S3 and S8 still have to go
_PAUSE_S = 0.2  # of S1 and S10
_PATIENCE = 3.0  # a ramp's longest time over its planned time


@dataclass(frozen=True, slots=True, kw_only=True)
class StatePass:
    """Record of a state of the machine.

    Attributes
    ----------
    state : ExperimentState
        The state.
    first_row, last_row : int
        Rows of the run in it; row 0 is the start of the test.
    stop_row : int
        Row at which its condition or its longest time was reached and the commands began to stop.
    met : bool
        Its condition ended it; False: its longest time did.
    end_forces_N : tuple[float | None, float | None]
        Force commands at its end [N], for motors that act.
    """

    state: ExperimentState
    first_row: int
    last_row: int
    stop_row: int
    met: bool
    end_forces_N: tuple[float | None, float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Record of the machine, to be repeated on other models."""

    passes: tuple[StatePass, ...]
    rates: FloatArray  # shape (n, 2); rates of both commands in each step, N/s or m/s


def plan_experiment(scenario: Scenario) -> Plan:
    """The test of a scenario: its [experiment] table, completed by what its transmission suggests.

    InputError if the actuator has dry friction, the tensions are not low < high within its range, or a rate exceeds
    its own.
    """
    settings, transmission = scenario.experiment, scenario.transmission
    where = f"{scenario.source.name} [experiment]"
    for key, none in (("coulomb_N", 0.0), ("gear_efficiency", 1.0)):
        value = getattr(transmission.actuator, key)
        if value not in (None, none):
            raise InputError(
                f"{scenario.source.name} [actuator]: {key} must be {none:g} in the two-motor test, whose motors have "
                f"no dry friction, got {value:g}; leave it out in a copy of the scenario for this test"
            )
    low, high = _tensions(settings, transmission, where)
    own = settings.own_states()
    states = ten_states(settings, transmission, low, high) if own is None else own
    spring = settings.load_stiffness_N_per_m or transmission.load.stiffness_N_per_m
    period = 2 * math.pi * math.sqrt(2 * transmission.actuator.mass_kg / spring)
    fastest = transmission.actuator.force_rate_max_N_per_s
    for state in states:
        for motor, (mode, rate) in enumerate(zip(state.modes, state.rates, strict=True), start=1):
            if mode.by_force and abs(rate) > fastest * (1 + 1e-9):
                raise InputError(
                    f"{where}: motor_{motor}_rate of {state.name} must be within force_rate_max_N_per_s = {fastest:g}, "
                    f"got {rate:g}; ramp more slowly"
                )
    blend = settings.blend_s or period
    longest = sum(state.at_most_s + 2 * blend + settings.rest_s for state in states)
    if not longest / scenario.run.step_s <= _MOST_STEPS:
        raise InputError(
            f"{where}: the states may take {longest:.3g} s, more than {_MOST_STEPS:.0g} steps of step_s = "
            f"{scenario.run.step_s:g}; a faster force_rate_max_N_per_s, shorter states or a larger step make it shorter"
        )
    hold = settings.hold_stiffness_N_per_m or 10 * transmission.tendon.quick_stiffness_N_per_m
    mass, usual = transmission.actuator.mass_kg, transmission.actuator.damping_N_s_per_m

    def end(damping: float | None, stiffness: float) -> End:
        return End(mass_kg=mass, damping_N_s_per_m=usual if damping is None else damping, stiffness_N_per_m=stiffness)

    act = end(settings.act_damping_N_s_per_m, 0.0)
    ends = {
        MotorMode.ACT: act,
        MotorMode.HOLD_FORCE: act,
        MotorMode.LOAD: end(settings.load_damping_N_s_per_m, spring),
        MotorMode.HOLD: end(settings.hold_damping_N_s_per_m, hold),
    }
    return Plan(
        transmission=transmission,
        step_s=scenario.run.step_s,
        start_tension_N=low,
        ends=ends,
        states=states,
        blend_s=blend,
        rest_s=settings.rest_s,
    )


def _tensions(settings: Experiment, transmission: Transmission, where: str) -> tuple[float, float]:
    """Low and high tension [N]: a release from high to low crosses the whole path, if that is possible."""
    law, actuator = CapstanLaw.of(transmission), transmission.actuator
    high = settings.high_tension_N or _HIGH_SHARE * actuator.force_max_N
    low = settings.low_tension_N
    if low is None:
        other_end = law.output_bounds_N(high)[0]  # after pulling
        crossed = float(law.input_for_N(other_end, Branch.RELEASE)) + law.adhesion_N
        low = max(crossed / _CROSSING_MARGIN - law.adhesion_N, _LEAST_LOW_SHARE * high, actuator.force_min_N)
    if not 0 < low < high:
        raise InputError(f"{where}: low_tension_N must be > 0 and < high_tension_N = {high:g}, got {low:g}")
    if not (actuator.force_min_N <= low and high <= actuator.force_max_N):
        raise InputError(
            f"{where}: low_tension_N to high_tension_N must be within the actuator's {actuator.force_min_N:g} to "
            f"{actuator.force_max_N:g} N, got {low:g} to {high:g}"
        )
    return low, high


def ten_states(
    settings: Experiment, transmission: Transmission, low_N: float, high_N: float
) -> tuple[ExperimentState, ...]:
    """The cycle of the module's table, between two tensions [N] to which the acting motor moves its own end.

    The quasi-static law of the path gives the travel of S2 and S7.
    """
    law, actuator = CapstanLaw.of(transmission), transmission.actuator
    span = high_N - low_N
    ramp = max(settings.pull_time_s or 1.0, span / actuator.force_rate_max_N_per_s)
    rate = span / ramp
    slowest = max(transmission.tendon.relaxation_time_s, transmission.tendon.second_relaxation_time_s or 0.0)
    hold = settings.hold_s or min(max(5 * slowest, 0.5), 10.0)
    holding = _H if settings.hold is Hold.POSITION else MotorMode.HOLD_FORCE
    what = f"holds its {settings.hold}"
    longest = _PATIENCE * ramp

    p = law.adhesion_N
    felt_by_2 = float(law.input_for_N(low_N, Branch.PULL) + p) * _REACH_MARGIN - p
    # Motor 2 pulls and releases in S6 and S7: seen from it, the directions of the law are exchanged.
    other_end = float(law.input_for_N(high_N, Branch.RELEASE))
    felt_by_1 = (law.largest_output_N(other_end) + p) / _REACH_MARGIN - p
    felt_by_2, felt_by_1 = min(felt_by_2, high_N / _LEAST_RAMP), max(felt_by_1, low_N * _LEAST_RAMP)

    def state(
        name: str,
        modes: tuple[MotorMode, MotorMode],
        purpose: str,
        *,
        until: EndTension | None = None,
        rate: float = 0.0,
        at_most_s: float = longest,
    ) -> ExperimentState:
        rates = (0.0, rate) if modes[1] is _A else (rate, 0.0)
        return ExperimentState(name=name, modes=modes, rates=rates, until=until, at_most_s=at_most_s, purpose=purpose)

    def up(motor: int, tension: float) -> EndTension:
        return EndTension(motor=motor, rising=True, tension_N=tension)

    def down(motor: int, tension: float) -> EndTension:
        return EndTension(motor=motor, rising=False, tension_N=tension)

    return (
        state("S1", (_A, _L), "both rest", at_most_s=_PAUSE_S),
        state("S2", (_A, _L), "1 pulls until the tension reaches motor 2", until=up(1, felt_by_2), rate=rate),
        state("S3", (_A, _L), "1 pulls, all slides", until=up(1, high_N), rate=rate),
        state("S4", (holding, _L), f"1 {what}", at_most_s=hold),
        state("S5", (_A, _L), "1 releases, friction reverses", until=down(1, low_N), rate=-rate),
        state("S6", (_L, _A), "2 pulls", until=up(2, high_N), rate=rate),
        state("S7", (_L, _A), "2 releases, friction reverses", until=down(2, felt_by_1), rate=-rate),
        state("S8", (_L, _A), "2 releases, all slides", until=down(2, low_N), rate=-rate),
        state("S9", (_L, holding), f"2 {what}", at_most_s=hold),
        state("S10", (_A, _L), "both rest", at_most_s=_PAUSE_S),
    )


class Machine:
    """The state machine in one state: gives the next commands from the end tensions."""

    def __init__(self, state: ExperimentState, plan: Plan) -> None:
        step_s = plan.step_s
        self._state = state
        self._gain = 0.0
        self._gain_step = min(step_s / plan.blend_s, 1.0)
        self._longest = max(round(state.at_most_s / step_s), 1)
        moves = any(state.rates)
        self._after_stop = round((plan.blend_s + plan.rest_s) / step_s) if moves else 0
        self._steps = 0
        self.stopped_at: int | None = None
        self.met = False

    def next_rates(self, ends_N: tuple[float, float]) -> tuple[float, float] | None:
        """Rates of the commands during the next step, at end tensions f_1, f_{N+1} [N]; None when the state is over."""
        if self.stopped_at is None:
            until = self._state.until
            self.met = until is not None and until.met(ends_N)
            if self.met or self._steps >= self._longest:
                self.stopped_at = self._steps
        if self.stopped_at is None:
            self._gain = min(self._gain + self._gain_step, 1.0)
        elif self._steps >= max(self.stopped_at + self._after_stop, 1):  # at least one step, even if it was met before
            return None
        else:
            self._gain = max(self._gain - self._gain_step, 0.0)
        self._steps += 1
        return self._gain * self._state.rates[0], self._gain * self._state.rates[1]
