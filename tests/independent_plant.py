"""A tendon on a drum, written without the package: another cut, another integrator, plain numpy and scipy.

`masses` lumps sit in the middle of equal pieces, so that the links at the ends are half as long; each link is a Zener
element, each lump slides on a Dahl bristle with the equivalent coefficient tanh(mu phi/2). LSODA integrates all states.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from tendonff.models.parameters import Transmission

BAND = 9
"""States of two neighbouring lumps: no further does one state act on another."""


@dataclass(frozen=True, kw_only=True)
class Response:
    """Rows at the times of the drive."""

    output_N: np.ndarray
    input_N: np.ndarray
    actuator_m: np.ndarray
    load_m: np.ndarray


def respond(
    rig: Transmission, time_s: np.ndarray, drive: np.ndarray, tension_N: float, *, masses: int = 24, position=False
) -> Response:
    """Response to a force [N], or to a servo's command relative to the start [m], linear between rows."""
    t, f, a, load = rig.tendon, rig.friction, rig.actuator, rig.load
    n = masses
    share = np.full(n + 1, float(n))
    share[[0, -1]] = 2.0 * n
    k1, k2, c = (share * x for x in (t.stiffness_N_per_m, t.relaxing_stiffness_N_per_m, t.damping_N_s_per_m))
    phi, sigma = rig.path.total_angle_rad / n, f.soft_bristle_stiffness_N_per_m / n
    mu_pull, mu_back = (np.tanh(0.5 * mu * phi) for mu in (f.mu_dynamic, f.release_dynamic))
    assert f.mu_static == f.mu_dynamic  # no Stribeck effect here
    rubs = bool(a.coulomb_N)  # a Dahl bristle of its own, with a constant friction of slip
    servo = a.servo_stiffness_N_per_m if position else 0.0
    stretch = tension_N / k1
    q_load = tension_N / load.stiffness_N_per_m
    q_start = q_load + stretch[::-1].cumsum()[::-1]
    q0 = np.append(q_start, q_load)  # positions: actuator, lumps, load

    def split(x):
        q, v, rest = x[: n + 2], x[n + 2 : 2 * n + 4], x[2 * n + 4 :]
        return q, v, rest[: n + 1], rest[n + 1 : 2 * n + 1]

    def tensions(q, v, z):
        e, rate = q[:-1] - q[1:], v[:-1] - v[1:]
        return np.maximum(k1 * e + k2 * (e - z) + c * rate, 0.0), e

    def rate(now, x):
        q, v, z, bristle = split(x)
        f_link, e = tensions(q, v, z)
        given = np.interp(now, time_s, drive)
        pull = servo * (given + tension_N / servo - (q[0] - q0[0])) if position else given
        normal = np.maximum(f_link[:-1] + f_link[1:] + 2 * f.adhesion_N, 1e-6)
        w = v[1:-1]
        mu = np.where(w > 0, mu_pull, mu_back)
        dv = np.empty(n + 2)
        dry = x[-1] if rubs else 0.0
        dv[0] = (pull - f_link[0] - a.damping_N_s_per_m * v[0] - dry) / a.mass_kg
        dv[1:-1] = (f_link[:-1] - f_link[1:] - bristle - f.viscous_N_s_per_m / n * w) / (t.mass_kg / n)
        dv[-1] = (f_link[-1] - load.stiffness_N_per_m * q[-1] - load.damping_N_s_per_m * v[-1]) / load.mass_kg
        slip = sigma * (w - bristle * np.abs(w) / (normal * np.maximum(mu, 1e-9)))
        own = [n * sigma * (v[0] - dry * abs(v[0]) / a.coulomb_N)] if rubs else []
        return np.concatenate([v, dv, (e - z) / t.relaxation_time_s, slip, own])

    start = np.concatenate([q0, np.zeros(n + 2), stretch, np.zeros(n), np.zeros(int(rubs))])
    # States that act on one another side by side, from the actuator to the load: the Jacobian is a band.
    places = [np.arange(n + 2), np.arange(n + 2), np.arange(n + 1) + 0.5, np.arange(1, n + 1), np.zeros(int(rubs))]
    order = np.argsort(np.concatenate(places), kind="stable")
    back = np.argsort(order)
    found = solve_ivp(
        lambda now, x: rate(now, x[back])[order],
        (0, time_s[-1]),
        start[order],
        method="LSODA",
        t_eval=time_s,
        rtol=1e-6,
        atol=1e-9,
        max_step=5e-3,
        lband=BAND,
        uband=BAND,
    )
    assert found.success, found.message
    states = found.y[back]
    rows = [split(x) for x in states.T]
    ends = np.array([tensions(q, v, z)[0][[0, -1]] for q, v, z, _ in rows])
    return Response(
        output_N=ends[:, 1],
        input_N=ends[:, 0],
        actuator_m=states[0] - q0[0],
        load_m=states[n + 1] - q0[-1],
    )
