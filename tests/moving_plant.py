"""A tendon on a path that moves, written without the package: sections by hand, implicit Euler and Newton in numpy.

Friction without Stribeck effect and without direction, the load on its spring, every section gets the same number of
masses; a section that is straight with its joints at zero gets none.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from tendonff.models.parameters import Path, Transmission
from tendonff.models.path import JointMotion, Section

Array = NDArray[np.float64]
SECTIONS = (
    Section(name="arm", angle_rad=1.2, length_m=0.036),
    Section(name="knuckle", angle_rad=0.9, length_m=0.027, joint="k", angle_per_rad=1.0, length_per_rad_m=0.01),
    Section(name="bone", angle_rad=0.0, length_m=0.03),
    Section(name="middle", angle_rad=0.7, length_m=0.021, joint="m", angle_per_rad=1.0, length_per_rad_m=0.008),
    Section(name="tip", angle_rad=0.6, length_m=0.018, mu_dynamic=0.15, mu_static=0.15),
)


def moving_finger(rig: Transmission, time_s: Array, segments: int) -> Transmission:
    """The rig's tendon without Stribeck effect on a path of `SECTIONS`, two of which move."""
    plain = replace(rig.friction, mu_static=0.2, mu_dynamic_release=None, mu_static_release=None, adhesion_N=0.0)
    fade = np.minimum(time_s / 0.3, 1)
    swings = [0.8 * fade * np.sin(2 * np.pi * 0.7 * time_s), 0.6 * fade * np.sin(2 * np.pi * 1.1 * time_s)]
    return replace(
        rig,
        path=Path(total_angle_rad=3.4, segments=segments, sections=SECTIONS),
        friction=plain,
        motion=JointMotion(names=("k", "m"), time_s=time_s, angle_rad=np.column_stack(swings)),
    )


class MovingPlant:
    """A rig at rest under a tension; `step` moves it on."""

    def __init__(self, rig: Transmission, tension_N: float, step_s: float, count: int) -> None:
        self.rig, self.h, self.count = rig, step_s, count
        self.sections = rig.path.sections
        self.touching = [k for k, section in enumerate(self.sections) if section.angle_rad > 0]
        n = count * len(self.touching)
        self.mu = np.repeat([self.sections[k].mu_dynamic or rig.friction.mu_dynamic for k in self.touching], count)
        share = np.repeat([self.sections[k].length_m or 0.0 for k in self.touching], count)
        share = share / share.sum()
        self.mass = np.array([rig.actuator.mass_kg, *(rig.tendon.mass_kg * share), rig.load.mass_kg])
        self.viscous = np.array(
            [rig.actuator.damping_N_s_per_m, *(rig.friction.viscous_N_s_per_m * share), rig.load.damping_N_s_per_m]
        )
        self.time, self.f_s, self.v = 0.0, np.zeros(n), np.zeros(n + 2)
        self.angle, self.length = self.geometry()
        self.total = sum(section.length_m or 0.0 for section in self.sections)
        self.theta = sum(section.angle_rad for section in self.sections)
        self.e = tension_N * self.length / self.total / rig.tendon.stiffness_N_per_m
        self.z, self.far = self.e.copy(), tension_N / rig.load.stiffness_N_per_m

    def geometry(self) -> tuple[Array, Array]:
        """Wrap angles of the pieces, and distances between the middles of neighbours, ends included."""
        motion = self.rig.motion
        assert motion is not None
        angles, places, at = [], [0.0], 0.0
        for k, section in enumerate(self.sections):
            q = 0.0
            if section.joint is not None:
                q = np.interp(self.time, motion.time_s, motion.angle_rad[:, motion.names.index(section.joint)])
            length = (section.length_m or 0.0) + section.length_per_rad_m * q
            if k in self.touching:
                angles += [max(section.angle_rad + section.angle_per_rad * q, 0.0) / self.count] * self.count
                places += [at + length * (j + 0.5) / self.count for j in range(self.count)]
            at += length
        return np.array(angles), np.diff([*places, at])

    def prepare(self) -> None:
        """Move the path to the end of the step; contact that is lost takes its bristle force along."""
        self.time += self.h
        angle, length = self.geometry()
        self.kept = self.f_s * np.minimum(angle / np.maximum(self.angle, 1e-12), 1.0)
        self.drift = (length - self.length) / self.h
        self.angle, self.length = angle, length
        self.sigma = self.rig.friction.soft_bristle_stiffness_N_per_m * angle / self.theta
        self.limit = np.maximum(np.tanh(self.mu * angle / 2), 1e-12)

    def balance(self, v: Array, force_N: float) -> tuple[Array, Array, tuple[Array, ...]]:
        """Residual of the momenta, its tridiagonal slope, and what the state becomes."""
        h, tendon, load = self.h, self.rig.tendon, self.rig.load
        tau, share = tendon.relaxation_time_s, self.total / self.length
        stiff, soft = share * tendon.stiffness_N_per_m, share * tendon.relaxing_stiffness_N_per_m
        rate = v[:-1] - v[1:] + self.drift
        e = self.e + h * rate
        z = (self.z + h / tau * e) / (1 + h / tau)
        free = stiff * e + soft * (e - z) + share * tendon.damping_N_s_per_m * rate
        f = np.maximum(free, 0.0)
        slope = (free > 0) * (stiff * h + soft * h / (1 + h / tau) + share * tendon.damping_N_s_per_m)
        f_n, inside = f[:-1] + f[1:], v[1:-1]
        push, drag = self.kept + h * self.sigma * inside, h * self.sigma * np.abs(inside) / self.limit
        f_s = push * f_n / (f_n + drag)
        by_v = h * self.sigma * (f_n - f_s * np.sign(inside) / self.limit) / (f_n + drag)
        by_n = push * drag / (f_n + drag) ** 2
        far = self.far + h * v[-1]
        residual = self.mass / h * (v - self.v) + self.viscous * v
        residual[0] -= force_N - f[0]
        residual[-1] -= f[-1] - load.stiffness_N_per_m * far
        residual[1:-1] -= f[:-1] - f[1:] - f_s
        band = np.zeros((3, len(v)))
        band[1] = self.mass / h + self.viscous
        band[1, 0] += slope[0]
        band[1, -1] += slope[-1] + load.stiffness_N_per_m * h
        band[1, 1:-1] += by_v + slope[:-1] * (1 - by_n) + slope[1:] * (1 + by_n)
        band[0, 1], band[2, -2] = -slope[0], -slope[-1]
        band[0, 2:] = -slope[1:] * (1 + by_n)
        band[2, :-2] = -slope[:-1] * (1 - by_n)
        return residual, band, (e, z, f_s, f, far)

    def step(self, force_N: float) -> float:
        """Output tension at the end of a step under a force."""
        self.prepare()
        v = self.v
        residual, band, state = self.balance(v, force_N)
        for _ in range(60):
            size = np.abs(residual).max()
            if size < 1e-9:
                break
            move, share = solve_banded((1, 1), band, -residual), 1.0
            while True:
                trial = self.balance(v + share * move, force_N)
                if np.abs(trial[0]).max() < size or share < 1e-6:
                    break
                share /= 2
            v = v + share * move
            residual, band, state = trial
        self.e, self.z, self.f_s, f, self.far = state
        self.v = v
        return float(f[-1])


def moving_output(rig: Transmission, force_N: Array, step_s: float, count: int) -> Array:
    """Output tension for a force at successive instants."""
    plant = MovingPlant(rig, float(force_N[0]), step_s, count)
    return np.array([force_N[0], *(plant.step(float(force)) for force in force_N[1:])])
