"""Run the two-motor test: the machine on one model, its schedule on the others.

The machine runs on the scenario's own fidelity level. What it did (modes, rates of the commands, times) is played on
the other levels and on a finer chain, so that all of them receive the same commands. Where a motor changes its mode,
every model starts the new command from its own end tension and position, as a real rig does from its sensors.
"""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.experiment_machine import Machine, Plan, Schedule, StatePass
from tendonff.compensator.experiment_rig import Rig, RigRows
from tendonff.compensator.files import FloatArray
from tendonff.models.fidelity import Level

SECTIONS = 7
"""Places along the path at which tensions are reported: 0, theta/6 ... theta."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentRun:
    """The test on one model, rows at 0, h, 2 h ...

    Parameters
    ----------
    level : Level
    passes : tuple of StatePass
        States and their rows; a state starts with the row in which the one before it ended.
    time_s : ndarray, shape (n,)
    link_tension_N : ndarray, shape (n, N + 1)
        f_1 .. f_{N+1} of the chain.
    position_m, force_N : ndarray, shape (n, 2)
        Of motors 1 and 2; forces are each motor's pull on its end of the tendon.
    velocity_m_per_s : ndarray, shape (n, N + 2)
        v_a, v_1 .. v_N, v_l.
    """

    level: Level
    passes: tuple[StatePass, ...]
    time_s: FloatArray
    link_tension_N: FloatArray
    position_m: FloatArray
    force_N: FloatArray
    velocity_m_per_s: FloatArray

    @property
    def tension_N(self) -> FloatArray:
        """Tensions at the seven sections of the path, shape (n, 7) [N].

        Link i of a chain of N masses stands at the angle i theta/N; between links ln T is linear in the angle, as in slip.
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
        return length - length[0]

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
    """

    plan: Plan
    lead: Level
    runs: dict[Level, ExperimentRun]
    fine: ExperimentRun


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
    pieces, passes, rates = [rig.now()], [], []
    for state in plan.states:
        rig.switch(state.modes)
        machine = Machine(state, plan)
        first = len(rates)
        while (now := machine.next_rates(rig.end_tensions_N)) is not None:
            rates.append(now)
            pieces.append(rig.advance(np.array([now])))
        stop = first + (machine.stopped_at or 0)
        passes.append(StatePass(state=state, first_row=first, last_row=len(rates), stop_row=stop, met=machine.met))
    schedule = Schedule(passes=tuple(passes), rates=np.array(rates))
    return schedule, _run(level, schedule, pieces, plan.rig.step_s)


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
    pieces = [rig.now()]
    for done in schedule.passes:
        rig.switch(done.state.modes)
        pieces.append(rig.advance(schedule.rates[done.first_row : done.last_row]))
    return _run(level, schedule, pieces, plan.rig.step_s)


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
    return ExperimentResult(plan=plan, lead=lead, runs=runs, fine=play_schedule(plan, schedule, lead, fine_segments))


def _run(level: Level, schedule: Schedule, pieces: list[RigRows], step_s: float) -> ExperimentRun:
    tension = np.concatenate([piece.tension_N for piece in pieces])
    return ExperimentRun(
        level=level,
        passes=schedule.passes,
        time_s=np.arange(len(tension)) * step_s,
        link_tension_N=tension,
        position_m=np.concatenate([piece.position_m for piece in pieces]),
        force_N=np.concatenate([piece.force_N for piece in pieces]),
        velocity_m_per_s=np.concatenate([piece.velocity_m_per_s for piece in pieces]),
    )
