"""Preview against a rate limit: the force sets out before the exact inverse asks for it.

At a reversal the exact force changes faster than the actuator can, and the output stands still until the force has
arrived. With preview the inverse runs ahead of the time that its forces are due at, so that what cannot be reached in
time is seen. The force then leaves its course at once, at the largest rate, and the output stands still before the
reference turns as well as after. Before that the force goes beyond its course for a moment, so that the output stands
between the level that it set out from and the one at which the reference turns.
"""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.base import FloatArray
from tendonff.ocp.tracking.limits import ForceLimits

SLACK = 1 / 16
"""Part of the largest change a sample by which a ramp under way may be early: rounding must not end it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """How far ahead the inverse runs, and what is made of it."""

    samples: int  # samples between the newest force of the inverse and the one that is due, >= 1
    # where the output stands, on the way from the level that the force sets out from (0) to the turn (1) [-]
    overshoot: float

    def apply(
        self, force_N: FloatArray, tension_N: FloatArray, limits: ForceLimits, step_s: float, start_N: float
    ) -> FloatArray:
        """Force within the limits, late by `samples` [N].

        Parameters
        ----------
        force_N, tension_N : ndarray, shape (n,)
            Exact force, and the tension that it gives [N].
        start_N : float
            Tension at rest before [N].
        """
        change = limits.rate_N_per_s * step_s
        now = limits.start(start_N)
        before = np.full(self.samples, start_N)
        forces = np.concatenate([np.full(self.samples, now), np.clip(force_N, limits.minimum_N, limits.maximum_N)])
        tensions = np.concatenate([before, tension_N])
        reach = change * np.arange(1, self.samples + 2)
        side, level, lifting = 0.0, 0.0, False
        found = []

        def out_of_reach(direction: float, slack_N: float) -> int:
            """Samples until the first force that cannot be reached in time; 0 for none."""
            missed = direction * (coming - now) > reach - slack_N
            return int(np.argmax(missed)) + 1 if missed.any() else 0

        for k in range(len(force_N)):
            coming, wanted = forces[k : k + self.samples + 1], tensions[k : k + self.samples + 1]
            due, tension = float(coming[0]), float(wanted[0])
            if side and not out_of_reach(side, SLACK * change):
                side = 0.0
            if not side:
                down, up = out_of_reach(-1.0, 0.0), out_of_reach(1.0, 0.0)
                if down or up:
                    side = -1.0 if down and (not up or down < up) else 1.0
                    rest = float(np.max(-side * (wanted[: down if side < 0 else up] - tension)))
                    level, lifting = tension - side * self.overshoot * rest, rest > 0
            asked = due
            if side:
                beyond = -side * (level - tension) > 0 and -side * (due * (level / tension) - now) > 0
                lifting = lifting and beyond
                asked = now + (-side if lifting else side) * change
            now = min(max(asked, limits.minimum_N, now - change), limits.maximum_N, now + change)
            found.append(now)
        return np.array(found)
