"""Content of the interactive page: a scenario whose numbers are turned, its designs, and what comes of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.every import AnyScenario, answering, compensator_of, problem_of
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.plant import delivered_of
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import score
from tendonff.compensator.compensators.tuning import tuned_chain, tuning_of
from tendonff.compensator.reporting.colours import PURPLE, Style
from tendonff.compensator.scenario.goal import Given, Goal
from tendonff.compensator.scenario.knobs import pose_knobs, shifted
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.scenarios import parse_any
from tendonff.compensator.studies.explore.result import MOST_POINTS, Course, Curve, Exploration, Panel
from tendonff.models.errors import TendonffError
from tendonff.models.parameters.numbers import number_of, with_numbers
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor

SELF_TUNING = Curve(name="self_tuning", label="self-tuning inverse", style=Style(color=PURPLE, linestyle="-"))
"""Curve of the inverse that tunes itself to a measurement."""


class Explorer:
    """A scenario to be explored.

    Attributes
    ----------
    name, file : str
        Of the scenario.
    knobs : tuple of Knob
    panels : mapping of str to Panel
        The first has the legend, "output" the reference.
    fast, slow : tuple of Curve
        Those that follow a slider, and those that come when they are asked for.
    """

    def __init__(self, scenario: AnyScenario) -> None:
        self._scenario: Any = scenario
        self._problem = problem_of(scenario).nominal
        self._poses = pose_knobs(scenario.joints)
        self.name, self.file = scenario.name, scenario.source.name
        self.knobs = (*scenario.knobs, *self._poses.values())
        self.panels = _panels(scenario.goal, self._problem.given_as)
        found = answering(self._problem)
        self.fast, slow = (
            tuple(Curve(name=c.name, label=c.label, style=c.style) for c in found if c.is_fast is fast)
            for fast in (True, False)
        )
        self.slow = (*slow, *((SELF_TUNING,) if self._problem.tunes_itself else ()))

    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate with the knobs at these values.

        The design is made for them; else for the scenario's own numbers but those that are set. One that has no answer
        does not take the others along: the notes say why. TendonffError where none has one.
        """
        design, rig = self._posed(values, design_knows=design_knows)
        unit, rows = rig.unit, slice(None, None, max(1, len(rig.wanted) // MOST_POINTS))
        courses: dict[str, Course] = {}
        notes: list[str] = []
        failed: list[TendonffError] = []
        for curve in curves:
            try:
                given, output = self._course(curve, design, rig, notes)
            except TendonffError as error:
                failed.append(error)
                notes.append(f"{curve.label}: {error}")
                continue
            error_shown = unit.factor * (output - rig.wanted)[rows]
            courses[curve.name] = Course(
                time_s=rig.time_s[rows],
                given=error_shown if given is None else given[rows],
                output=unit.factor * output[rows],
                error=error_shown,
                score=score(rig.wanted, output),
            )
        if failed and not courses:
            raise failed[0]
        wanted = unit.factor * rig.wanted[rows]
        return Exploration(time_s=rig.time_s[rows], wanted=wanted, courses=courses, notes=tuple(notes))

    def worst_case(self, values: Mapping[str, float], *, design_knows: bool) -> str:
        """Expected error of the fast curves over the scenario's uncertainty."""
        design, rig = self._posed(values, design_knows=design_knows)
        known = {curve.name: compensator_of(design, curve.name) for curve in self.fast}
        found = rig.expect({name: design.answer(each) for name, each in known.items()})
        then = next_step(found, self.file, f"tendonff design {self.file} --out out")
        said: str = found.headline(known[found.recommended].label, then)
        return said

    def toml(self, values: Mapping[str, float]) -> str:
        """Scenario file with these values; empty where a file cannot say them."""
        changed = self.changed(values)
        text: str = changed.saved()
        return text if parse_any(text, changed.source).system == changed.system else ""

    def changed(self, values: Mapping[str, float]) -> Any:
        """The scenario with knobs at these values; itself where they are its own."""
        scenario = self._scenario
        numbers = {knob.key: knob.scale * values[knob.key] for knob in scenario.knobs if knob.key in values}
        system = scenario.system
        numbers = {k: v for k, v in numbers.items() if not math.isclose(v, number_of(system, k) or 0.0)}
        if numbers:
            scenario = scenario.with_system(with_numbers(system, numbers), numbers)
        if turned := {name: by for name, k in self._poses.items() if (by := k.scale * values.get(k.key, 0.0))}:
            joints = {name: shifted(joint, turned.get(name, 0.0)) for name, joint in scenario.joints.items()}
            scenario = replace(scenario, joints=joints)
        return scenario

    def _posed(self, values: Mapping[str, float], *, design_knows: bool) -> tuple[Any, Any]:
        """The problem of the nominal design, and the same on the plant that it is tried on."""
        changed = self.changed(values)
        is_set = {knob.key for knob in self.knobs if knob.is_set}
        known = changed if design_knows else self.changed({k: v for k, v in values.items() if k in is_set})
        design = self._problem if known is self._scenario else problem_of(known).nominal
        design.check_reach()
        return design, design.on_rig(changed)

    def _course(self, curve: Curve, design: Any, rig: Any, notes: list[str]) -> tuple[FloatArray | None, FloatArray]:
        """Given to the drive, and output; warnings go to `notes`."""
        if curve is SELF_TUNING:
            return _tuned(design, rig, self._scenario.adaptation or Adaptation(sensor=Sensor.ACTUATOR_POSITION))
        profile = design.answer(compensator_of(design, curve.name))
        output, slack = rig.output_on(rig.level.value, profile)
        notes += [f"{curve.label}: {said}" for said in (design.fault(profile), slack) if said]
        return design.given_of(profile), output


def _tuned(problem: Problem, rig: Problem, settings: Adaptation) -> tuple[FloatArray, FloatArray]:
    """Force of the inverse that tunes itself, without noise, and what is delivered."""
    reference, tuning = problem.reference, tuning_of(problem, settings)
    step, start = reference.step_s, reference.initial_tension_N
    tuner = SelfTuner(tuned_chain(problem, tuning), step, tuning, problem.limits, start)
    simulated = SimulatedRig(Chain.of(rig.transmission, problem.level), step, 1, start)
    run = tuner.run(simulated, reference.tension_N[1:], np.zeros(len(reference.tension_N) - 1))
    tension = np.concatenate([[start], run.tension_N])
    return np.concatenate([[start], run.force_N]), delivered_of(rig.transmission.load, tension, reference)


def _panels(goal: Goal, given: Given | None) -> dict[str, Panel]:
    """Panels of what is given, if one can show it, and of what is reached."""
    time = {"x": "time", "x_label": goal.time_label}
    reached = {
        "output": Panel(title=f"{goal.title} (black: reference)", y="output", y_label=goal.label, **time),
        "error": Panel(title="Error", y="error", y_label=f"error [{goal.unit.shown}]", **time),
    }
    if given is None:
        return reached
    x, y = ("output", "given") if given.is_ordinate else ("given", "output")
    label = {"output": goal.label, "given": given.label}
    return {
        "loop": Panel(title=given.loop, x=x, y=y, x_label=label[x], y_label=label[y]),
        "given": Panel(title=given.title, y="given", y_label=given.label, **time),
        **reached,
    }
