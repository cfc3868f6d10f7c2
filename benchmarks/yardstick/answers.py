"""The exact answers: closed forms of quasi-static Coulomb friction along a wrapped tendon, in numpy alone.

Positive is towards the near end, which pulls. A path has P(s) and R(s), the exponents of slip in full from the near end
to a place s, pulling and releasing; y = ln(T + p), with p the friction that does not depend on load.
"""

import numpy as np

from benchmarks.yardstick.brute import coulomb_run, presliding_run, relaxing_run
from benchmarks.yardstick.case import Array, Case

CELLS = 400
SLACK_LN = -40.0


def answer(case: Case) -> dict[str, Array]:
    """Required outputs of a case."""
    return _ANSWERS[case.raw["answer"]](case)


class Cones:
    """The profile of tension along a path whose ends act: each opens a cone that bounds it.

    A fixed path under quasi-static Coulomb friction remembers exactly its profile: y(s) is clipped between
    y(near) - P(s) and y(near) + R(s) when the near end acts, and between the mirror images when the far end does.
    """

    def __init__(self, case: Case) -> None:
        share = np.array([section.length_m for section in case.path])
        edges = np.concatenate([[0.0], np.cumsum(share / share.sum())])
        exponents = np.array([section.exponents for section in case.path])
        steps = [np.concatenate([[0.0], np.cumsum(column)]) for column in exponents.T]
        self.s = np.union1d(np.linspace(0.0, 1.0, CELLS + 1), edges)
        self.pull, self.release = (np.interp(self.s, edges, step) for step in steps)
        self.borders = np.searchsorted(self.s, edges[1:])
        self.p, self.k = case.raw.get("adhesion_N", 0.0), case.raw["stiffness_N_per_m"]
        self.y = np.full(len(self.s), self.log(case.raw["start_N"]))

    def log(self, tension_N: float) -> float:
        """ln(T + p), with a floor for slack."""
        return float(np.log(max(tension_N + self.p, np.exp(SLACK_LN))))

    def near(self, y: float, profile: Array) -> Array:
        """The profile after the near end took y."""
        return np.clip(profile, y - self.pull, y + self.release)

    def far(self, y: float, profile: Array) -> Array:
        """The profile after the far end took y."""
        return np.clip(profile, y - (self.release[-1] - self.release), y + (self.pull[-1] - self.pull))

    def elongation_m(self, profile: Array) -> float:
        """Elongation of the whole tendon."""
        tension = np.exp(profile) - self.p
        return float(np.sum((tension[1:] + tension[:-1]) / 2 * np.diff(self.s)) / self.k)

    def stretch_far(self, elongation_m: float, low: float, high: float) -> Array:
        """The profile in which the far end has taken what gives an elongation, which rises with it: regula falsi."""
        ends, values = [low, high], [self.elongation_m(self.far(y, self.y)) - elongation_m for y in (low, high)]
        if values[0] >= 0 or values[1] <= 0:
            return self.far(low if values[0] >= 0 else high, self.y)
        y, side = low, 0
        for _ in range(100):
            y = (ends[0] * values[1] - ends[1] * values[0]) / (values[1] - values[0])
            miss = self.elongation_m(self.far(y, self.y)) - elongation_m
            if abs(miss) < 1e-12:
                break
            now = int(miss > 0)
            ends[now], values[now] = y, miss
            if now == side:  # Illinois rule: else one end would never move
                values[1 - now] /= 2
            side = now
        return self.far(y, self.y)


def cones(case: Case) -> dict[str, Array]:
    """Tensions and elongations of a path between two ends."""
    path, rows = Cones(case), []
    near, far = (case.drive(end, "tension_N") for end in ("near", "far"))
    travel = case.drive("far", "travel_m")
    taut = path.elongation_m(path.y)  # by the ends alone, negative while slack
    for k in range(len(case.time_s)):
        if not np.isnan(near[k]):
            path.y = path.near(path.log(near[k]), path.y)
        if not np.isnan(far[k]):
            path.y = path.far(path.log(far[k]), path.y)
        moved = 0.0 if k == 0 or np.isnan(travel[k]) else travel[k] - travel[k - 1]
        if moved and not np.isnan(near[k]):  # what the stuck part between the two cones does not let through
            low, high = path.y[0] - path.pull[-1], path.y[0] + path.release[-1]
            path.y = path.stretch_far(path.elongation_m(path.y) - moved, low, high)
        elif moved:
            taut -= moved
            around = path.y[-1] if path.y[-1] > 0 else 0.0
            low = around - 1.0 if taut > 0 and path.y[-1] > 0 else SLACK_LN
            path.y = path.stretch_far(max(taut, 0.0), low, around + 1.0)
        rows.append(np.append(path.y, path.elongation_m(path.y)))
    found = np.array(rows)
    tension = np.maximum(np.exp(found[:, :-1]) - path.p, 0.0)
    arms = np.array([section.arm_m for section in case.path])
    return {
        "near_tension_N": tension[:, 0],
        "far_tension_N": tension[:, -1],
        "near_travel_m": found[:, -1] - found[0, -1],
        "joint_torque_N_m": tension[:, path.borders] * arms,
    }


def loop(case: Case) -> dict[str, Array]:
    """A pre-tensioned loop in gross sliding one way: T1 phi(a) + T2 phi(-a) = 2 T, T1 - T2 = D, at the joint.

    phi(a) = (e^a - 1)/a is the elongation of a tendon that is pulled over what its tension at the joint alone would
    cause. Without load the joint lags the drum by (T/k) tanh(a/2); a taut loop takes D + 2 a T, a slack one D e^a.
    """
    raw = case.raw
    a, T, k, r = raw["exponent"], raw["pretension_N"], raw["stiffness_N_per_m"], raw["radius_m"]
    up, down = np.expm1(a) / a, -np.expm1(-a) / a
    motor = case.course("motor")
    forward = np.sign(np.gradient(motor, case.time_s))
    spring = raw["joint_stiffness_N_m_per_rad"] / r**2  # D over the joint's travel
    if spring == 0.0:
        return {"joint_rad": motor - forward * (T / k) * np.tanh(a / 2) / r}
    travel = motor * r  # forward, from rest: y = X - elongation of the pulling tendon
    # T1 = (2 T + D phi(-a))/(phi(a) + phi(-a)), until T2 = T1 - D is nought
    taut_y = (travel + T / k - 2 * T * up / ((up + down) * k)) / (1 + spring * up * down / ((up + down) * k))
    slack_y = (travel + T / k) / (1 + spring * up / k)
    slack = taut_y * spring > 2 * T / up
    y = np.where(slack, slack_y, taut_y)
    D = spring * y
    return {"joint_rad": y / r, "drive_N": np.where(slack, D * np.exp(a), D + 2 * a * T), "slack": slack.astype(float)}


def slider(case: Case) -> dict[str, Array]:
    """A mass between two springs that move at a steady speed: where steady sliding does not stay steady.

    Its normal force stays f_1 + f_2 = 2 T. With friction g(v) = 2 T tanh(mu(v) phi/2) and a bristle sigma the motion
    near steady sliding obeys m s^2 + b s + 2 K + s g' c/(s + c) = 0, c = sigma V/g: stable if both roots of it are.
    """
    raw, found = case.raw, []
    for V in raw["speeds_m_per_s"]:
        bars = [np.tanh(raw[name] * raw["angle_rad"] / 2) for name in ("mu_dynamic", "mu_static")]
        fall = (bars[1] - bars[0]) * np.exp(-V / raw["stribeck_velocity_m_per_s"])
        g = 2 * raw["tension_N"] * (bars[0] + fall)
        slope = -2 * raw["tension_N"] * fall / raw["stribeck_velocity_m_per_s"]
        c, m, b, K = raw["bristle_N_per_m"] * V / g, raw["mass_kg"], raw["viscous_N_s_per_m"], raw["spring_N_per_m"]
        poles = np.roots([m, b + c * m, 2 * K + b * c + slope * c, 2 * K * c])
        found.append(float(poles.real.max() > 0))
    return {"unstable": np.array(found)}


_ANSWERS = {
    "cones": cones,
    "relaxation": relaxing_run,
    "loop": loop,
    "slider": slider,
    "coulomb": coulomb_run,
    "presliding": presliding_run,
}
