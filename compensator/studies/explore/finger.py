"""Several joints on the interactive page: their angles one after the other."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.registry import motor_compensator, motor_compensators
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import score
from tendonff.compensator.finger.scenario import FingerScenario, parse_finger_scenario
from tendonff.compensator.identification.joint.fitted import set_keys, to_toml
from tendonff.compensator.joint.scenario.base import with_base
from tendonff.compensator.studies.explore.subject import MOST_POINTS, Course, Curve, Exploration, Knob, Panel, Subject
from tendonff.models.errors import TendonffError
from tendonff.models.parameters.numbers import number_of, with_numbers

_FACTORS = {"mu": "friction: factor on mu [-]", "stiffness": "tendon stiffness: factor [-]"}
_LEAST = "sharing.least_tension_N"


class FingerExplorer(Subject):
    """A scenario of several joints to be explored."""

    slow = ()

    def __init__(self, scenario: FingerScenario) -> None:
        self._task = FingerTask.of(scenario)
        self.name, self.file = scenario.name, scenario.source.name
        self.fast = tuple(Curve(name=c.name, label=c.label, style=c.style) for c in motor_compensators(self._task))
        names = ", ".join(self._task.finger.names[: scenario.wanted])
        x_label = f"time, joint after joint ({names}) [s]"
        self.panels = {
            "loop": Panel(title="Error", x="time", y="error", x_label=x_label, y_label="error [deg]"),
            "output": Panel(
                title="Joint angles (black: reference)",
                x="time",
                y="output",
                x_label=x_label,
                y_label="angle about mid-range [deg]",
            ),
        }
        self.knobs = self._knobs()

    def _knobs(self) -> tuple[Knob, ...]:
        finger = self._task.finger
        found = [
            Knob(key=k, title=t, value=1.0, start=0.2, end=2.5, step=0.05, shown="0.00") for k, t in _FACTORS.items()
        ]
        tensions = {_LEAST: ("least tension [N]", finger.sharing.least_tension_N)}
        tensions |= {
            f"motors.{m.name}.drive.pretension_N": (f"pre-tension of {m.name} [N]", m.drive.pretension_N or 0.0)
            for m in finger.motors
            if len(m.winds) > 1
        }
        if all(len(m.winds) > 1 for m in finger.motors):  # loops alone: nothing is shared
            del tensions[_LEAST]
        for key, (title, now) in tensions.items():
            end = max(4 * now, 10.0)
            found.append(Knob(key=key, title=title, value=now, start=0.1 * now, end=end, step=0.1, shown="0.0"))
        for joint in finger.joints:
            weight = joint.gravity_N_m
            most = max(5 * abs(weight), 0.1)
            title = f"torque of the weight at {joint.name} [N m]"
            key = f"joints.{joint.name}.gravity_N_m"
            found.append(Knob(key=key, title=title, value=weight, start=-most, end=most, step=0.005))
        return tuple(found)

    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate; see `Subject.explore`."""
        task = self._changed(values)
        design = task if design_knows else self._task
        wanted = np.rad2deg(task.wanted)
        rows = slice(None, None, max(1, len(wanted) // MOST_POINTS))
        courses, notes = {}, []
        for curve in curves:
            try:
                found = task.respond(task.finger, motor_compensator(design, curve.name).command_rad(design))
            except TendonffError as error:  # one that has no answer must not take the others along
                if len(curves) == 1:
                    raise
                notes.append(f"{curve.label}: {error}")
                continue
            if found.slack:
                notes.append(f"{curve.label}: {found.slack}")
            output = task.values_of(found)
            reached = np.rad2deg(output)
            courses[curve.name] = Course(
                time_s=task.time_s[rows],
                given=(reached - wanted)[rows],
                output=reached[rows],
                error=(reached - wanted)[rows],
                score=score(task.wanted, output),
            )
        return Exploration(time_s=task.time_s[rows], wanted=wanted[rows], courses=courses, notes=tuple(notes))

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
        finger, scenario = self._changed(values).finger, self._task.scenario
        raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
        for row, tendon in zip(raw["tendons"], finger.tendons, strict=True):
            row |= {"name": tendon.name, "tendon": set_keys(tendon.tendon), "friction": set_keys(tendon.friction)}
            if any(section.mu_dynamic is not None for section in tendon.path.sections):
                return ""  # a section's own coefficient stands in another table
        raw["sharing"] = {**raw.get("sharing", {}), **set_keys(finger.sharing)}
        for joint in finger.joints:
            raw["joints"][joint.name]["gravity_N_m"] = joint.gravity_N_m
        for row, motor in zip(raw.get("motors", []), finger.motors, strict=False):
            if len(motor.winds) > 1:
                row["pretension_N"] = motor.drive.pretension_N
        text = to_toml(raw)
        return text if parse_finger_scenario(text, scenario.source).mechanism == finger else ""

    def _changed(self, values: Mapping[str, float]) -> FingerTask:
        """The task with the knobs at these values."""
        finger = self._task.finger
        changed = {key: v for key, v in values.items() if not math.isclose(v, number_of(finger, key) or 0.0)}
        if _LEAST in changed:  # which motors with one tendon keep as well
            alone = [motor.name for motor in finger.motors if len(motor.winds) == 1]
            changed |= {f"motors.{name}.drive.least_tension_N": changed[_LEAST] for name in alone}
        other = with_numbers(finger, changed)
        scenario = replace(self._task.scenario, mechanism=other)
        return replace(self._task, scenario=scenario, finger=other)
