"""Motor, gear and drum seen at the tendon.

    motor: torque, angle  --[ gear_ratio : 1 ]-->  drum: force = torque gear/radius, travel = angle radius/gear

Positive pulls the tendon in.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require_given


class Drive(StrEnum):
    """Command of the actuator: force or position."""

    FORCE = "force"  # its force f_c1: a current loop
    POSITION = "position"  # its position x_c1, behind the servo's stiffness k_c1: a position servo


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """A rotary motor that winds the tendon on a drum.

    Parameters
    ----------
    drum_radius_m : float
        Radius of the drum up to the middle of the tendon [m], > 0.
    gear_ratio : float
        Turns of the motor for one turn of the drum [-], > 0; 1 for a direct drive.
    inertia_kg_m2 : float
        Inertia of rotor and gear at the motor's shaft [kg m2], > 0.
    torque_max_N_m : float
        Largest torque of the motor [N m], > 0.
    speed_max_rad_per_s : float
        Largest speed of the motor [rad/s], > 0.
    torque_rated_N_m : float, optional
        Continuous torque [N m], > 0, limit of the RMS torque.
    stall_torque_N_m, no_load_speed_rad_per_s : float, optional
        Ends of the torque-speed line at the supply voltage [N m, rad/s], > 0; both or none.
    """

    drum_radius_m: float
    gear_ratio: float
    inertia_kg_m2: float
    torque_max_N_m: float
    speed_max_rad_per_s: float
    torque_rated_N_m: float | None = None
    stall_torque_N_m: float | None = None
    no_load_speed_rad_per_s: float | None = None

    def __post_init__(self) -> None:
        for name, hint in (
            ("drum_radius_m", "half the drum's diameter plus half the tendon's"),
            ("gear_ratio", "turns of the motor for one of the drum; 1 for a direct drive"),
            ("inertia_kg_m2", "1 g cm2 is 1e-7 kg m2"),
            ("torque_max_N_m", "the motor's peak torque, before the gear"),
            ("speed_max_rad_per_s", "1000 turns a minute are 104.7 rad/s"),
            ("torque_rated_N_m", "leave it out if it is not known"),
            ("stall_torque_N_m", "leave it out if it is not known"),
            ("no_load_speed_rad_per_s", "leave it out if it is not known"),
        ):
            require_given(name, getattr(self, name), above=0, hint=hint)
        if (self.stall_torque_N_m is None) != (self.no_load_speed_rad_per_s is None):
            raise ParameterError(
                "stall_torque_N_m and no_load_speed_rad_per_s make the torque-speed line together; give both or none"
            )

    @property
    def travel_per_rad_m(self) -> float:
        """Travel of the tendon for one radian of the motor [m/rad]."""
        return self.drum_radius_m / self.gear_ratio

    @property
    def mass_kg(self) -> float:
        """Inertia as a mass at the tendon, J gear^2/radius^2 [kg]."""
        return self.inertia_kg_m2 / self.travel_per_rad_m**2

    @property
    def force_max_N(self) -> float:
        """Largest torque as a force at the tendon, torque gear/radius [N]."""
        return self.torque_max_N_m / self.travel_per_rad_m

    @property
    def stall_force_N(self) -> float:
        """Stall torque as a force at the tendon, infinite where it is not given [N]."""
        return math.inf if self.stall_torque_N_m is None else self.stall_torque_N_m / self.travel_per_rad_m

    @property
    def speed_max_m_per_s(self) -> float:
        """Largest speed at the tendon [m/s]."""
        return self.speed_max_rad_per_s * self.travel_per_rad_m

    @property
    def at_the_drum(self) -> dict[str, float]:
        """Values of the actuator that follow from its motor, by the actuator's keys."""
        return {key: getattr(self, key) for key in ("mass_kg", "force_max_N", "speed_max_m_per_s")}

    def torque_limit_N_m(self, speed_rad_per_s: float) -> float:
        """Largest torque at a speed in its direction, by torque_max_N_m and the torque-speed line [N m].

        Below 0 the motor brakes, and the line does not bind.
        """
        if self.stall_torque_N_m is None or self.no_load_speed_rad_per_s is None:
            return self.torque_max_N_m
        share = 1 - max(speed_rad_per_s, 0.0) / self.no_load_speed_rad_per_s
        return min(self.torque_max_N_m, max(self.stall_torque_N_m * share, 0.0))


_ROPES = (  # least and most of any tendon, so that another unit is named by the key that has it
    ("elastic_modulus_Pa", 1e6, 2e12, "1 GPa is 1e9 Pa"),
    ("length_m", 1e-3, 100.0, "the whole length that is stretched; 1 mm is 1e-3 m"),
    ("cross_section_m2", 1e-12, 1e-2, "1 mm2 is 1e-6 m2"),
    ("diameter_m", 1e-6, 0.1, "1 mm is 1e-3 m"),
    ("density_kg_per_m3", 100.0, 3e4, "steel 7900, tungsten 19300, UHMWPE 970"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rope:
    """Data sheet of a tendon, from which stiffness and mass follow.

    Parameters
    ----------
    elastic_modulus_Pa : float
        Modulus E along the tendon [Pa], 1e6 to 2e12; of a twisted rope, the rope's and not the wire's.
    length_m : float
        Length L between actuator and load [m], 1e-3 to 100.
    cross_section_m2 : float, optional
        Cross-section A that carries [m2], 1e-12 to 0.01.
    diameter_m : float, optional
        Diameter of a round, solid tendon [m], 1e-6 to 0.1, instead of the cross-section.
    density_kg_per_m3 : float, optional
        Density [kg/m3], 100 to 3e4.
    """

    elastic_modulus_Pa: float
    length_m: float
    cross_section_m2: float | None = None
    diameter_m: float | None = None
    density_kg_per_m3: float | None = None

    def __post_init__(self) -> None:
        beyond = []
        for name, least, most, hint in _ROPES:
            value = getattr(self, name)
            require_given(name, value, above=0, hint=hint)
            if value is not None and not least <= value <= most:
                beyond.append(f"{name} = {value:g} is not within {least:g} and {most:g}: {hint}")
        if beyond:
            raise ParameterError("; ".join(beyond))
        if (self.cross_section_m2 is None) == (self.diameter_m is None):
            raise ParameterError(
                "elastic_modulus_Pa needs cross_section_m2 or diameter_m, one of them: EA/L is the stiffness"
            )

    @property
    def area_m2(self) -> float:
        """Cross-section A [m2]."""
        return self.cross_section_m2 or math.pi * (self.diameter_m or 0.0) ** 2 / 4

    @property
    def stiffness_N_per_m(self) -> float:
        """EA/L [N/m]."""
        return self.elastic_modulus_Pa * self.area_m2 / self.length_m

    @property
    def mass_kg(self) -> float | None:
        """Density times A L [kg]; None without a density."""
        return None if self.density_kg_per_m3 is None else self.density_kg_per_m3 * self.area_m2 * self.length_m
