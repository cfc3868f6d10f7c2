"""The observer of a joint that something else loads: fitted laws of its loop, step by step."""

import math
from collections.abc import Sequence

import numpy as np

from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.models.joint.quasi_static import Slid
from tendonff.ocp.step.protocol import Array


class LoopObserver:
    """Laws of [observer] with their memory."""

    tensions = 0
    joints: tuple[str, ...] = ()

    def __init__(self, table: ObserverTable) -> None:
        self._table, self._angle, self._torque = table, table.angle, table.torque
        self._stretch: Array | None = None
        self._slid: Slid | None = None
        self._last = Observation()
        self.status: tuple[ObserverStatus, ...] = ()

    def step(self, _dt: float, motor_rad: float, motor_torque_N_m: float, _others: Sequence[float]) -> Observation:
        """Advance; the last answer is held where an input is no number, and the history is forgotten."""
        if not (math.isfinite(motor_rad) and math.isfinite(motor_torque_N_m)):
            self.status = (ObserverStatus.INPUT_HELD,)
            self._stretch = self._slid = None
            return self._last
        self.status = ()
        row = np.array([motor_rad]), np.array([motor_torque_N_m])
        sensed, band = self._angle.follow(*row, self._stretch), self._table.angle_band_rad
        self._stretch = sensed.memory
        value, low, high = (float(a[0]) for a in (sensed.angle_rad, sensed.low_rad, sensed.high_rad))
        self._last = Observation(
            angle_rad=Estimate(value=value, low=low - band, high=high + band),
            torque_N_m=self._torque_at(motor_rad, motor_torque_N_m),
        )
        return self._last

    def _torque_at(self, motor_rad: float, motor_torque_N_m: float) -> Estimate | None:
        law, band = self._torque, self._table.torque_band_N_m or 0.0
        if law is None:
            return None
        torques, self._slid = law.follow(np.array([motor_rad]), np.array([motor_torque_N_m]), self._slid)
        value = float(torques[0])
        low, high = (value, value) if self._slid.known else law.range_at(motor_rad, motor_torque_N_m)
        return Estimate(value=value, low=low - band, high=high + band)
