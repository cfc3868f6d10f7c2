"""A start for the search where the actuator's motion is limited: its end is led along by a stiff spring.

Searched is the drive k x_c1 of that spring. There a limit of the speed is one of a rate, which bounds the knots
directly, and the output follows the position smoothly where by the force it sticks and slips; so few iterations do.
"""

import math
from dataclasses import replace

import numpy as np

from tendonff.ocp.inverse import Inversion
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import INSIDE
from tendonff.ocp.tracking.problem import MotionBound, TrackingProblem, TrackOptions
from tendonff.ocp.tracking.search.grids import GridRefinement
from tendonff.ocp.tracking.search.receding_horizon import solve

_LEAD = 300.0  # stiffness of the leading spring over that of tendon and load in series
_CORNER_S = 0.008  # half the time in which the end may change its speed at a limit
_FREE = 100.0  # times what the inverse needs: no limit


def led_force(
    problem: TrackingProblem, inversion: Inversion, options: TrackOptions
) -> tuple[Array, tuple[GridRefinement, ...]]:
    """The force that moves the nominal plant's end along the best motion within its limits.

    Its rate is not limited yet. Also the search in each window. SolveError if a simulation fails.
    """
    plant, limits, step_s = problem.plants[0], problem.limits, problem.step_s
    free = simulate(plant.chain, inversion.force_N, step_s, state=plant.state).require()
    lead = _LEAD * problem.rest_N / plant.origin_m
    chain = plant.chain.with_end_stiffness(lead, plant.chain.far.stiffness_N_per_m)
    drive = inversion.force_N + lead * free.near_position_m
    drive[0] = problem.start_N + lead * plant.state.near_position_m
    span, rate = float(np.ptp(drive)), float(np.max(np.abs(np.diff(drive)))) / step_s
    speed, at_rest = limits.motion.speed_m_per_s * (1 - INSIDE), lead * plant.origin_m
    of_spring = (
        *(
            replace(bound, per_travel_per_m=-lead, low=bound.low + at_rest, high=bound.high + at_rest)
            if bound.per_force
            else bound
            for bound in plant.bounds
            if bound.per_force or bound.per_travel_per_m
        ),
        MotionBound(
            per_force=1.0,
            per_travel_per_m=-lead,
            low=limits.minimum_N + at_rest,
            high=limits.maximum_N + at_rest,
            newtons=1.0,
        ),
    )
    led = replace(
        problem,
        plants=(replace(plant, chain=chain, bounds=of_spring, static=replace(plant.static, weight=0.0)),),
        limits=ForceLimits(
            minimum_N=float(drive.min()) - _FREE * span,
            maximum_N=float(drive.max()) + _FREE * span,
            rate_N_per_s=lead * speed if math.isfinite(speed) else _FREE * rate,
        ),
        start_N=float(drive[0]),
        goal=replace(problem.goal, effort_weight=0.0, travel_weight=0.0),
    )
    found, searches = solve(led, (drive,), replace(options, restarts=0))
    found = _rounded_off(found, step_s)
    run = simulate(chain, found, step_s, state=plant.state).require()
    return found - lead * run.near_position_m, searches


def _rounded_off(drive_N: Array, step_s: float) -> Array:
    """The drive without the corners of a limited rate, where the mass would need an impulse; its start stays."""
    rows = max(round(_CORNER_S / step_s), 1)
    box = np.full(2 * rows + 1, 1 / (2 * rows + 1))
    for _ in range(2):
        rest = np.pad(drive_N, (rows, 0), mode="reflect", reflect_type="odd")
        drive_N = np.convolve(np.pad(rest, (0, rows), mode="edge"), box, "valid")
    return drive_N
