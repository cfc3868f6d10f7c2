"""Driven joints on the interactive page; the angles of several, one after the other."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.every import answering, compensator_of, problem_of
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import score
from tendonff.compensator.identification.motors.fitted import set_keys, to_toml
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenarios import parse_any
from tendonff.compensator.studies.explore.subject import MOST_POINTS, Course, Curve, Exploration, Knob, Panel, Subject
from tendonff.models.errors import TendonffError
from tendonff.models.joint.parameters import DriveKind
from tendonff.models.parameters.numbers import number_of, with_numbers

_FACTORS = {"mu": "friction: factor on mu [-]", "stiffness": "tendon stiffness: factor [-]"}
_DECADES = {"inertia_kg_m2": "moving inertia [kg m2]", "damping_N_m_s_per_rad": "damping of the joint [N m s/rad]"}
_LEAST = "sharing.least_tension_N"
_MOST_LAG_S = 0.05


class MotorExplorer(Subject):
    """A scenario of driven joints to be explored."""

    slow = ()

    def __init__(self, scenario: JointScenario | FingerScenario) -> None:
        self._task: MotorTask = problem_of(scenario)
        task = self._task
        self.name, self.file = scenario.name, scenario.source.name
        self.fast = tuple(Curve(name=c.name, label=c.label, style=c.style) for c in answering(task))
        self.panels = _panels_of_several(task) if task.goal.is_named else _panels_of_one(task)
        factors = [
            Knob(key=k, title=t, value=1.0, start=0.2, end=2.5, step=0.05, shown="0.00") for k, t in _FACTORS.items()
        ]
        self.knobs = (*factors, *(_knobs_of_several(task) if task.goal.is_named else _knobs_of_one(task)))

    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate; see `Subject.explore`."""
        task = self._changed(values)
        design, unit = task if design_knows else self._task, task.unit
        rows = slice(None, None, max(1, len(task.wanted) // MOST_POINTS))
        courses, notes = {}, []
        for curve in curves:
            try:
                command = design.answer(compensator_of(design, curve.name))
                found = task.respond(task.system, command)
            except TendonffError as error:  # one that has no answer must not take the others along
                if len(curves) == 1:
                    raise
                notes.append(f"{curve.label}: {error}")
                continue
            if found.slack:
                notes.append(f"{curve.label}: {found.slack}")
            output = task.values_of(found)
            error_shown = unit.factor * (output - task.wanted)[rows]
            more = np.rad2deg(command[:, 0] - design.lengths_rad[:, 0])[task.lead :]
            courses[curve.name] = Course(
                time_s=task.time_s[rows],
                given=error_shown if task.goal.is_named else more[rows],
                output=unit.factor * output[rows],
                error=error_shown,
                score=score(task.wanted, output),
            )
        wanted = unit.factor * task.wanted[rows]
        return Exploration(time_s=task.time_s[rows], wanted=wanted, courses=courses, notes=tuple(notes))

    def worst_case(self, values: Mapping[str, float], *, design_knows: bool) -> str:
        """Expected error; see `Subject.worst_case`."""
        task = self._changed(values)
        design = task if design_knows else self._task
        known = {curve.name: compensator_of(design, curve.name) for curve in self.fast}
        found = task.expect({name: design.answer(each) for name, each in known.items()})
        then = next_step(found, self.file, f"tendonff design {self.file} --out out")
        return found.headline(known[found.recommended].label, then)

    def toml(self, values: Mapping[str, float]) -> str:
        """Scenario file with these values and without comments; empty where a file cannot say them."""
        scenario = self._changed(values).scenario
        system = scenario.mechanism
        raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
        for row, tendon in zip(raw["tendons"], system.tendons, strict=True):
            row |= {"name": tendon.name, "tendon": set_keys(tendon.tendon), "friction": set_keys(tendon.friction)}
        for knob in self.knobs:
            *tables, key = knob.key.split(".")
            if not tables:
                continue
            place: Any = raw
            if tables[0] == "motors":
                place = raw["motors"][self._task.motors.index(tables[1])]
            else:
                for table in tables:
                    place = place.setdefault(table, {})
            if (value := number_of(system, knob.key)) is not None:
                place[key] = value
        text = to_toml(raw)
        return text if parse_any(text, scenario.source).system == system else ""

    def _changed(self, values: Mapping[str, float]) -> MotorTask:
        """The task with the knobs at these values."""
        system = self._task.system
        changed = {key: v for key, v in values.items() if not math.isclose(v, number_of(system, key) or 0.0)}
        if _LEAST in changed:  # which motors with one tendon keep as well
            alone = [motor.name for motor in system.motors if len(motor.winds) == 1]
            changed |= {f"motors.{name}.drive.least_tension_N": changed[_LEAST] for name in alone}
        other = with_numbers(system, changed)
        found: MotorTask = problem_of(replace(self._task.scenario, mechanism=other), self._task.level)
        return found


def _panels_of_one(task: MotorTask) -> dict[str, Panel]:
    unit, what = task.unit.shown, task.goal.quantity
    output, motor = f"{what} [{unit}]", "motor beyond the ratio [deg]"
    over_time = {"x": "time", "x_label": "time [s]"}
    return {
        "loop": Panel(title="Lost motion", x="output", y="given", x_label=output, y_label=motor),
        "motor": Panel(title="Motor beyond the ratio", y="given", y_label=motor, **over_time),
        "output": Panel(title=f"{what.capitalize()} (black: reference)", y="output", y_label=output, **over_time),
        "error": Panel(title="Error", y="error", y_label=f"error [{unit}]", **over_time),
    }


def _panels_of_several(task: MotorTask) -> dict[str, Panel]:
    unit, what = task.unit.shown, task.goal.quantity
    over_time = {"x": "time", "x_label": f"time, joint after joint ({', '.join(task.goal.names)}) [s]"}
    title, shown = f"{what.capitalize()}s (black: reference)", f"angle about mid-range [{unit}]"
    return {
        "loop": Panel(title="Error", y="error", y_label=f"error [{unit}]", **over_time),
        "output": Panel(title=title, y="output", y_label=shown, **over_time),
    }


def _weight(task: MotorTask, joint: str, title: str) -> Knob:
    key = f"joints.{joint}.gravity_N_m"
    weight = number_of(task.system, key) or 0.0
    most = max(5 * abs(weight), 0.1)
    return Knob(key=key, title=title, value=weight, start=-most, end=most, step=0.005)


def _tension(key: str, title: str, now: float, least: float) -> Knob:
    return Knob(key=key, title=title, value=now, start=least * now, end=max(4 * now, 10.0), step=0.1, shown="0.0")


def _knobs_of_one(task: MotorTask) -> list[Knob]:
    [joint], drive = task.system.joints, task.drives[0]
    loop = drive.kind is DriveKind.LOOP
    found = [
        _tension("drive.pretension_N", "pre-tension [N]", drive.pretension_N or 0.0, 0.0)
        if loop
        else _tension("drive.least_tension_N", "least tension [N]", drive.least_tension_N or 0.0, 0.1),
        _weight(task, joint.name, "torque of the weight [N m]"),
        Knob(
            key="drive.servo_time_s",
            title="lag of the servo [s]",
            value=drive.servo.servo_time_s,
            start=0.0,
            end=max(_MOST_LAG_S, 2 * drive.servo.servo_time_s),
            step=0.001,
        ),
    ]
    for name, title in _DECADES.items():
        if value := getattr(joint, name):
            found.append(Knob.decades(f"joints.{joint.name}.{name}", title, value, 1.0))
    return found


def _knobs_of_several(task: MotorTask) -> list[Knob]:
    finger = task.system
    loops = [motor for motor in finger.motors if len(motor.winds) > 1]
    found = []
    if len(loops) < len(finger.motors):  # else nothing is shared
        found.append(_tension(_LEAST, "least tension [N]", finger.sharing.least_tension_N, 0.1))
    for motor in loops:
        key, title = f"motors.{motor.name}.drive.pretension_N", f"pre-tension of {motor.name} [N]"
        found.append(_tension(key, title, motor.drive.pretension_N or 0.0, 0.1))
    return [*found, *(_weight(task, j.name, f"torque of the weight at {j.name} [N m]") for j in finger.joints)]
