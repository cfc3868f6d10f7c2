"""A tendon on a drum, written without the package: another cut, another integrator, plain numpy and scipy.

`masses` lumps sit in the middle of equal pieces, so that the links at the ends are half as long; each link is a Zener
element, each lump slides on a Dahl bristle with the equivalent coefficient tanh(mu phi/2). LSODA integrates all states.
"""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from scipy.integrate import odeint

from tendonff.models.parameters import Transmission


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
    mu_pull, mu_back = (max(np.tanh(0.5 * mu * phi), 1e-9) for mu in (f.mu_dynamic, f.release_dynamic))
    assert f.mu_static == f.mu_dynamic  # no Stribeck effect here
    lost = 0.0 if a.gear_efficiency is None else 1 - a.gear_efficiency  # of what the tendon takes
    rubs = bool(a.coulomb_N) or lost > 0  # a Dahl bristle of its own
    servo = a.servo_stiffness_N_per_m if position else 0.0
    stretch = tension_N / k1
    q_load = tension_N / load.stiffness_N_per_m
    q0 = np.append(q_load + stretch[::-1].cumsum()[::-1], q_load)  # positions: actuator, lumps, load
    times, given = time_s.tolist(), np.asarray(drive, dtype=float).tolist()
    slopes = [*(np.diff(drive) / np.diff(time_s)).tolist(), 0.0]

    def tensions(q, v, z):
        e = q[:-1] - q[1:]
        return np.maximum(k1 * e + k2 * (e - z) + c * (v[:-1] - v[1:]), 0.0), e

    # Side by side of each body: position, speed, bristle (of the drive at the actuator, none at the load), and the
    # relaxed elongation of the link behind it. So the Jacobian is a band.
    def rate(now, x):
        q, v, bristle, z = x[0::4], x[1::4], x[6::4], x[3::4]
        f_link, e = tensions(q, v, z)
        row = max(bisect_right(times, now) - 1, 0)
        wanted = given[row] + slopes[row] * (now - times[row])
        pull = servo * (wanted + tension_N / servo - (q[0] - q0[0])) if position else wanted
        w, dry = v[1:-1], x[2]
        normal = np.maximum(f_link[:-1] + f_link[1:] + 2 * f.adhesion_N, 1e-6)
        limit = normal * np.where(w > 0, mu_pull, mu_back)
        if f.load_exponent:
            limit = limit * (normal / (2 * f.reference_tension_N)) ** -f.load_exponent
        found = np.empty(len(x))
        found[0::4], found[3::4], dv = v, (e - z) / t.relaxation_time_s, found[1::4]
        dv[0] = (pull - f_link[0] - a.damping_N_s_per_m * v[0] - dry) / a.mass_kg
        dv[1:-1] = (f_link[:-1] - f_link[1:] - bristle - f.viscous_N_s_per_m / n * w) / (t.mass_kg / n)
        dv[-1] = (f_link[-1] - load.stiffness_N_per_m * q[-1] - load.damping_N_s_per_m * v[-1]) / load.mass_kg
        found[6::4] = sigma * (w - bristle * np.abs(w) / limit)
        most = (a.coulomb_N or 0.0) + lost * f_link[0]
        found[2] = n * sigma * (v[0] - dry * abs(v[0]) / max(most, 1e-6)) if rubs else 0.0
        return found

    assert time_s[0] == 0.0
    start = np.zeros(4 * n + 6)
    start[0::4], start[3::4] = q0, stretch
    states, report = odeint(
        rate,
        start,
        time_s,
        tfirst=True,
        ml=6,
        mu=4,
        rtol=1e-6,
        atol=1e-9,
        hmax=5e-3,
        mxstep=100_000,
        full_output=True,
    )
    assert report["message"] == "Integration successful.", report["message"]
    q, v, z = (states.T[first::4] for first in (0, 1, 3))
    ends = np.array([tensions(*columns)[0][[0, -1]] for columns in zip(q.T, v.T, z.T, strict=True)])
    return Response(output_N=ends[:, 1], input_N=ends[:, 0], actuator_m=q[0] - q0[0], load_m=q[-1] - q0[-1])
