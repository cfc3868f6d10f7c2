"""A hand's joint in use: random moves under loads that change, and pushes against the stop now and then."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.identification.motors.numbers import Values, put_into
from tendonff.compensator.identification.parameters import Parameter
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.fits.mechanism import Loop, MotorRun, respond
from tests.hidden_loop import COUNT_RAD, CURRENT_NOISE_A, TORQUE_CONSTANT

Array = NDArray[np.float64]
ROW_S = 1e-2


@dataclass(frozen=True, kw_only=True)
class HandInUse:
    """Logs of use.

    Attributes
    ----------
    mechanism : Mechanism
        As it is in the first minutes.
    pushes : float
        Share of the moves that go on against the stop.
    slip_rad : float
        Way of the motor in which friction of its gear builds up.
    """

    mechanism: Mechanism
    pushes: float = 0.08
    slip_rad: float = 2e-3

    def moves(self, draw: np.random.Generator, seconds: float) -> Array:
        """Motor angles every `ROW_S`."""
        stop = self.mechanism.joint.stop_high_rad or 1.2
        times, places = [0.0], [0.0]
        while times[-1] < seconds:
            kind = draw.random()
            if kind < 0.2:
                times.append(times[-1] + draw.uniform(0.2, 1.5))
                places.append(places[-1])
                continue
            to = stop + draw.uniform(0.25, 0.4) if kind > 1 - self.pushes else draw.uniform(-0.1, stop - 0.2)
            times.append(times[-1] + max(0.4, abs(to - places[-1]) / draw.uniform(0.5, 2.0)))
            places.append(to)
        fine = np.arange(0.0, seconds, ROW_S)
        ends, at = np.array(times), np.array(places)
        k = np.clip(np.searchsorted(ends, fine, side="right") - 1, 0, len(ends) - 2)
        s = np.clip((fine - ends[k]) / (ends[k + 1] - ends[k]), 0, 1)
        found: Array = at[k] + (at[k + 1] - at[k]) * s**3 * (10 - 15 * s + 6 * s * s)
        return found

    def log(self, seed: int, seconds: float, changed: Values | None = None) -> dict[str, FloatArray]:
        """Columns of a log; the load is drawn anew."""
        draw = np.random.default_rng(seed)
        factors = {n: n.of(self.mechanism) * factor for n, factor in (changed or {}).items()}
        true = put_into(self.mechanism, {**factors, Parameter.GRAVITY: draw.uniform(0.005, 0.04)})
        return self.measured(true, self.moves(draw, seconds), draw)

    def measured(self, true: Mechanism, motor: Array, draw: np.random.Generator) -> dict[str, FloatArray]:
        """Columns of a log of motor angles every `ROW_S`."""
        run = MotorRun.of_one(motor, ROW_S, 0.0)
        answer = respond(Loop(mechanism=true, slip_rad=self.slip_rad), run, segments=16, refinement=2)
        noise = CURRENT_NOISE_A * draw.standard_normal(len(motor))
        return {
            "time_s": ROW_S * np.arange(len(motor)),
            "motor_rad": np.round(motor / COUNT_RAD) * COUNT_RAD,
            "motor_current_A": answer.torque_N_m[:, 0] / TORQUE_CONSTANT + noise,
        }


def known(mechanism: Mechanism) -> Mechanism:
    """Mechanism as an identification leaves it: a few per cent off."""
    n = Parameter
    off = {n.MU: 1.02, n.TENSION: 0.98, n.STIFFNESS: 1.01, n.BRISTLE: 0.95, n.COULOMB: 1.05}
    moved = put_into(mechanism, {number: factor * number.of(mechanism) for number, factor in off.items()})
    return replace(moved, joints=(replace(moved.joint, gravity_N_m=0.02),))
