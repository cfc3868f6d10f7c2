"""Run the two-motor test: the machine on one model, its schedule on the others.

The machine runs on the scenario's own fidelity level. What it did (modes, times, ramps) is played on the other levels
and on a finer chain, so that all of them receive the same commands. Where a motor changes its mode, every model starts
the new command from its own end tension and position, as a real rig does from its sensors; its next force ramp takes
the same time and ends at the same force as the machine's.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.experiment.machine import Machine, Plan, Schedule, StatePass
from tendonff.compensator.experiment.rig import Rig, RigRows
from tendonff.compensator.files.reading import FloatArray
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission

Ends = tuple[float | None, float | None]

_SCALE_BOUNDS = (0.5, 2.0)
_QUASI_STATIC_FACTOR = 100.0

SECTIONS = 7
"""Places along the path at which tensions are reported: 0, theta/6 ... theta."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentRun:
    """The test on one model, rows at 0, h, 2 h ...

    Parameters
    ----------
    level : Level
    transmission : Transmission
        What it ran on.
    passes : tuple of StatePass
        States and their rows; a state starts with the row in which the one before it ended.
    time_s : ndarray, shape (n,)
    link_tension_N : ndarray, shape (n, N + 1)
        f_1 .. f_{N+1} of the chain.
    position_m, force_N : ndarray, shape (n, 2)
        Of motors 1 and 2; forces are each motor's pull on its end of the tendon.
    velocity_m_per_s : ndarray, shape (n, N + 2)
        v_a, v_1 .. v_N, v_l.
    force_jump_N : ndarray, shape (number of states, 2)
        Jump of each motor's pull as a state begins.
    """

    level: Level
    transmission: Transmission
    passes: tuple[StatePass, ...]
    time_s: FloatArray
    link_tension_N: FloatArray
    position_m: FloatArray
    force_N: FloatArray
    velocity_m_per_s: FloatArray
    force_jump_N: FloatArray

    @property
    def tension_N(self) -> FloatArray:
        """Tensions at the seven sections of the path, shape (n, 7) [N].

        Link i of N masses stands at the angle i theta/N; between links ln T is taken as linear, which it is in slip.
        """
        links = self.link_tension_N.shape[1]
        if links == SECTIONS:
            return self.link_tension_N
        places = np.linspace(0, links - 1, SECTIONS)
        left = np.minimum(places.astype(int), max(links - 2, 0))
        share = places - left
        log = np.log(np.maximum(self.link_tension_N, 1e-12))
        sections: FloatArray = np.exp((1 - share) * log[:, left] + share * log[:, left + 1])
        return sections

    @property
    def elongation_m(self) -> FloatArray:
        """Elongation of the tendon since the start, q_a - q_l, shape (n,) [m]."""
        length = self.position_m[:, 0] - self.position_m[:, 1]
        change: FloatArray = length - length[0]
        return change

    @property
    def range_N(self) -> float:
        """Largest minus smallest tension of the run [N]: what percentages refer to."""
        return float(np.ptp(self.link_tension_N))

    def state_names(self) -> list[str]:
        """Name of the state in each row; a row in which one state ends and the next begins counts to the first."""
        names = [self.passes[0].state.name]
        for done in self.passes:
            names += [done.state.name] * (done.last_row - done.first_row)
        return names


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentResult:
    """The test on all models.

    Parameters
    ----------
    plan : Plan
    lead : Level
        Level on which the machine ran.
    runs : dict of Level to ExperimentRun
        All three levels, on the path's own number of masses.
    fine : ExperimentRun
        The leading level with more masses.
    quasi_static : ExperimentRun
        The elastic level with a stiffer bristle, no viscous friction and no Stribeck effect: nearest to the static law.
    quasi_static_factor : float
        By how much its bristle is stiffer.
    """

    plan: Plan
    lead: Level
    runs: dict[Level, ExperimentRun]
    fine: ExperimentRun
    quasi_static: ExperimentRun
    quasi_static_factor: float


def run_machine(plan: Plan, level: Level) -> tuple[Schedule, ExperimentRun]:
    """Run the state machine on one model.

    Parameters
    ----------
    plan : Plan
    level : Level

    Returns
    -------
    schedule : Schedule
        To be played on other models.
    run : ExperimentRun
    """
    rig = Rig(plan.rig, level, plan.states[0].modes)
    pieces, jumps = [rig.now()], []
    passes: list[StatePass] = []
    rates: list[tuple[float, float]] = []
    for state in plan.states:
        jumps.append(rig.switch(state.modes))
        machine = Machine(state, plan)
        first = len(rates)
        while (now := machine.next_rates(rig.end_tensions_N)) is not None:
            rates.append(now)
            pieces.append(rig.advance(np.array([now])))
        stop = first + (machine.stopped_at or 0)
        passes.append(
            StatePass(
                state=state,
                first_row=first,
                last_row=len(rates),
                stop_row=stop,
                met=machine.met,
                end_forces_N=rig.forces_N,
            )
        )
    schedule = Schedule(passes=tuple(passes), rates=np.array(rates))
    return schedule, _run(level, plan, schedule, pieces, jumps)


def play_schedule(plan: Plan, schedule: Schedule, level: Level, segments: int | None = None) -> ExperimentRun:
    """Give a model the commands of a schedule.

    Parameters
    ----------
    plan : Plan
    schedule : Schedule
    level : Level
    segments : int, optional
        Number of masses on the path; default: the path's own.
    """
    rig = Rig(plan.rig, level, plan.states[0].modes, segments)
    pieces, jumps = [rig.now()], []
    for done in schedule.passes:
        jumps.append(rig.switch(done.state.modes))
        rates = schedule.rates[done.first_row : done.last_row]
        pieces.append(rig.advance(rates * _scales(rates, rig.forces_N, done.end_forces_N, plan.rig.step_s)))
    return _run(level, plan, schedule, pieces, jumps)


def _scales(rates: FloatArray, starts_N: Ends, ends_N: Ends, step_s: float) -> FloatArray:
    """Factors on the rates, shape (2,), with which force ramps that start elsewhere end where the machine's ended."""
    scales = np.ones(2)
    for k, (start, end) in enumerate(zip(starts_N, ends_N, strict=True)):
        change = float(rates[:, k].sum()) * step_s
        if start is not None and end is not None and change != 0:
            scales[k] = np.clip((end - start) / change, *_SCALE_BOUNDS)
    return scales


def run_experiment(plan: Plan, lead: Level, fine_segments: int) -> ExperimentResult:
    """Run the test on the three levels, and on the leading one with more masses.

    Parameters
    ----------
    plan : Plan
    lead : Level
        Level on which the state machine decides.
    fine_segments : int
        Number of masses of the finer run.
    """
    schedule, leading = run_machine(plan, lead)
    runs = {level: leading if level is lead else play_schedule(plan, schedule, level) for level in Level}
    friction = plan.rig.transmission.friction
    ideal = replace(
        friction,
        mu_static=friction.mu_dynamic,
        mu_static_release=friction.release_dynamic,
        mu_dynamic_release=friction.release_dynamic,
        viscous_N_s_per_m=0.0,
        bristle_stiffness_N_per_m=_QUASI_STATIC_FACTOR * friction.bristle_stiffness_N_per_m,
    )
    rig = replace(plan.rig, transmission=replace(plan.rig.transmission, friction=ideal))
    return ExperimentResult(
        plan=plan,
        lead=lead,
        runs=runs,
        fine=play_schedule(plan, schedule, lead, fine_segments),
        quasi_static=play_schedule(replace(plan, rig=rig), schedule, Level.ELASTIC),
        quasi_static_factor=_QUASI_STATIC_FACTOR,
    )


def _run(level: Level, plan: Plan, schedule: Schedule, pieces: list[RigRows], jumps: list[FloatArray]) -> ExperimentRun:
    tension = np.concatenate([piece.tension_N for piece in pieces])
    time: FloatArray = np.arange(len(tension), dtype=np.float64) * plan.rig.step_s
    return ExperimentRun(
        level=level,
        transmission=plan.rig.transmission,
        passes=schedule.passes,
        time_s=time,
        link_tension_N=tension,
        position_m=np.concatenate([piece.position_m for piece in pieces]),
        force_N=np.concatenate([piece.force_N for piece in pieces]),
        velocity_m_per_s=np.concatenate([piece.velocity_m_per_s for piece in pieces]),
        force_jump_N=np.array(jumps),
    )
