"""The rig of the two-motor test: two equal linear motors on a tendon, each of which acts, loads or holds.

::

    motor 1 (near end)             path of six equal arcs              motor 2 (far end)
    [ m_a ]~~f_1~~( )~~f_2~~( )~~f_3~~( )~~f_4~~( )~~f_5~~( )~~f_6~~( )~~f_7~~[ m_a ]
    <------ positions positive

    A    f_c commanded, k_c = 0
    L    f_c = 0, k_c = k, rest position x_c commanded
    A_h  the same with a stiff spring: the motor acts by keeping its position

A change of mode is bumpless: the new command is the one that carries the present end tension at the present position.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.experiment import MotorMode
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.parameters import Transmission
from tendonff.ocp.errors import SolveError
from tendonff.ocp.simulate import Simulator, describe_failure

Modes = tuple[MotorMode, MotorMode]

_OUTWARD = (1.0, -1.0)  # direction in which a motor's position moves away from the tendon


@dataclass(frozen=True, slots=True, kw_only=True)
class RigSpec:
    """What the rig is made of.

    Parameters
    ----------
    transmission : Transmission
        Path, tendon and friction; both motors have the mass and damping of its actuator.
    step_s : float
        Time step [s].
    start_tension_N : float
        Uniform tension at rest before the test [N].
    load_stiffness_N_per_m, hold_stiffness_N_per_m : float
        Springs of the modes L and A_h [N/m].
    """

    transmission: Transmission
    step_s: float
    start_tension_N: float
    load_stiffness_N_per_m: float
    hold_stiffness_N_per_m: float

    def stiffness(self, mode: MotorMode) -> float:
        """k_c of a mode [N/m]."""
        match mode:
            case MotorMode.ACT:
                return 0.0
            case MotorMode.LOAD:
                return self.load_stiffness_N_per_m
            case MotorMode.HOLD:
                return self.hold_stiffness_N_per_m


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRows:
    """What the rig did over some steps.

    Parameters
    ----------
    tension_N : ndarray, shape (n, N + 1)
    position_m : ndarray, shape (n, 2)
        Of motors 1 and 2, positive towards motor 1's side.
    force_N : ndarray, shape (n, 2)
        Each motor's pull on its end of the tendon: f_c, or its spring's force.
    velocity_m_per_s : ndarray, shape (n, N + 2)
        v_a, v_1 .. v_N, v_l.
    """

    tension_N: FloatArray
    position_m: FloatArray
    force_N: FloatArray
    velocity_m_per_s: FloatArray


class Rig:
    """The rig at one fidelity level, at rest under uniform tension when it is made.

    Parameters
    ----------
    spec : RigSpec
    level : Level
    modes : tuple of 2 MotorMode
        What the motors do at first.
    segments : int, optional
        Number of masses on the path; default: the path's own.
    """

    def __init__(self, spec: RigSpec, level: Level, modes: Modes, segments: int | None = None) -> None:
        self._spec = spec
        if spec.transmission.actuator.coulomb_N:
            raise InputError("coulomb_N must be 0 in the two-motor test, which knows motors without dry friction")
        chain = Chain.of(spec.transmission, level, segments)
        self._chain = replace(chain, far=chain.near)  # two equal motors
        state = self._chain.rest_state(spec.start_tension_N)
        self._tension = np.full(self._chain.count + 1, spec.start_tension_N)
        self._position = np.array([state.near_position_m, state.far_position_m])
        self._time = 0.0
        self._modes: Modes = modes
        self._command = np.array([self._bumpless(modes[k], k) for k in (0, 1)])
        self._simulator = self._new_simulator(modes, state)

    @property
    def end_tensions_N(self) -> tuple[float, float]:
        """f_1 and f_{N+1} now [N]."""
        return float(self._tension[0]), float(self._tension[-1])

    @property
    def forces_N(self) -> tuple[float | None, float | None]:
        """Force commands of the motors that act [N]."""
        near, far = (
            float(command) if mode is MotorMode.ACT else None
            for mode, command in zip(self._modes, self._command, strict=True)
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

    def switch(self, modes: Modes) -> FloatArray:
        """Change what the motors do, without a jump; a motor that keeps its mode keeps its command.

        Parameters
        ----------
        modes : tuple of 2 MotorMode

        Returns
        -------
        ndarray, shape (2,)
            Jump of each motor's pull [N].
        """
        before = self._motor_force(self._command[None, :], self._position[None, :])
        if modes != self._modes:
            for k in (0, 1):
                if modes[k] is not self._modes[k]:
                    self._command[k] = self._bumpless(modes[k], k)
            self._simulator = self._new_simulator(modes, self._simulator.state)
            self._modes = modes
        jump: FloatArray = (self._motor_force(self._command[None, :], self._position[None, :]) - before)[0]
        return jump

    def advance(self, rates: FloatArray) -> RigRows:
        """Move the commands at given rates.

        Parameters
        ----------
        rates : ndarray, shape (n, 2)
            Of the motors' commands during each step: N/s where a motor acts, else m/s; positive tightens the tendon.

        Returns
        -------
        RigRows
            At the ends of the steps.

        Raises
        ------
        SolveError
            When a step cannot be solved.
        """
        outward = [1.0 if mode is MotorMode.ACT else _OUTWARD[k] for k, mode in enumerate(self._modes)]
        commands = self._command + np.cumsum(rates * outward, axis=0) * self._spec.step_s
        rows = self._simulator.advance(self._inputs(commands, self._modes), record=True)
        good = len(rows.tension_N)
        if good < len(rates) or rows.states is None:
            failed = self._time + (good + 1) * self._spec.step_s
            raise SolveError(describe_failure(self._chain, rows, failed, self._spec.step_s))
        self._command = commands[-1].copy()
        self._tension, self._position = rows.tension_N[-1], rows.ends_m[-1]
        self._time += good * self._spec.step_s
        return RigRows(
            tension_N=rows.tension_N,
            position_m=rows.ends_m,
            force_N=self._motor_force(commands, rows.ends_m),
            velocity_m_per_s=rows.states[:, : self._chain.count + 2].copy(),  # the rest of the states can go
        )

    def _bumpless(self, mode: MotorMode, k: int) -> float:
        """Command at which motor k + 1 in `mode` carries the present end tension: f_c = f, or x_c = x +- f/k_c."""
        tension = self.end_tensions_N[k]
        if mode is MotorMode.ACT:
            return tension
        return float(self._position[k]) + _OUTWARD[k] * tension / self._spec.stiffness(mode)

    def _new_simulator(self, modes: Modes, state: ChainState) -> Simulator:
        """A simulator for the modes, from a state."""
        near, far = (self._spec.stiffness(mode) for mode in modes)
        chain = self._chain.with_end_stiffness(near, far)
        return Simulator(chain, self._spec.step_s, state, self._inputs(self._command[None, :], modes))

    @staticmethod
    def _inputs(commands: FloatArray, modes: Modes) -> ChainInputs:
        """What the two motors do: a force, or a rest position."""
        names = ("force_N" if mode is MotorMode.ACT else "rest_m" for mode in modes)
        values = {
            f"{end}_{name}": commands[:, k] for k, (end, name) in enumerate(zip(("near", "far"), names, strict=True))
        }
        return ChainInputs.of(len(commands), **values)

    def _motor_force(self, commands: FloatArray, positions: FloatArray) -> FloatArray:
        """Pull of each motor on its end [N], shape (n, 2)."""
        force = commands.copy()
        for k, mode in enumerate(self._modes):
            if mode is not MotorMode.ACT:
                force[:, k] = self._spec.stiffness(mode) * _OUTWARD[k] * (commands[:, k] - positions[:, k])
        return force
