"""The self-tuning inverse on the host: step by step, or many steps with a simulated rig in the loop."""

import ctypes
from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.code import TunedChain, host_library, rest_on_spring
from tendonff.ocp.adaptation.tuning import Sensor, Tuning
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.c_engine import chain_struct, places_of, pointer
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits


class TunerStatus(IntFlag):
    """What the last step says."""

    LIMITED = 1  # the actuator's limits changed the force
    # the model does not explain the measurement: estimates count no more than they stand out from what is left
    # unexplained; otherwise the last safe values hold
    FROZEN = 2
    AT_BOUND = 4  # a factor is at an end of its range
    DOUBT = 8  # more stays unexplained than a good model leaves: something has changed, or is not as the model has it


REALS = (
    *("lowest", "highest", "variance", "deviation", "full_speed", "drift_variance", "start_deviation", "slew"),
    *("quick", "slow", "watch_level", "lost_level", "hold_travel"),
)
"""Fields of `Tuning` that the C record takes as reals, in its order."""


_PER_PARAMETER = ("factors", "deviation", "slopes")
_FOUND = ("force_N", "tension_N", *_PER_PARAMETER, "moved", "residual", "measured")
"""Numbers that a run gives step by step, in the order in which the C takes their arrays."""


class _TuningStruct(ctypes.Structure):
    _fields_ = (
        ("sensor", ctypes.c_int),
        ("delay", ctypes.c_int),
        *((name, ctypes.c_double) for name in REALS),
        ("rest_samples", ctypes.c_int),
        ("integral_gain", ctypes.c_double),
    )


class _LimitsStruct(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in ("force_min", "force_max", "change_max"))


class _RigStruct(ctypes.Structure):
    _fields_ = (
        ("step_s", ctypes.c_double),
        ("substeps", ctypes.c_int),
        ("fresh", ctypes.c_int),
        ("tension", ctypes.c_double),
        ("start", ctypes.c_double),
        ("output", ctypes.c_double),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedRun:
    """What happened step by step; row k belongs to the end of step k."""

    # force_N, tension_N: shape (n,); force of the actuator and output tension of the rig at the end of the step
    force_N: Array
    tension_N: Array
    # factors, deviation: shape (n, parameters); estimates as factors on the scenario's values, as far as they count,
    # and the standard deviations of what was learnt
    factors: Array
    deviation: Array
    slopes: Array  # shape (n, parameters); change of the predicted measurement with each factor
    moved: Array  # shape (n,); how far the prediction moved in the step
    measured: Array  # shape (n,); what the tuner was given at the beginning of the step, unit of the sensor
    # shape (n,); RMS of what the model does not explain, unit of the sensor; at least that of a good model
    residual: Array
    status: NDArray[np.intc]  # shape (n,); bits of `TunerStatus`

    @classmethod
    def joined(cls, runs: list["TunedRun"]) -> "TunedRun":
        """Runs one after the other."""
        return cls(**{name: np.concatenate([getattr(run, name) for run in runs]) for name in (*_FOUND, "status")})


class SimulatedRig:
    """A chain in the loop, of any size, at rest under a uniform tension at first.

    The step is that of the controller, and the simulation takes so many substeps in it.
    """

    def __init__(self, chain: Chain, step_s: float, substeps: int, initial_tension_N: float) -> None:
        self.chain, self.rows = chain, 0
        self.x = rest_on_spring(chain, initial_tension_N)
        self.x_old = self.x.copy()
        start = float(self.x[chain.layout.part("q_a")][0])
        self.struct = _RigStruct(step_s / substeps, substeps, 1, initial_tension_N, start, initial_tension_N)

    def change(self, chain: Chain) -> None:
        """Another chain of the same size and laws from here on; the spring of the load keeps its anchor."""
        if chain.layout != self.chain.layout:
            raise ParameterError("a rig must keep its number of masses and its laws in mid-run; start another one")
        self.chain = chain


class SelfTuner:
    """The exact inverse of a chain that tunes itself to a measurement, at rest under a uniform tension at first.

    Raises
    ------
    CodeError
        If no C compiler works here: `pip install ziglang` brings one.
    """

    def __init__(
        self, tuned: TunedChain, step_s: float, tuning: Tuning, limits: ForceLimits, initial_tension_N: float
    ) -> None:
        if tuned.parameters != tuning.parameters:
            raise ParameterError(
                f"the chain must carry the factors that are tuned, {', '.join(tuning.parameters)}; "
                f"got {', '.join(tuned.parameters)}"
            )
        self._library, self._count = host_library(tuned), len(tuning.parameters)
        self._chain, self._step_s, self._rows = tuned.chain, step_s, 0
        self._numbers = chain_struct(tuned.chain)  # the tuner points at what differs from mass to mass
        self._struct = _TuningStruct(
            int(tuning.sensor is Sensor.ACTUATOR_POSITION),
            tuning.delay_samples,
            *(getattr(tuning, name) for name in REALS),
            tuning.rest_samples,
            tuning.integral_gain,
        )
        change = limits.rate_N_per_s * step_s
        self._limits = _LimitsStruct(limits.minimum_N, limits.maximum_N, change)
        self._memory = np.empty(2 * self._library.tff_work_reals(ctypes.c_int(tuned.chain.count)))
        self._state = ctypes.create_string_buffer(self._library.tff_tuner_bytes())
        first = 0.0 if tuning.sensor is Sensor.ACTUATOR_POSITION else initial_tension_N
        self._late = np.full(tuning.delay_samples + 1, first)
        self._library.tff_tuner_begin(
            *(self._state, ctypes.byref(self._numbers), ctypes.c_double(step_s), ctypes.byref(self._struct)),
            *(ctypes.c_double(initial_tension_N), *map(pointer, places_of(tuned.chain, 0.0, step_s, 0))),
        )

    def step(self, reference_N: float, measured: float) -> float:
        """Force at the end of a step, where that output tension is wanted [N].

        The last measurement is that of the sensor: output tension [N], or actuator position relative to the start [m].
        """
        self._rows += 1
        places = places_of(self._chain, (self._rows + 1) * self._step_s, self._step_s, 0)  # begins with this row
        return float(
            self._library.tff_tuner_step(
                *(self._state, ctypes.byref(self._struct), ctypes.byref(self._limits)),
                *map(ctypes.c_double, (reference_N, measured)),
                *map(pointer, (self._memory, *places)),
            )
        )

    @property
    def factors(self) -> Array:
        """Estimates as factors on the scenario's values, shape (parameters,)."""
        return self._report()[0]

    @property
    def status(self) -> TunerStatus:
        """What the last step says."""
        return self._report()[1]

    def _report(self) -> tuple[Array, TunerStatus]:
        f, deviation, s = (np.empty(self._count) for _ in range(3))
        moved, residual, status = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
        self._library.tff_tuner_report(
            *(self._state, ctypes.byref(self._struct), *map(pointer, (f, deviation, s))),
            *(ctypes.byref(moved), ctypes.byref(residual), ctypes.byref(status)),
        )
        return f, TunerStatus(status.value)

    def run(self, rig: SimulatedRig, reference_N: Array, noise: Array, *, adapt: bool = True) -> TunedRun:
        """Close the loop around a simulated rig, which goes on from where it is.

        References are for the ends of the steps, noise is added to the measurement at their beginnings; one of each a
        step. Without `adapt` the scenario's values hold: the plain inverse, with integral action where there is one.

        Raises
        ------
        SolveError
            If the rig's simulation fails.
        """
        rows, count = len(reference_N), self._count
        reference, noise = (np.ascontiguousarray(a, dtype=np.float64) for a in (reference_N, noise))
        found = {name: np.empty((rows, count) if name in _PER_PARAMETER else rows) for name in _FOUND}
        status = np.zeros(rows, dtype=np.intc)
        memory = np.empty(self._library.tff_work_reals(ctypes.c_int(rig.chain.count)))
        fine = rig.struct.step_s
        places = [
            *places_of(self._chain, self._rows * self._step_s, self._step_s, rows),
            *places_of(rig.chain, rig.rows * self._step_s, fine, rows * rig.struct.substeps),
        ]
        if len(places) == 1:
            raise ParameterError("rig and tuner must both be on a path that moves, or neither; give both the same path")
        done = self._library.tff_tuner_run(
            *(self._state, ctypes.byref(self._struct), ctypes.byref(self._limits), ctypes.c_int(not adapt)),
            *map(ctypes.byref, (chain_struct(rig.chain), rig.struct)),
            *map(pointer, (rig.x, rig.x_old, memory, self._memory, self._late, reference, noise)),
            *(ctypes.c_long(rows), *map(pointer, found.values()), pointer(status)),
            *map(pointer, places),
        )
        self._rows += rows
        rig.rows += rows
        if done < rows:
            raise SolveError(
                f"the simulated rig failed in step {done}: its chain did not converge; "
                "use more substeps, or a reference that falls more slowly"
            )
        return TunedRun(**found, status=status)
