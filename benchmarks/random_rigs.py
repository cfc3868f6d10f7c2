"""Random rigs and references over wide ranges, for the optimal profile."""

import numpy as np
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Actuator, Friction, Load, Path, Tendon, Transmission

Array = NDArray[np.float64]


def random_problem(seed: int) -> tuple[Transmission, Level, Array, float]:
    """A rig, a level, a reference and its step."""
    rng = np.random.default_rng(seed)
    reference, step = random_reference(rng)
    rig = random_rig(rng, reference, step)
    return rig, Level(str(rng.choice(list(Level)))), reference, step


def random_reference(rng: np.random.Generator) -> tuple[Array, float]:
    """Sines, straight lines or smooth steps around a random tension; and the step."""
    start = float(np.exp(rng.uniform(np.log(5), np.log(200))))
    swing, frequency = start * rng.uniform(0.1, 0.7), float(np.exp(rng.uniform(np.log(0.2), np.log(3))))
    duration, rows = min(rng.uniform(2, 4) / frequency, 6.0), int(rng.integers(400, 900))
    time = np.linspace(0, duration, rows)
    if rng.random() < 1 / 3:
        fade = np.minimum(time / (0.1 * duration), 1)
        wave = 0.7 * np.sin(2 * np.pi * frequency * time) + 0.3 * np.sin(4.6 * np.pi * frequency * time)
        return start + fade * swing * wave, duration / (rows - 1)
    count = int(rng.integers(3, 9))
    corners, levels = np.linspace(0, duration, count), start + swing * rng.uniform(-1, 1, count)
    levels[0] = start
    left = np.clip(np.searchsorted(corners, time, side="right") - 1, 0, count - 2)
    u = (time - corners[left]) / (corners[left + 1] - corners[left])
    if rng.random() < 0.5:
        u = u**3 * (10 - 15 * u + 6 * u**2)
    return levels[left] + (levels[left + 1] - levels[left]) * u, duration / (rows - 1)


def random_rig(rng: np.random.Generator, reference: Array, step: float) -> Transmission:
    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mu = float(rng.uniform(0.02, 0.4))
    angle = min(float(rng.uniform(0.3, 9)), 2.5 / mu)
    ratio = float(np.exp(mu * angle))
    return Transmission(
        path=Path(total_angle_rad=angle, segments=int(rng.integers(1, 10)), radius_m=log(0.01, 0.2)),
        tendon=Tendon(
            mass_kg=log(5e-4, 0.05),
            stiffness_N_per_m=log(3e3, 2e5),
            relaxing_stiffness_N_per_m=log(100, 3e4),
            relaxation_time_s=log(0.02, 3),
            damping_N_s_per_m=float(rng.choice([0.0, log(0.1, 20)])),
        ),
        friction=Friction(
            mu_dynamic=mu,
            mu_static=mu * float(rng.choice([1.0, 1.0, 1.2])),
            stribeck_velocity_m_per_s=log(1e-3, 0.05),
            viscous_N_s_per_m=float(rng.choice([0.0, log(0.1, 10)])),
            bristle_stiffness_N_per_m=log(1e5, 1e7),
            soft_bristle_stiffness_N_per_m=log(3e3, 1e5),
            mu_dynamic_release=mu * float(rng.choice([0.6, 1.0, 1.5])),
            adhesion_N=float(rng.choice([0.0, 0.0, 2.0])),
        ),
        actuator=Actuator(
            mass_kg=log(0.02, 2),
            damping_N_s_per_m=log(0.5, 50),
            force_min_N=float(rng.choice([0.0, 0.0, 0.1])) * float(reference[0]),
            force_max_N=float(reference.max()) * ratio * float(rng.uniform(0.8, 2)),
            force_rate_max_N_per_s=float(np.abs(np.diff(reference)).max()) / step * ratio * log(0.5, 30),
        ),
        load=Load(mass_kg=log(0.005, 0.5), stiffness_N_per_m=log(500, 2e4), damping_N_s_per_m=log(0.2, 20)),
    )
