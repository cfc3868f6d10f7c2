"""A finger between tendons, written without the package's models: masses by their positions, explicit steps, NumPy.

Laws by hand: links f = max(k1 e + k2 (e - z) + c de/dt, 0), a bristle on each mass, bodies that
feel each section's local tension.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Strand:
    """A tendon: its masses, and how ends and sections follow motors and joints."""

    angle: Array  # shape (N,); of each mass at joint angle zero
    angle_by: Array  # shape (N, joints)
    length: Array  # shape (N + 1,); of each link, shares of the whole
    length_by: Array  # shape (N + 1, joints); [1/rad]
    gained_by: Array  # shape (N + 1, joints); [m/rad]
    piece: Array  # shape (N,); share of each mass in the length of all pieces
    winding: Array  # shape (motors,); [m/rad]
    far: Callable[[Array], float]  # far end's travel for joint angles [m]
    far_by: Callable[[Array], Array]  # its slopes [m/rad]
    tension: float  # at the start


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Of rope, friction and joints, alike for all."""

    mass: float
    k1: float
    k2: float
    tau: float
    c: float
    mu: float
    mu_static: float
    omega: float
    viscous: float
    bristle: float
    p: float
    inertia: float
    damping: float
    spring: float
    rest: float
    gravity: float
    zero: float
    low: float
    high: float
    stop: float
    coulomb: float
    dry: float


def respond(strands: list[Strand], n: Numbers, motor: Array, step: float, parts: int) -> Array:
    """Joint angles from rest at zero, rows as those of the motors, shape (rows, motors), straight in between."""
    joints = strands[0].angle_by.shape[1]
    q, w, dry = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    x, v, z, s, ends = [], [], [], [], []
    for t in strands:
        e = t.tension * t.length / n.k1
        place = t.far(q) + np.cumsum(e[::-1])[::-1]  # near end, then each mass
        ends.append(place[0] - 0.0)
        x.append(place[1:].copy())
        v.append(np.zeros(len(t.angle)))
        z.append(e.copy())
        s.append(np.zeros(len(t.angle)))
    out, h = [q.copy()], step / parts
    for row in range(len(motor) - 1):
        turning = (motor[row + 1] - motor[row]) / step
        for part in range(parts):
            at = motor[row] + turning * (part * h)
            torque = np.zeros(joints)
            for k, t in enumerate(strands):
                near, near_v = ends[k] + t.winding @ at, t.winding @ turning
                far_by = t.far_by(q)
                e = np.concatenate([[near], x[k]]) - np.concatenate([x[k], [t.far(q)]]) + t.gained_by @ q
                rate = np.concatenate([[near_v], v[k]]) - np.concatenate([v[k], [far_by @ w]]) + t.gained_by @ w
                stiffer = 1 / (t.length + t.length_by @ q)
                f = np.maximum(stiffer * (n.k1 * e + n.k2 * (e - z[k]) + n.c * rate), 0.0)
                torque += far_by * f[-1] - t.gained_by.T @ f
                angle = np.maximum(t.angle + t.angle_by @ q, 0.0)
                turned = np.where(t.angle + t.angle_by @ q > 0, t.angle_by @ w, 0.0)
                static, dynamic = np.tanh(n.mu_static * angle / 2), np.tanh(n.mu * angle / 2)
                mu = dynamic + (static - dynamic) * np.exp(-np.abs(v[k]) / n.omega)
                normal = np.maximum(f[:-1] + f[1:] + 2 * n.p, 1e-9)
                sigma = n.bristle * angle / t.angle.sum()
                rubbed = sigma * (v[k] - s[k] * np.abs(v[k]) / (np.maximum(mu, 1e-12) * normal))
                rubbed += s[k] * np.minimum(turned, 0.0) / np.maximum(angle, 1e-12)
                force = f[:-1] - f[1:] - s[k] - n.viscous * t.piece * v[k]
                z[k] = z[k] + h * (e - z[k]) / n.tau
                s[k] = s[k] + h * rubbed
                v[k] = v[k] + h * force / (n.mass * t.piece)
                x[k] = x[k] + h * v[k]
            held = n.damping * w + n.spring * (q - n.rest) + n.gravity * np.sin(q - n.zero) + dry
            held += n.stop * (np.maximum(q - n.high, 0.0) - np.maximum(n.low - q, 0.0))
            dry = dry + h * n.dry * (w - dry * np.abs(w) / n.coulomb)
            w = w + h * (torque - held) / n.inertia
            q = q + h * w
        out.append(q.copy())
    return np.array(out)
