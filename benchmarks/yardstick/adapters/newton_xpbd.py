"""Newton's massless tendon through frictional pinholes (XPBD on the CPU), both ends led.

An end that is given a tension is led by what the tension of its span lacks; what it then had is recorded, and judged is
the answer to that.
"""

import math
from typing import Any

import newton
import numpy as np
import warp as wp

from benchmarks.yardstick.brute import LedContacts
from benchmarks.yardstick.case import Array, Case

PINHOLES, FINE_PINHOLES, SPAN_M, ROW_S = 9, 25, 0.05, 2e-3
SETTLE_TOL, DEFAULT_SETTLE_TOL = 1e-6, 1e-3  # of the tension, at which XPBD stops relaxing the tendon in a step
SEEDS, TRAVELS = 11, (-0.65, 0.9)  # random histories; their travels, over the elongation at the start


class Rig:
    """A tendon between two led ends, bent by the same angle at each pinhole; half a span at each end."""

    def __init__(
        self,
        angle_rad: float,
        mu: float,
        stiffness_N_per_m: float,
        start_N: float,
        pinholes: int,
        settle_tol: float = SETTLE_TOL,
    ) -> None:
        wp.config.quiet = True
        self.spans, bend = pinholes + 1, angle_rad / pinholes
        heading = np.arange(self.spans) * bend
        share = np.r_[0.5, np.ones(pinholes - 1), 0.5]
        steps = SPAN_M * share[:, None] * np.column_stack([np.cos(heading), 0 * heading, np.sin(heading)])
        self.points = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        self.out = {"near": -2 * steps[0] / SPAN_M, "far": 2 * steps[-1] / SPAN_M}
        self.compliance = share / (stiffness_N_per_m * pinholes)
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, 0.0))
        places = {"near": self.points[0], "far": self.points[-1], "guide": np.zeros(3)}
        self.body = {}
        for name, place in places.items():
            body = builder.add_body(xform=wp.transform(p=wp.vec3(*map(float, place))), mass=0.0, is_kinematic=True)
            self.body[name] = body
        kinds = newton.TendonGuideType
        rest = SPAN_M * share - start_N * self.compliance
        spans = [{"compliance": float(c), "rest_length": float(r)} for c, r in zip(self.compliance, rest, strict=True)]
        route = [newton.TendonGuide(body=self.body["near"], guide_type=kinds.ANCHOR, axis=(0.0, 1.0, 0.0))]
        for point, span in zip(self.points[1:-1], spans, strict=False):
            place = tuple(map(float, point))
            guide = {"guide_type": kinds.PINHOLE, "mu": mu, "offset": place, "axis": (0.0, 1.0, 0.0)}
            route.append(newton.TendonGuide(body=self.body["guide"], **guide, **span))
        route.append(
            newton.TendonGuide(body=self.body["far"], guide_type=kinds.ANCHOR, axis=(0.0, 1.0, 0.0), **spans[-1])
        )
        builder.add_tendon(route)
        with wp.ScopedDevice("cpu"):
            self.model = builder.finalize()
            self.solver = newton.solvers.SolverXPBD(self.model, tendon_settle_tol=settle_tol)
            self.states = [self.model.state(), self.model.state()]
            self.control = self.model.control()
        self.start, self.place = places, {"near": 0.0, "far": 0.0}

    def step(self) -> Array:
        """Lead the ends to their places, positive outwards, and return the tension of each span [N]."""
        now, after = self.states
        with wp.ScopedDevice("cpu"):
            poses = now.body_q.numpy()
            for name, outwards in self.out.items():
                poses[self.body[name], :3] = self.start[name] + outwards * self.place[name]
            now.body_q.assign(poses)
            now.clear_forces()
            self.solver.step(now, after, self.control, None, ROW_S)
            self.states = [after, now]
            left, right = (
                getattr(self.solver, f"tendon_segment_attachment_{side}").numpy().astype(float) for side in "lr"
            )
            rest = self.solver.tendon_segment_rest_length.numpy().astype(float)
        tension: Array = np.maximum(np.linalg.norm(right - left, axis=1) - rest, 0.0) / self.compliance
        return tension


def answer(case: Case) -> tuple[dict[str, Array], dict[str, Array]] | None:
    """Outputs of a case and the tensions that its ends had; None where the tendon of Newton has no such physics."""
    plain = case.kind == "tendon" and "joint" not in case.raw and "relaxing_stiffness_N_per_m" not in case.raw
    if not plain or any(s.bearing is not None for s in case.path):
        return None
    pinholes = FINE_PINHOLES if len(case.path) == 1 else round(sum(s.angle_rad for s in case.path) / 0.1)
    guide, angle = case.path[0], sum(s.angle_rad for s in case.path)
    mu = guide.mu if guide.mu_release is None else (guide.mu + guide.mu_release) / 2
    rig = Rig(angle, mu, case.raw["stiffness_N_per_m"], case.raw["start_N"], pinholes)
    given = {(end, q): case.drive(end, q) for end in ("near", "far") for q in ("tension_N", "travel_m")}
    sign, at = {"near": 1, "far": -1}, {"near": 0, "far": -1}
    tension, rows, travel = rig.step(), [], []
    for k in range(len(case.time_s)):
        for end in ("near", "far"):
            if not np.isnan(given[end, "tension_N"][k]):
                rig.place[end] += (given[end, "tension_N"][k] - tension[at[end]]) * rig.compliance[at[end]]
            elif not np.isnan(given[end, "travel_m"][k]):
                rig.place[end] = sign[end] * given[end, "travel_m"][k]
        tension = rig.step()
        rows.append(tension)
        travel.append(rig.place["near"])
    found = np.array(rows)
    edges = np.cumsum([s.angle_rad for s in case.path])
    behind = [math.floor(edge / edges[-1] * (rig.spans - 1) + 0.5) for edge in edges]
    recorded = {end: found[:, at[end]] for end in ("near", "far") if not np.isnan(given[end, "tension_N"]).all()}
    outputs = {
        "near_tension_N": found[:, 0],
        "far_tension_N": found[:, -1],
        "near_travel_m": np.array(travel) - travel[0],
        "joint_torque_N_m": found[:, behind] * [s.arm_m for s in case.path],
    }
    return outputs, recorded


def history(
    *,
    mu: float = 0.2,
    pinholes: int = PINHOLES,
    stiffer: float = 1.0,
    both: bool = False,
    settle_tol: float = SETTLE_TOL,
    seed: int = 0,
) -> tuple[float, float]:
    """RMS and largest error of the far tension in a random history, against the exact static law [% of range].

    Ramps of 0.25 s to random travels of the near end, and 0.4 times as far of the far end, that never leave the tendon
    slack; over pi rad. The law has the same pinholes and the same travels of both ends.
    """
    stiffness, start, rng = 2e4 * stiffer, 30.0, np.random.default_rng(seed)
    times = np.linspace(0.0, 3.0, 13)
    t = np.arange(round(times[-1] / ROW_S) + 1) * ROW_S
    ways = [np.interp(t, times, np.append(0.0, rng.uniform(*TRAVELS, 12))) * start / stiffness for _ in range(2)]
    rig, law = Rig(math.pi, mu, stiffness, start, pinholes, settle_tol), LedContacts(mu * math.pi, pinholes)
    rig.step()
    found, exact = [], []
    for near, far in zip(ways[0], 0.4 * both * ways[1], strict=True):
        rig.place = {"near": float(near), "far": float(far)}
        found.append(rig.step()[-1])
        led = np.r_[near, np.zeros(pinholes - 1), far]
        exact.append(law.balance(start + led / rig.compliance, 1 / rig.compliance)[-1])
    error = 100 * np.abs(np.subtract(found, exact)) / np.ptp(exact)
    return float(np.sqrt(np.mean(error**2))), float(np.max(error))


def main() -> None:
    """Print the errors of random histories in five settings, at two tolerances [% of range]."""
    tolerances = (DEFAULT_SETTLE_TOL, SETTLE_TOL)
    print(f"RMS error of {SEEDS} random histories, % of range: median (quartiles), and median of the largest errors")
    print("| |" + "".join(f" at {tol:g} | largest |" for tol in tolerances) + "\n|---" + "|---" * 4 + "|")
    for name, setting in SETTINGS.items():
        cells = []
        for tol in tolerances:
            found = [history(seed=seed, settle_tol=tol, **setting) for seed in range(SEEDS)]
            (rms, top), (low, _), (high, _) = (np.percentile(found, share, axis=0) for share in (50, 25, 75))
            cells.append(f"{rms:.2g} ({low:.2g} to {high:.2g}) | {top:.2g}")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


SETTINGS: dict[str, dict[str, Any]] = {
    "9 pinholes": {},
    "both ends moved": {"both": True},
    "25 pinholes": {"pinholes": 25},
    "mu theta 1.26": {"mu": 0.4},
    "ten times stiffer": {"stiffer": 10.0},
}

if __name__ == "__main__":
    main()
