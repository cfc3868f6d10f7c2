"""What the interactive page lets one change, and the scenario that follows."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint, WaypointJoint
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters import Friction, Path, Transmission
from tendonff.models.path import Section

_SECTION_MU = ("mu_dynamic", "mu_static", "mu_dynamic_release", "mu_static_release")


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
        friction, soft = transmission.friction, scenario.run.level.features.soft_bristle
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
            friction=self._friction(old.friction, soft=scenario.run.level.features.soft_bristle),
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
        given = {name: value for name in _SECTION_MU if (value := getattr(old, name)) is not None}
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
