"""The rig of the two-motor test: two equal linear motors on a tendon, each of which acts, loads or holds.

::

    motor 1 (near end)             path of six equal arcs              motor 2 (far end)
    [ m_a ]~~f_1~~( )~~f_2~~( )~~f_3~~( )~~f_4~~( )~~f_5~~( )~~f_6~~( )~~f_7~~[ m_a ]
    <------ positions positive

    A    f_c commanded, k_c = 0
    A_f  the same; f_c stays what the end tension was as the mode began
    L    f_c = 0, k_c = k, rest position x_c commanded
    A_h  the same with a stiff spring: the motor acts by keeping its position

Each mode has its own damper: against the frame where a force is commanded, else against the rest position, which moves.
A change of mode is bumpless: the new command is the one that carries the present end tension at the present position.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.experiment import ExperimentState, MotorMode
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.assembly import End, rest_damper_force
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.simulate import Simulator, describe_failure

Modes = tuple[MotorMode, MotorMode]

_OUTWARD = (1.0, -1.0)  # direction in which a motor's position moves away from the tendon


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The test of one scenario: what the rig is made of, its states and how commands blend.

    Attributes
    ----------
    transmission : Transmission
        Path, tendon and friction; both motors have the mass and damping of its actuator.
    step_s : float
        Time step [s].
    start_tension_N : float
        Uniform tension at rest before the test [N].
    ends : dict of MotorMode to End
        a motor in each mode: its mass, its damper, k_c.
    states : tuple of ExperimentState
        The states of the test, in order.
    blend_s, rest_s : float
        Time in which a command takes up and gives up its rate, and rest after that [s].
    """

    transmission: Transmission
    step_s: float
    start_tension_N: float
    ends: Mapping[MotorMode, End]
    states: tuple[ExperimentState, ...]
    blend_s: float
    rest_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRows:
    """Motion of the rig over some steps."""

    tension_N: FloatArray  # shape (n, N + 1)
    position_m: FloatArray  # shape (n, 2); of motors 1 and 2, positive towards motor 1's side
    # shape (n, 2); each motor's pull on its end of the tendon: f_c, or its spring's force without the damper's
    force_N: FloatArray
    velocity_m_per_s: FloatArray  # shape (n, N + 2); v_a, v_1 .. v_N, v_l


class Rig:
    """The rig at one fidelity level, at rest under uniform tension when it is made.

    `modes` is what the motors do at first; by default the number of masses is the path's own.
    """

    def __init__(self, plan: Plan, level: Level, modes: Modes, segments: int | None = None) -> None:
        self._plan = plan
        chain = Chain.of(plan.transmission, level, segments)
        self._chain = replace(chain, far=chain.near)  # two equal motors
        state = self._chain.rest_state(plan.start_tension_N)
        self._tension = np.full(self._chain.count + 1, plan.start_tension_N)
        self._position = np.array([state.near_position_m, state.far_position_m])
        self._time = 0.0
        self._modes: Modes = modes
        self._command = np.array([self._bumpless(modes[k], k) for k in (0, 1)])
        self._simulator = self._new_simulator(state)

    @property
    def end_tensions_N(self) -> tuple[float, float]:
        """f_1 and f_{N+1} now [N]."""
        return float(self._tension[0]), float(self._tension[-1])

    @property
    def forces_N(self) -> tuple[float | None, float | None]:
        """Force commands of the motors that act [N]."""
        near, far = (
            float(command) if mode.by_force else None for mode, command in zip(self._modes, self._command, strict=True)
        )
        return near, far

    def now(self) -> RigRows:
        """The present instant as one row."""
        state = self._simulator.state
        return RigRows(
            tension_N=self._tension[None, :].copy(),
            position_m=self._position[None, :].copy(),
            force_N=self._motor_force(self._command[None, :], self._position[None, :]),
            velocity_m_per_s=state.velocity_m_per_s[None, :],
        )

    def switch(self, modes: Modes) -> None:
        """Change what the motors do, without a jump; a motor that keeps its mode keeps its command."""
        if modes != self._modes:
            for k in (0, 1):
                if modes[k] is not self._modes[k]:
                    self._command[k] = self._bumpless(modes[k], k)
            self._modes = modes
            self._simulator = self._new_simulator(self._simulator.state)

    def advance(self, rates: FloatArray) -> RigRows:
        """Move the commands at given rates; the rows at the ends of the steps. SolveError when a step cannot be solved.

        The rates, shape (n, 2), are N/s where a motor acts, else m/s; positive tightens the tendon.
        """
        outward = [1.0 if mode.by_force else _OUTWARD[k] for k, mode in enumerate(self._modes)]
        commands = self._command + np.cumsum(rates * outward, axis=0) * self._plan.step_s
        rows = self._simulator.advance(self._inputs(commands, rates * outward), record=True)
        good = len(rows.tension_N)
        if good < len(rates) or rows.states is None:
            failed = self._time + (good + 1) * self._plan.step_s
            raise SolveError(describe_failure(self._chain, rows, failed, self._plan.step_s))
        self._command = commands[-1].copy()
        self._tension, self._position = rows.tension_N[-1], rows.ends_m[-1]
        self._time += good * self._plan.step_s
        return RigRows(
            tension_N=rows.tension_N,
            position_m=rows.ends_m,
            force_N=self._motor_force(commands, rows.ends_m),
            velocity_m_per_s=rows.states[:, : self._chain.count + 2].copy(),  # the rest of the states can go
        )

    def _bumpless(self, mode: MotorMode, k: int) -> float:
        """Command at which motor k + 1 in `mode` carries the present end tension: f_c = f, or x_c = x +- f/k_c."""
        tension = self.end_tensions_N[k]
        if mode.by_force:
            return tension
        return float(self._position[k]) + _OUTWARD[k] * tension / self._plan.ends[mode].stiffness_N_per_m

    def _new_simulator(self, state: ChainState) -> Simulator:
        near, far = (self._plan.ends[mode] for mode in self._modes)
        chain = replace(self._chain, near=near, far=far)
        return Simulator(chain, self._plan.step_s, state, self._inputs(self._command[None, :], np.zeros((1, 2))))

    def _inputs(self, commands: FloatArray, speeds: FloatArray) -> ChainInputs:
        """Commands of the two motors: a force, or a rest position, to whose speed the damper refers."""
        values = {}
        for k, (side, pull) in enumerate((("near", -1), ("far", 1))):
            mode = self._modes[k]
            if mode.by_force:
                values[f"{side}_force_N"] = commands[:, k]
            else:
                values[f"{side}_rest_m"] = commands[:, k]
                values[f"{side}_force_N"] = rest_damper_force(speeds[:, k], pull, self._plan.ends[mode])
        return ChainInputs.of(len(commands), **values)

    def _motor_force(self, commands: FloatArray, positions: FloatArray) -> FloatArray:
        """Pull of each motor on its end [N], shape (n, 2)."""
        force = commands.copy()
        for k, mode in enumerate(self._modes):
            if not mode.by_force:
                spring = self._plan.ends[mode].stiffness_N_per_m
                force[:, k] = spring * _OUTWARD[k] * (commands[:, k] - positions[:, k])
        return force
