"""A joint on the interactive page."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import getitem
from typing import Any

import numpy as np

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.registry import motor_compensator, motor_compensators
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import score
from tendonff.compensator.identification.joint.fitted import set_keys, to_toml
from tendonff.compensator.joint.scenario.base import with_base
from tendonff.compensator.joint.scenario.scenario import JointScenario, parse_joint_scenario
from tendonff.compensator.studies.explore.subject import MOST_POINTS, Course, Curve, Exploration, Knob, Panel, Subject
from tendonff.models.joint.parameters import DriveKind
from tendonff.models.parameters.numbers import number_of, with_numbers

_FACTORS = {"mu": "friction: factor on mu [-]", "stiffness": "tendon stiffness: factor [-]"}
_DECADES = {"inertia_kg_m2": "moving inertia [kg m2]", "damping_N_m_s_per_rad": "damping of the joint [N m s/rad]"}
_MOST_LAG_S = 0.05


class JointExplorer(Subject):
    """A scenario of a joint to be explored."""

    slow = ()

    def __init__(self, scenario: JointScenario) -> None:
        self._task = task = JointTask.of(scenario)
        self.name, self.file = scenario.name, scenario.source.name
        self.fast = tuple(Curve(name=c.name, label=c.label, style=c.style) for c in motor_compensators(task))
        self._unit = unit = scenario.reference.shown
        what = "joint angle" if unit.shown == "deg" else "torque of the joint"
        output, motor = f"{what} [{unit.shown}]", "motor beyond the ratio [deg]"
        self.panels = {
            "loop": Panel(title="Lost motion", x="output", y="given", x_label=output, y_label=motor),
            "motor": Panel(title="Motor beyond the ratio", x="time", y="given", x_label="time [s]", y_label=motor),
            "output": Panel(
                title=f"{what.capitalize()} (black: reference)",
                x="time",
                y="output",
                x_label="time [s]",
                y_label=output,
            ),
            "error": Panel(title="Error", x="time", y="error", x_label="time [s]", y_label=f"error [{unit.shown}]"),
        }
        self.knobs = self._knobs()

    def _knobs(self) -> tuple[Knob, ...]:
        mechanism = self._task.mechanism
        joint, drive = f"joints.{mechanism.joint.name}", mechanism.drive
        loop = drive.kind is DriveKind.LOOP
        tension = "drive.pretension_N" if loop else "drive.least_tension_N"
        now, weight = number_of(mechanism, tension) or 0.0, mechanism.joint.gravity_N_m
        found = [
            *(
                Knob(key=k, title=t, value=1.0, start=0.2, end=2.5, step=0.05, shown="0.00")
                for k, t in _FACTORS.items()
            ),
            Knob(
                key=tension,
                title="pre-tension [N]" if loop else "least tension [N]",
                value=now,
                start=0.0 if loop else 0.1 * now,
                end=max(4 * now, 10.0),
                step=0.1,
                shown="0.0",
            ),
            Knob(
                key=f"{joint}.gravity_N_m",
                title="torque of the weight [N m]",
                value=weight,
                start=-max(5 * abs(weight), 0.1),
                end=max(5 * abs(weight), 0.1),
                step=0.005,
            ),
            Knob(
                key="drive.servo_time_s",
                title="lag of the servo [s]",
                value=drive.servo_time_s,
                start=0.0,
                end=max(_MOST_LAG_S, 2 * drive.servo_time_s),
                step=0.001,
            ),
        ]
        for name, title in _DECADES.items():
            if value := number_of(mechanism, f"{joint}.{name}"):
                found.append(Knob.decades(f"{joint}.{name}", title, value, 1.0))
        return tuple(found)

    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate; see `Subject.explore`."""
        task = self._changed(values)
        design = task if design_knows else self._task
        sampled, unit = task.sampled, self._unit
        ratio = design.lengths_rad[:, 0]
        rows = slice(sampled.lead, None, max(1, (len(sampled.time_s) - sampled.lead) // MOST_POINTS))
        courses, notes = {}, []
        for curve in curves:
            command = motor_compensator(design, curve.name).command_rad(design)
            run = task.respond(task.mechanism, command)
            if run.slack:
                notes.append(f"{curve.label}: {run.slack}")
            reached = run.output[:, 0]
            courses[curve.name] = Course(
                time_s=sampled.time_s[rows],
                given=np.rad2deg(command[:, 0] - ratio)[rows],
                output=unit.factor * reached[rows],
                error=unit.factor * (reached - sampled.wanted)[rows],
                score=score(task.wanted, reached[sampled.lead :]),
            )
        return Exploration(
            time_s=sampled.time_s[rows],
            wanted=unit.factor * sampled.wanted[rows],
            courses=courses,
            notes=tuple(notes),
        )

    def worst_case(self, values: Mapping[str, float], *, design_knows: bool) -> str:
        """Expected error; see `Subject.worst_case`."""
        task = self._changed(values)
        design = task if design_knows else self._task
        commands = {curve.name: motor_compensator(design, curve.name).command_rad(design) for curve in self.fast}
        found = task.expect(commands)
        label = motor_compensator(design, found.recommended).label
        return found.headline(label, next_step(found, self.file, f"tendonff design {self.file} --out out"))

    def toml(self, values: Mapping[str, float]) -> str:
        """Scenario file with these values and without comments; empty where a file cannot say them."""
        scenario = self._changed(values).scenario
        raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
        for row, tendon in zip(raw["tendons"], scenario.mechanism.tendons, strict=True):
            row |= {"name": tendon.name, "tendon": set_keys(tendon.tendon), "friction": set_keys(tendon.friction)}
        for knob in self.knobs:
            *tables, key = knob.key.split(".")
            if tables and (value := number_of(scenario.mechanism, knob.key)) is not None:
                reduce(getitem, tables, raw)[key] = value
        text = to_toml(raw)
        said = parse_joint_scenario(text, scenario.source)
        return text if said.mechanism == scenario.mechanism else ""

    def _changed(self, values: Mapping[str, float]) -> JointTask:
        """The task with the knobs at these values."""
        changed = {
            key: value
            for key, value in values.items()
            if not math.isclose(value, number_of(self._task.mechanism, key) or 0.0)
        }
        mechanism = with_numbers(self._task.mechanism, changed)
        scenario = replace(self._task.scenario, mechanism=mechanism)
        return replace(self._task, scenario=scenario, mechanism=mechanism)
