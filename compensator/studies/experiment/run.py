"""Run the two-motor test: the machine on one model, its schedule on the others.

The machine runs on the scenario's own fidelity level. Its record (modes, times, ramps) is repeated on the other levels
and on a finer chain, so that all of them receive the same commands. Where a motor changes its mode, every model starts
the new command from its own end tension and position, as a real rig does from its sensors; its next force ramp takes
the same time and ends at the same force as the machine's.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.experiment.machine import Machine, Schedule, StatePass, plan_experiment
from tendonff.compensator.studies.experiment.numbers import read_measured
from tendonff.compensator.studies.experiment.result import ExperimentResult, ExperimentRun
from tendonff.compensator.studies.experiment.rig import Plan, Rig, RigRows
from tendonff.compensator.works import function_of
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn

Ends = tuple[float | None, float | None]

_SCALE_BOUNDS = (0.5, 2.0)
_QUASI_STATIC_FACTOR = 1000.0


def run_machine(plan: Plan, level: Level) -> tuple[Schedule, ExperimentRun]:
    """Run the state machine on one model; its record, to be repeated on other models, and the run."""
    rig = Rig(plan, level, plan.states[0].modes)
    pieces = [rig.now()]
    passes: list[StatePass] = []
    rates: list[tuple[float, float]] = []
    for state in plan.states:
        rig.switch(state.modes)
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
    return schedule, _run(level, plan, schedule, pieces)


def follow_schedule(plan: Plan, schedule: Schedule, level: Level, segments: int | None = None) -> ExperimentRun:
    """Give a model, of the path's own number of masses or another, the commands of a schedule."""
    rig = Rig(plan, level, plan.states[0].modes, segments)
    pieces = [rig.now()]
    for done in schedule.passes:
        rig.switch(done.state.modes)
        rates = schedule.rates[done.first_row : done.last_row]
        pieces.append(rig.advance(rates * _scales(rates, rig.forces_N, done.end_forces_N, plan.step_s)))
    return _run(level, plan, schedule, pieces)


def _scales(rates: FloatArray, starts_N: Ends, ends_N: Ends, step_s: float) -> FloatArray:
    """Factors on the rates, shape (2,), with which force ramps that start elsewhere end where the machine's ended."""
    scales = np.ones(2)
    for k, (start, end) in enumerate(zip(starts_N, ends_N, strict=True)):
        change = float(rates[:, k].sum()) * step_s
        if start is not None and end is not None and change != 0:
            scales[k] = np.clip((end - start) / change, *_SCALE_BOUNDS)
    return scales


@in_turn
def experiment(
    scenario: Scenario, measured: str | os.PathLike[str] | None = None, *, progress: Progress = silent
) -> ExperimentResult:
    """Run the two-motor test of a scenario on the three levels, and on its own with more masses.

    Parameters
    ----------
    scenario : Scenario
        Its [experiment] table may be missing.
    measured : str or path, optional
        Tensions of the same test on a rig: columns `time_s` and any of `tension_1_N` .. `tension_7_N`.

    Raises
    ------
    InputError
        The table asks for tensions or rates beyond the actuator's.
    SolveError
        A step could not be solved.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> result = tf.experiment(scenario)  # doctest: +SKIP
    >>> result.write("experiment")  # doctest: +SKIP
    """
    function_of("experiment", scenario)  # which refuses the others
    laid_over = None if measured is None else read_measured(Path(measured))
    plan, lead = plan_experiment(scenario), scenario.run.level
    parts = Parts(progress, len(Level) + 2)
    schedule, leading = run_machine(plan, lead)
    parts.done()
    runs = {}
    for level in Level:
        runs[level] = leading if level is lead else follow_schedule(plan, schedule, level)
        parts.done(level is not lead)
    friction = plan.transmission.friction
    ideal = replace(
        friction,
        mu_static=friction.mu_dynamic,
        mu_static_release=friction.release_dynamic,
        mu_dynamic_release=friction.release_dynamic,
        viscous_N_s_per_m=0.0,
        bristle_stiffness_N_per_m=_QUASI_STATIC_FACTOR * friction.bristle_stiffness_N_per_m,
    )
    quasi_static = replace(plan, transmission=replace(plan.transmission, friction=ideal))
    fine = follow_schedule(plan, schedule, lead, scenario.experiment.fine_segments)
    parts.done()
    return ExperimentResult(
        scenario=scenario,
        plan=plan,
        lead=lead,
        runs=runs,
        fine=fine,
        quasi_static=follow_schedule(quasi_static, schedule, Level.ELASTIC),
        quasi_static_factor=_QUASI_STATIC_FACTOR,
        measured=laid_over,
    )


def _run(level: Level, plan: Plan, schedule: Schedule, pieces: list[RigRows]) -> ExperimentRun:
    tension = np.concatenate([piece.tension_N for piece in pieces])
    time: FloatArray = np.arange(len(tension), dtype=np.float64) * plan.step_s
    return ExperimentRun(
        level=level,
        transmission=plan.transmission,
        passes=schedule.passes,
        time_s=time,
        link_tension_N=tension,
        position_m=np.concatenate([piece.position_m for piece in pieces]),
        force_N=np.concatenate([piece.force_N for piece in pieces]),
        velocity_m_per_s=np.concatenate([piece.velocity_m_per_s for piece in pieces]),
    )
