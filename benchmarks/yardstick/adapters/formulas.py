"""Laws used without a simulator: the capstan formula, and one play (backlash) operator over the total angle.

Both know the first guide's friction and the whole wrap angle, and nothing of bearings, direction, seals or places.
"""

import numpy as np

from benchmarks.yardstick.case import Array, Case


def total_exponent(case: Case) -> Array:
    """Mu times the total wrap angle on each row."""
    guide = next(s for s in case.path if s.bearing is None)
    joint = case.course("joint") if "joint" in case.raw else np.zeros(len(case.time_s))
    mu = guide.mu if guide.mu_release is None else (guide.mu + guide.mu_release) / 2
    bends = sum(s.angle_per_rad for s in case.path if s.joint)
    total: Array = mu * (sum(s.angle_rad for s in case.path) + bends * joint)
    return total


def outputs_of(case: Case, near: Array, far: Array) -> dict[str, Array]:
    """Outputs of both tensions, with the far one at every joint."""
    arms = np.array([s.arm_m for s in case.path])
    return {"near_tension_N": near, "far_tension_N": far, "joint_torque_N_m": far[:, None] * arms}


def driven_ends(case: Case) -> tuple[Array, Array] | None:
    """Tensions given to the near and the far end; None where the case gives other things."""
    if case.kind != "tendon" or not {*case.raw["outputs"]} <= {"near_tension_N", "far_tension_N", "joint_torque_N_m"}:
        return None
    near, far = (case.drive(end, "tension_N") for end in ("near", "far"))
    return None if (np.isnan(near) & np.isnan(far)).any() else (near, far)


def capstan(case: Case) -> dict[str, Array] | None:
    """T e^(-+ mu theta), its sign that of the change of the tension that drives."""
    if case.kind == "slider":
        return {"unstable": np.zeros(len(case.raw["speeds_m_per_s"]))}
    if (driven := driven_ends(case)) is None:
        return None
    near, far = driven
    given = np.where(np.isnan(near), far, near)
    way = np.sign(np.gradient(given))
    passive = given * np.exp(-way * total_exponent(case))
    return outputs_of(case, np.where(np.isnan(near), passive, near), np.where(np.isnan(near), far, passive))


def play(case: Case) -> dict[str, Array] | None:
    """Play of half-width mu theta on ln T."""
    if case.kind == "slider":
        return {"unstable": np.zeros(len(case.raw["speeds_m_per_s"]))}
    if (driven := driven_ends(case)) is None:
        return None
    near, far = (each.copy() for each in driven)
    passive = case.raw["start_N"]
    was_near = True
    for k, r in enumerate(total_exponent(case)):
        drives = not np.isnan(driven[0][k])
        if drives != was_near:
            passive, was_near = near[k - 1] if was_near else far[k - 1], drives
        given = near[k] if drives else far[k]
        passive = min(max(passive, given * np.exp(-r)), given * np.exp(r))
        (far if drives else near)[k] = passive
    return outputs_of(case, near, far)
