"""Values that are possible but look like another unit: asked about, never changed."""

import math
from dataclasses import dataclass

from tendonff.models.parameters import Transmission


@dataclass(frozen=True, slots=True)
class _Doubt:
    table: str
    key: str
    value: float
    doubtful: bool
    question: str

    def __str__(self) -> str:
        return f"[{self.table}] {self.key} = {self.value:g}{self.question}"


def questions(transmission: Transmission) -> list[str]:
    """What to ask about the parameters of a rig."""
    path, tendon, friction = transmission.path, transmission.tendon, transmission.friction
    actuator, load = transmission.actuator, transmission.load
    angle, stiffness, radius = path.total_angle_rad, tendon.stiffness_N_per_m, path.radius_m
    stretch = actuator.force_max_N / stiffness
    soft = f": softer than a rubber band; N/mm? Then it is {1e3 * stiffness:g}"
    long = f": force_max_N stretches the tendon by {stretch:.2g} m; N/mm?"
    doubts = (
        _Doubt("path", "total_angle_rad", angle, angle > 25, f" is {angle / (2 * math.pi):.3g} turns: degrees?"),
        _Doubt("path", "radius_m", radius or 0, (radius or 0) > 5, ": millimetres?"),
        _Doubt("tendon", "mass_kg", tendon.mass_kg, tendon.mass_kg > 1, ": grams?"),
        _Doubt(
            "tendon", "stiffness_N_per_m", stiffness, stiffness < 300 or stretch > 1, soft if stiffness < 300 else long
        ),
        _Doubt("friction", "mu_dynamic", friction.mu_dynamic, friction.mu_dynamic > 1.5, ": per cent?"),
        _Doubt("actuator", "mass_kg", actuator.mass_kg, actuator.mass_kg > 200, ": grams?"),
        _Doubt("load", "mass_kg", load.mass_kg, load.mass_kg > 500, ": grams?"),
        _Doubt("load", "stiffness_N_per_m", load.stiffness_N_per_m, load.stiffness_N_per_m < 1, ": N/mm?"),
    )
    return [str(doubt) for doubt in doubts if doubt.doubtful]
