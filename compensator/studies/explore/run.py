"""Parameters that the interactive page changes in a scenario, its design and simulation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tendonff.compensator.compensators.base import Compensator, Problem, answers_of, with_motion
from tendonff.compensator.compensators.expectation import error_bands, expectation_of
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.plant import Plant, delivered_of
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import score, verify
from tendonff.compensator.compensators.tuning import tuned_chain, tuning_of
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.progress import Parts, silent
from tendonff.compensator.reporting.colours import PURPLE, Style
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint, WaypointJoint
from tendonff.compensator.scenario.reference import ReferenceSpec
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_to_toml
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.studies.explore.subject import MOST_POINTS, Course, Curve, Exploration, Knob, Panel, Subject
from tendonff.models.errors import TendonffError
from tendonff.models.parameters import Friction, Path, Transmission
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.path import COEFFICIENTS, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.errors import SolveError


@dataclass(frozen=True, slots=True, kw_only=True)
class ExploreParameters:
    """Values of the sliders."""

    mu: float  # dynamic coefficient when pulling [-]; all others, those of sections too, keep their ratio to it
    total_angle_deg: float  # wrap angle [deg]; sections keep their shares
    bristle_stiffness_N_per_m: float  # of the level that is shown
    relaxation_time_s: float
    force_rate_max_N_per_s: float
    load_stiffness_N_per_m: float
    load_mass_kg: float
    # what is added to the angle of each joint [deg]; joints whose motion was measured stay out
    pose_deg: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: Scenario) -> "ExploreParameters":
        """The values of a scenario; joints as they are."""
        transmission = scenario.transmission
        friction, soft = transmission.friction, scenario.run.level.soft_bristle
        return cls(
            mu=friction.mu_dynamic,
            total_angle_deg=float(np.degrees(transmission.path.total_angle_rad)),
            bristle_stiffness_N_per_m=(
                friction.soft_bristle_stiffness_N_per_m if soft else friction.bristle_stiffness_N_per_m
            ),
            relaxation_time_s=transmission.tendon.relaxation_time_s,
            force_rate_max_N_per_s=transmission.actuator.force_rate_max_N_per_s,
            load_stiffness_N_per_m=transmission.load.stiffness_N_per_m,
            load_mass_kg=transmission.load.mass_kg,
            pose_deg={name: 0.0 for name, joint in scenario.joints.items() if not isinstance(joint, CsvJoint)},
        )

    def apply(self, scenario: Scenario) -> Scenario:
        """The scenario with these values."""
        old, load = scenario.transmission, scenario.transmission.load
        changed = replace(
            old,
            path=self._path(old),
            tendon=replace(old.tendon, relaxation_time_s=self.relaxation_time_s),
            friction=self._friction(old.friction, soft=scenario.run.level.soft_bristle),
            actuator=replace(old.actuator, force_rate_max_N_per_s=self.force_rate_max_N_per_s),
            load=replace(load, stiffness_N_per_m=self.load_stiffness_N_per_m, mass_kg=self.load_mass_kg),
        )
        joints = {
            name: shifted(joint, float(np.radians(self.pose_deg.get(name, 0.0))))
            for name, joint in scenario.joints.items()
        }
        return replace(scenario, transmission=changed, joints=joints)

    def _friction(self, old: Friction, *, soft: bool) -> Friction:
        bristle = "soft_bristle_stiffness_N_per_m" if soft else "bristle_stiffness_N_per_m"
        before = old.mu_dynamic
        coefficients = {
            "mu_dynamic": self.mu,
            "mu_static": _in_proportion(old.mu_static, before, self.mu),
            "mu_dynamic_release": _in_proportion(old.release_dynamic, before, self.mu),
            "mu_static_release": _in_proportion(old.release_static, before, self.mu),
        }
        return replace(old, **coefficients, **{bristle: self.bristle_stiffness_N_per_m})

    def _path(self, old: Transmission) -> Path:
        total = float(np.radians(self.total_angle_deg))
        share = total / old.path.total_angle_rad if old.path.total_angle_rad > 0 else 1.0
        sections = tuple(self._section(section, share, old.friction.mu_dynamic) for section in old.path.sections)
        if sections:
            total = sum(section.angle_rad for section in sections)
        return replace(old.path, total_angle_rad=total, sections=sections)

    def _section(self, old: Section, share: float, mu_before: float) -> Section:
        given = {name: value for name in COEFFICIENTS if (value := getattr(old, name)) is not None}
        coefficients: dict[str, Any] = {n: _in_proportion(value, mu_before, self.mu) for n, value in given.items()}
        return replace(old, angle_rad=share * old.angle_rad, **coefficients)


def shifted(joint: Joint, by_rad: float) -> Joint:
    """A joint that does the same about another angle; one whose motion was measured stays."""
    match joint:
        case ConstantJoint():
            return replace(joint, angle_rad=joint.angle_rad + by_rad)
        case SineJoint():
            return replace(joint, offset_rad=joint.offset_rad + by_rad)
        case WaypointJoint():
            return replace(joint, angles_rad=tuple(angle + by_rad for angle in joint.angles_rad))
        case CsvJoint():
            return joint


def _in_proportion(value: float, old: float, new: float) -> float:
    return value * new / old if old > 0 else new


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionCurve(Curve):
    """Curve of a compensator, or of the self-tuning one."""

    compensator: Compensator | None  # None tunes itself to a measurement


_POSE = "pose of "
_ALL = tuple(TensionCurve(name=c.name, label=c.label, style=c.style, compensator=c) for c in COMPENSATORS)
FAST = tuple(curve for curve, c in zip(_ALL, COMPENSATORS, strict=True) if c.is_fast)
"""Fast enough to follow a slider."""
SLOW = (
    *(curve for curve in _ALL if curve not in FAST),
    TensionCurve(
        name="self_tuning", label="self-tuning inverse", style=Style(color=PURPLE, linestyle="-"), compensator=None
    ),
)
"""These take a second or more, and come when they are asked for."""


def _panels(wanted: ReferenceSpec) -> dict[str, Panel]:
    """Panels of a page whose curves are compared with this reference."""
    what, unit = wanted.output, wanted.unit.shown
    short = what.rpartition(" ")[2]
    return {
        "loop": Panel(
            title="Tendon hysteresis", x="given", y="output", x_label="force [N]", y_label=f"{what} [{unit}]"
        ),
        "force": Panel(title="Force profile", x="time", y="given", x_label="time [s]", y_label="force [N]"),
        "output": Panel(
            title=f"{what.capitalize()} (black: reference)",
            x="time",
            y="output",
            x_label="time [s]",
            y_label=f"{short} [{unit}]",
        ),
        "error": Panel(title="Error", x="time", y="error", x_label="time [s]", y_label=f"error [{unit}]"),
    }


class Explorer(Subject):
    """A scenario of a tension to be explored."""

    fast, slow = FAST, SLOW

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.panels = _panels(scenario.reference)
        self.start = start = ExploreParameters.of(scenario)
        self.name, self.file = scenario.name, scenario.source.name
        angle, mu = start.total_angle_deg, start.mu
        self.knobs = (
            Knob(
                key="mu",
                title="friction coefficient mu [-]",
                value=mu,
                start=0.0,
                end=max(0.5, 2 * mu),
                step=0.005,
            ),
            Knob(
                key="total_angle_deg",
                title="wrap angle [deg]",
                value=angle,
                start=0.0,
                end=max(360.0, 1.5 * angle),
                step=5.0,
                shown="0",
            ),
            *(
                Knob.decades(key, title, getattr(start, key), decades)
                for key, title, decades in (
                    ("bristle_stiffness_N_per_m", "bristle stiffness [N/m]", 1.5),
                    ("relaxation_time_s", "relaxation time [s]", 1.5),
                    ("force_rate_max_N_per_s", "rate limit of the force [N/s]", 3.0),
                    ("load_stiffness_N_per_m", "load stiffness [N/m]", 1.0),
                    ("load_mass_kg", "load mass [kg]", 1.0),
                )
            ),
            *(
                Knob(
                    key=f"{_POSE}{joint}",
                    title=f"pose: {joint} turned by [deg]",
                    value=0.0,
                    start=-45.0,
                    end=45.0,
                    step=1.0,
                    shown="0",
                )
                for joint in start.pose_deg
            ),
        )

    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate; see `Subject.explore`."""
        mine = [curve for curve in curves if isinstance(curve, TensionCurve)]
        return self.at(self._parameters(values), design_knows=design_knows, curves=mine)

    def worst_case(self, values: Mapping[str, float], *, design_knows: bool) -> str:
        """Expected error; see `Subject.worst_case`."""
        return self.worst_case_at(self._parameters(values), design_knows=design_knows)

    def toml(self, values: Mapping[str, float]) -> str:
        """The changed scenario; see `Subject.toml`."""
        return scenario_to_toml(self._parameters(values).apply(self._scenario))

    @staticmethod
    def _parameters(values: Mapping[str, float]) -> ExploreParameters:
        poses = {key.removeprefix(_POSE): value for key, value in values.items() if key.startswith(_POSE)}
        others = {key: value for key, value in values.items() if not key.startswith(_POSE)}
        return ExploreParameters(**others, pose_deg=poses)

    def at(
        self, parameters: ExploreParameters, *, design_knows: bool = True, curves: Sequence[TensionCurve] = FAST
    ) -> Exploration:
        """Design and simulate with changed parameters.

        The design is made for the changed transmission; else for the scenario's own, and tried on the changed one, with
        the changed actuator. TendonffError when the reference cannot be delivered, or a value is out of bounds.
        """
        problem, plant = self._posed(parameters, design_knows=design_knows)
        notes: list[str] = []
        courses = {}
        for curve in curves:
            try:
                courses[curve.name] = _course(problem, plant, curve, self._scenario.adaptation, notes)
            except TendonffError as error:
                if curve in FAST:
                    raise
                notes.append(f"{curve.label}: {error}")
        reference = problem.reference
        rows = slice(None, None, max(1, len(reference.time_s) // MOST_POINTS))
        return Exploration(
            time_s=reference.time_s[rows],
            wanted=reference.unit.factor * reference.wanted[rows],
            courses=courses,
            notes=tuple(notes),
        )

    def worst_case_at(self, parameters: ExploreParameters, *, design_knows: bool = True) -> str:
        """Expected error of the fast curves over the scenario's uncertainty about the changed transmission."""
        problem, plant = self._posed(parameters, design_knows=design_knows)
        doubt = Doubt.of(plant, self._scenario.robust)
        labels = {curve.name: curve.label for curve in FAST}
        fast = [curve.compensator for curve in FAST if curve.compensator is not None]
        profiles = answers_of(problem, fast, Parts(silent, len(fast))).profiles
        bands = error_bands(doubt, problem.level, profiles, problem.reference, {})
        found = expectation_of(doubt, problem.level, bands, problem.share_of, problem.unit, change=problem.change)
        file = self._scenario.source.name
        then = next_step(found, file, f"tendonff design {file} --out out")
        return found.headline(labels[found.recommended], then)

    def _posed(self, parameters: ExploreParameters, *, design_knows: bool) -> tuple[Problem, Transmission]:
        """The problem of the nominal design, and the plant that it is tried on."""
        changed = parameters.apply(self._scenario)
        known = self._scenario.transmission
        model = (
            changed
            if design_knows
            else replace(self._scenario, transmission=replace(known, actuator=changed.transmission.actuator))
        )
        problem = replace(Problem.of(model, reference=sample_reference(model, strict=True)), uncertainty=Uncertainty())
        return problem, moved(changed, float(problem.reference.time_s[-1]), periodic=problem.reference.periodic)


def _course(
    problem: Problem, plant: Transmission, curve: TensionCurve, settings: Adaptation | None, notes: list[str]
) -> Course:
    """Curve on the plant; warnings go to `notes`."""
    reference = problem.reference
    if curve.compensator is None:
        force, tension = _tuned(problem, plant, settings or Adaptation(sensor=Sensor.ACTUATOR_POSITION))
        return _thinned(problem, force, delivered_of(plant.load, tension, reference))
    if reason := curve.compensator.refusal(problem):
        raise SolveError(reason)
    profile: Profile = with_motion(problem, curve.name, curve.compensator.profile(problem))
    if profile.status is not ProfileStatus.GOOD:
        notes.append(f"{curve.label}: {profile.message}")
    found = verify(Plant(plant, problem.level), curve.name, profile, reference)
    if found.slack:
        notes.append(f"{curve.label}: {found.slack.message}")
    return _thinned(problem, profile.force_N, found.delivered)


def _tuned(problem: Problem, plant: Transmission, settings: Adaptation) -> tuple[FloatArray, FloatArray]:
    """Force and output tension of the inverse that tunes itself, without noise."""
    reference, tuning = problem.reference, tuning_of(problem, settings)
    step, start = reference.step_s, reference.initial_tension_N
    tuner = SelfTuner(tuned_chain(problem, tuning), step, tuning, problem.limits, start)
    rig = SimulatedRig(Chain.of(plant, problem.level), step, 1, start)
    run = tuner.run(rig, reference.tension_N[1:], np.zeros(len(reference.tension_N) - 1))
    return np.concatenate([[start], run.force_N]), np.concatenate([[start], run.tension_N])


def _thinned(problem: Problem, force_N: FloatArray, output: FloatArray) -> Course:
    reference = problem.reference
    factor = reference.unit.factor
    rows = slice(None, None, max(1, len(reference.time_s) // MOST_POINTS))
    return Course(
        time_s=reference.time_s[rows],
        given=force_N[rows],
        output=factor * output[rows],
        error=factor * (output - reference.wanted)[rows],
        score=score(reference.wanted, output),
    )
