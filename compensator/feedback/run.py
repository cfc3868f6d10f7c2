"""Design of a feedback beside the feedforward, judged on finer mechanisms."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.compensator.feedback.result import CaseErrors, FeedbackResult, LimitCycle
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.files.reading import InputError
from tendonff.models.errors import ParameterError
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.turns import in_turn
from tendonff.ocp.feedback.closed_loop import Course, simulate_feedback
from tendonff.ocp.feedback.design import STANDING_S, LoopDesign, Sensor, design_loops, standing
from tendonff.ocp.feedback.law import FeedbackLaw
from tendonff.ocp.feedback.requirement import Requirement
from tendonff.ocp.feedback.system import FeedbackSystem

FRICTION, DELAY = (0.5, 1.0, 1.5), (0.5, 1.0, 2.0)
"""Factors on friction and delay at which limit cycles are looked for."""
_DESIGNED, _SHOWN = 9, 24  # most mechanisms that gains are designed for, and that they are judged on
_LESS, _MOST_REDUCTIONS = 0.75, 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned:
    """Laws of a task that come to rest in simulation.

    Attributes
    ----------
    design : LoopDesign
    alone : CaseErrors
        Of the feedforward.
    cycles : tuple of LimitCycle
    reductions : int
        How often the gains were lowered for that.
    """

    design: LoopDesign
    alone: CaseErrors
    cycles: tuple[LimitCycle, ...]
    reductions: int


@in_turn
def tune_feedback(task: FeedbackTask) -> Tuned:
    """Laws of a task: as high as margins allow, and lower where loops hunt in simulation.

    Raises
    ------
    InputError
        If no gain keeps the margins, or the table does not fit the scenario.
    SolveError
        If a mechanism cannot be simulated.
    """
    settings = task.settings
    sensor = Sensor(sample_s=task.sample_s, delay_s=settings.delay_s, resolution=settings.resolution, limit=task.limit)
    requirement = Requirement(gain_margin=settings.gain_margin, phase_margin_deg=settings.phase_margin_deg)
    samples = [sample.system for sample in task.doubt.samples]
    coarse = [task.system(each) for each in samples[:_DESIGNED]]
    try:
        design = design_loops(
            coarse,
            task.feedforward,
            sensor,
            requirement,
            followed=[task.followed(each) for each in samples[:_DESIGNED]],
            scored=task.scored,
        )
    except ParameterError as error:
        raise InputError(f"{task.file} [feedback]: {error}") from None
    alone = _errors(task, [task.system(each, task.masses) for each in samples[:_SHOWN]], (), task.feedforward)
    reductions = 0
    cycles = _limit_cycles(task, design, alone)
    while any(cycle.hunts for cycle in cycles) and reductions < _MOST_REDUCTIONS:
        design = design.with_laws([law.scaled(_LESS) for law in design.laws])
        cycles = _limit_cycles(task, design, alone)
        reductions += 1
    return Tuned(design=design, alone=alone, cycles=cycles, reductions=reductions)


@in_turn
def design_feedback(task: FeedbackTask) -> FeedbackResult:
    """Design the feedback of a task and judge it; errors as of `tune_feedback`."""
    tuned = tune_feedback(task)
    design = tuned.design
    fine = [task.system(sample.system, task.masses) for sample in task.doubt.samples[:_SHOWN]]
    return FeedbackResult(
        names=task.names,
        unit=task.unit,
        seen_unit=task.seen_unit,
        command_unit=task.command_unit,
        design=design,
        cases={
            "feedforward": tuned.alone,
            "feedback": _errors(task, fine, [law.plain() for law in design.laws], task.alone),
            "both": _errors(task, fine, design.laws, task.feedforward),
        },
        cycles=tuned.cycles,
        time_s=_times(task),
        reductions=tuned.reductions,
        doubt=str(task.doubt),
    )


def _times(task: FeedbackTask) -> Any:
    rows = np.arange(len(task.feedforward.reference))[task.scored]
    return (rows - rows[0]) * task.feedforward.step_s


def _errors(
    task: FeedbackTask, systems: Sequence[FeedbackSystem], laws: Sequence[FeedbackLaw], course: Course
) -> CaseErrors:
    """Errors over all mechanisms."""
    reference = course.reference
    found = []
    for system in systems:
        run = simulate_feedback(system, laws, course, resolution=task.settings.resolution)
        error = np.full_like(reference, math.inf)
        error[: len(run.output)] = run.output - reference[: len(run.output)]
        found.append(error[task.scored])
    rms = np.array([np.sqrt(np.mean(error**2, axis=0)) for error in found])
    peak = np.array([np.abs(error).max(axis=0) for error in found])
    return CaseErrors(rms=rms, peak=peak, worst=found[int(np.argmax(rms.max(axis=1)))])


def _limit_cycles(task: FeedbackTask, design: LoopDesign, alone: CaseErrors) -> tuple[LimitCycle, ...]:
    """Limit cycles under a constant reference, with friction and delay that differ from the stated ones."""
    held = task.feedforward.held(STANDING_S)
    rows = len(held.reference) - len(task.feedforward.reference)
    found = []
    for friction in FRICTION:
        system = task.system(with_numbers(task.doubt.system, {"mu": friction}), task.masses)
        feedforward = simulate_feedback(system, (), task.feedforward)
        own = feedforward.output - task.feedforward.reference[: len(feedforward.output)]
        rms = max(float(np.sqrt(np.mean(own**2))), alone.worst_rms)
        for delay in DELAY:
            delay_s = delay * task.settings.delay_s
            run = simulate_feedback(system, design.laws, held, delay_s=delay_s, resolution=task.settings.resolution)
            seen = standing(run, held, rows, task.settings.resolution, rms)
            found.append(LimitCycle(friction=friction, delay=delay, swing=seen.swing, hunts=seen.hunts))
            if task.settings.delay_s == 0:
                break
    return tuple(found)
