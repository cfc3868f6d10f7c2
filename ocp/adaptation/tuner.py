"""The self-tuning inverse on the host: step by step, or many steps with a simulated rig in the loop."""

import ctypes
from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.adaptation.code import TunedChain, host_tuner, nuisances_of, rest_on_spring
from tendonff.ocp.adaptation.tuning import Sensor, Tuning
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.c_engine import chain_struct, places_of
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits


class TunerStatus(IntFlag):
    """Status of the last step."""

    LIMITED = 1  # the actuator's limits changed the force
    # the model does not explain the measurement: estimates count no more than they stand out from what is left
    # unexplained; otherwise the last safe values hold
    FROZEN = 2
    AT_BOUND = 4  # a factor is at an end of its range
    DOUBT = 8  # more stays unexplained than a good model leaves: something has changed, or is not as the model has it


REALS = (
    *("lowest", "highest", "variance", "deviation", "full_speed", "drift_variance", "start_deviation", "slew"),
    *("quick", "slow", "long_share", "watch_level", "lost_level", "hold_travel", "span"),
)
"""Fields of `Tuning` that the C record takes as reals, in its order."""

INTEGRAL = ("integral_gain", "drift_level")
"""Those of the integral action, behind the samples of a rest."""


_GEAR_TRAVEL_M = 5e-5  # over which the dry friction of a rig's drive turns round

_PER_FACTOR = ("factors", "deviation")
_FOUND = ("force_N", "tension_N", *_PER_FACTOR, "slopes", "moved", "residual", "measured")
"""Numbers that a run gives step by step."""
_IN_C = {"force_N": "force", "tension_N": "tension", "factors": "f", "slopes": "s"}
"""Those that the C calls by another name."""


class _TuningStruct(ctypes.Structure):
    _fields_ = (
        ("sensor", ctypes.c_int),
        ("delay", ctypes.c_int),
        *((name, ctypes.c_double) for name in REALS),
        ("rest_samples", ctypes.c_int),
        *((name, ctypes.c_double) for name in INTEGRAL),
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
        ("gain", ctypes.c_double),
        ("crosstalk", ctypes.c_double),
        ("delay", ctypes.c_int),
        ("gear", ctypes.c_double),
        ("gear_force", ctypes.c_double),
        ("gear_stiffness", ctypes.c_double),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedRun:
    """Record step by step; row k belongs to the end of step k."""

    # force_N, tension_N: shape (n,); force of the actuator and output tension of the rig at the end of the step
    force_N: Array
    tension_N: Array
    # factors, deviation: shape (n, parameters); estimates as factors on the scenario's values, as far as they count,
    # and the standard deviations of what was learnt
    factors: Array
    deviation: Array
    # shape (n, parameters + nuisance parameters); change of the predicted measurement with each factor, and nuisance
    slopes: Array
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

    Parameters
    ----------
    chain : Chain
    step_s : float
        Step of the controller [s].
    substeps : int
        Steps of the simulation in one of them.
    initial_tension_N : float
    sensor_gain : float, optional
        What the sensor says over what is true [-].
    delay_samples : int, optional
        True age of a measurement when it arrives; default: that of the tuner.
    gear_N : float, optional
        Dry friction of the drive, beside that of the chain [N].
    crosstalk : float, optional
        Share of the actuator's force that the sensor shows beside what it measures [unit of the sensor per N].
    """

    def __init__(
        self,
        chain: Chain,
        step_s: float,
        substeps: int,
        initial_tension_N: float,
        *,
        sensor_gain: float = 1.0,
        delay_samples: int | None = None,
        gear_N: float = 0.0,
        crosstalk: float = 0.0,
    ) -> None:
        self.chain, self.rows = chain, 0
        self.x = rest_on_spring(chain, initial_tension_N)
        self.x_old = self.x.copy()
        start = float(self.x[chain.layout.part("q_a")][0])
        self.late, self._delay = np.empty(0), delay_samples
        self._gain, self._aside = sensor_gain, crosstalk * initial_tension_N
        drive = (gear_N, 0.0, gear_N / _GEAR_TRAVEL_M)
        state = (1, initial_tension_N, start, initial_tension_N)
        self.struct = _RigStruct(step_s / substeps, substeps, *state, sensor_gain, crosstalk, 0, *drive)

    def sensed_through(self, delay_samples: int, first: float) -> None:
        """Fill the line of measurements on their way, once; `first` is what the sensor says at rest."""
        if not self.late.size:
            self.struct.delay = delay_samples if self._delay is None else self._delay
            self.late = np.full(self.struct.delay + 1, self._gain * first + self._aside)

    def stretch(self, longer_m: float) -> None:
        """Make the tendon longer at rest, at once."""
        chain, layout = self.chain, self.chain.layout
        slopes = chain.rest_state(1.0).vector() - chain.rest_state(0.0).vector()
        share = slopes / slopes[layout.part("e")].sum()
        for name in ("e", *layout.link_states):
            part = layout.part(name)
            self.x[part] -= longer_m * share[part]
            self.x_old[part] -= longer_m * share[part]

    def change(self, chain: Chain) -> None:
        """Another chain of the same size and laws from here on; the spring of the load keeps its anchor."""
        if chain.layout != self.chain.layout:
            raise ParameterError("a rig must keep its number of masses and its laws in mid-run; start another one")
        self.chain = chain


class SelfTuner:
    """The exact inverse of a chain that tunes itself to a measurement, at rest under a uniform tension at first.

    `joints_late_s` is how much later than stated the joints' angles arrive [s], below zero where it is earlier.

    Raises
    ------
    CodeError
        If no C compiler works here: `pip install "tendonff[compiler]"` brings one.
    """

    def __init__(
        self,
        tuned: TunedChain,
        step_s: float,
        tuning: Tuning,
        limits: ForceLimits,
        initial_tension_N: float,
        *,
        joints_late_s: float = 0.0,
    ) -> None:
        if tuned.parameters != tuning.parameters:
            raise ParameterError(
                f"the chain must carry the factors that are tuned, {', '.join(tuning.parameters)}; "
                f"got {', '.join(tuned.parameters)}"
            )
        self._count, nuisances = len(tuning.parameters), nuisances_of(tuned, tuning)
        self._code, self._wide = host_tuner(tuned, nuisances), self._count + len(nuisances)
        self._chain, self._step_s, self._rows = tuned.chain, step_s, 0
        self._numbers = chain_struct(tuned.chain)  # the tuner points at what differs from mass to mass
        self._struct = _TuningStruct(
            int(tuning.sensor is Sensor.ACTUATOR_POSITION),
            tuning.delay_samples,
            *(getattr(tuning, name) for name in REALS),
            tuning.rest_samples,
            *(getattr(tuning, name) for name in INTEGRAL),
        )
        change = limits.rate_N_per_s * step_s
        self._limits = _LimitsStruct(limits.minimum_N, limits.maximum_N, change)
        self._memory = np.empty(2 * self._code.work_reals(n=tuned.chain.count))
        self._state = ctypes.create_string_buffer(self._code.size())
        self._first = 0.0 if tuning.sensor is Sensor.ACTUATOR_POSITION else initial_tension_N
        self._delay, self._joint_age = tuning.delay_samples, tuning.joint_delay_samples
        self._joints_late_s = joints_late_s + self._joint_age * step_s
        self._code.begin(
            self=self._state,
            chain=ctypes.byref(self._numbers),
            step_s=step_s,
            t=ctypes.byref(self._struct),
            tension=initial_tension_N,
            **self._places(0, "row"),
        )

    def _places(self, first: int, name: str, rows: int = 0) -> dict[str, Array]:
        """Where the tuner takes the path to be from a row on, as an argument; none where nothing moves."""
        chain, start_s = self._chain, first * self._step_s
        if chain.motion is not None and (self._joint_age or self._joints_late_s):
            chain = replace(chain, motion=self._known(chain.motion, start_s, rows))
        found = places_of(chain, start_s, self._step_s, rows)
        return dict(zip((name,), found, strict=False))

    def _known(self, motion: JointMotion, start_s: float, rows: int) -> JointMotion:
        """Angles that arrive late, taken on by their age at the mean rate of as many samples."""
        time = start_s + self._step_s * np.arange(-1.0, rows + 1)
        now, before = (
            motion.at(np.maximum(np.maximum(time - age * self._step_s, 0.0) - self._joints_late_s, 0.0))
            for age in (0, self._joint_age)
        )
        return JointMotion(names=motion.names, time_s=time, angle_rad=now + (now - before))

    def step(self, reference_N: float, measured: float) -> float:
        """Force at the end of a step, where that output tension is wanted [N].

        The last measurement is that of the sensor: output tension [N], or actuator position relative to the start [m].
        """
        self._rows += 1
        return float(
            self._code.step(
                self=self._state,
                t=ctypes.byref(self._struct),
                limits=ctypes.byref(self._limits),
                reference=reference_N,
                measured=measured,
                memory=self._memory,
                **self._places(self._rows + 1, "row"),  # begins with this row
            )
        )

    @property
    def factors(self) -> Array:
        """Estimates as factors on the scenario's values, shape (parameters,)."""
        return self._report()[0]

    @property
    def status(self) -> TunerStatus:
        """Status of the last step."""
        return self._report()[1]

    def _report(self) -> tuple[Array, TunerStatus]:
        factors, deviation, slopes = (np.empty(n) for n in (self._count, self._count, self._wide))
        status = np.empty(1, dtype=np.intc)
        self._code.report(
            self=self._state,
            t=ctypes.byref(self._struct),
            f=factors,
            deviation=deviation,
            s=slopes,
            moved=np.empty(1),
            residual=np.empty(1),
            status=status,
        )
        return factors, TunerStatus(int(status[0]))

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
        found = {name: np.empty((rows, count) if name in _PER_FACTOR else rows) for name in _FOUND}
        found["slopes"] = np.empty((rows, self._wide))
        status = np.zeros(rows, dtype=np.intc)
        rig.sensed_through(self._delay, self._first)
        fine = rig.struct.step_s
        plant_places = places_of(rig.chain, rig.rows * self._step_s, fine, rows * rig.struct.substeps)
        places = self._places(self._rows, "places", rows) | dict(zip(("plant_places",), plant_places, strict=False))
        if len(places) == 1:
            raise ParameterError("rig and tuner must both be on a path that moves, or neither; give both the same path")
        done = self._code.run(
            self=self._state,
            t=ctypes.byref(self._struct),
            limits=ctypes.byref(self._limits),
            open=not adapt,
            plant=ctypes.byref(chain_struct(rig.chain)),
            rig=ctypes.byref(rig.struct),
            x=rig.x,
            x_old=rig.x_old,
            plant_memory=np.empty(self._code.work_reals(n=rig.chain.count)),
            memory=self._memory,
            late=rig.late,
            reference=reference,
            noise=noise,
            rows=rows,
            status=status,
            **{_IN_C.get(name, name): values for name, values in found.items()},
            **places,
        )
        self._rows += rows
        rig.rows += rows
        if done < rows:
            raise SolveError(
                f"the simulated rig failed in step {done}: its chain did not converge; "
                "use more substeps, or a reference that falls more slowly"
            )
        return TunedRun(**found, status=status)
