"""The one way to meet a joint's plant: the mechanism behind its drive, and its response to commands."""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.joint.drive import driven
from tendonff.compensator.joint.scenario.reference import JointQuantity
from tendonff.compensator.joint.scenario.scenario import JointScenario, SampledJoint
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.simulate import JointSimulation, simulate_joint
from tendonff.ocp.joint.start import joint_problem

VERIFYING_MASSES = 40
REFINEMENT = 10
"""The verifying mechanism has more masses and smaller steps than the design."""

_SETTLING_CYCLES = 4
_STEADY = 1e-3  # of the motion's range, by which the last two cycles may differ

UNSETTLED = "the cycle still changes"
"""Begin of the message of a run whose last two cycles differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPlant:
    """A mechanism behind its drive that commands are judged on.

    Attributes
    ----------
    mechanism : Mechanism
    scenario : JointScenario
    sampled : SampledJoint
    level : Level or None
        None for the scenario's.
    masses : int or None
        Masses of each tendon; None for the paths' own.
    refinement : int
        Steps in one of the design.
    method : Method
        How it is simulated.
    """

    mechanism: Mechanism
    scenario: JointScenario
    sampled: SampledJoint
    level: Level | None = None
    masses: int | None = None
    refinement: int = 1
    method: Method = Method.BDF2

    def respond(self, command_rad: FloatArray) -> JointSimulation:
        """Response to commands of the motors, shape (rows, motors), rows as those of the reference.

        Of a reference that repeats, its last cycle after some. SolveError where the simulation fails.
        """
        sampled, step, fine = self.sampled, self.scenario.run.step_s, self.refinement
        spec = self.scenario.reference
        repeats = 1 + _SETTLING_CYCLES if spec.periodic else 1
        time = sampled.time_s
        span = float(time[-1])
        motor = driven(self.mechanism.drive, command_rad, step)
        rows = (len(time) - 1) * fine
        inner = np.arange(rows * repeats + 1) * (step / fine)
        within = np.mod(inner, span) if repeats > 1 else inner
        columns = [np.interp(within, time, column) for column in motor.T]
        if repeats > 1:  # from rest: the motor starts where it stands
            columns = [column * np.minimum(inner / (0.1 * span), 1.0) + 0 * column for column in columns]
        contact = np.interp(within, time, sampled.contact_N_m)
        led = np.interp(within, time, sampled.angle_rad) if spec.quantity is JointQuantity.TORQUE else None
        problem = joint_problem(
            self.mechanism, self.level or self.scenario.run.level, sampled.motion, segments=self.masses
        )
        run = simulate_joint(
            problem,
            np.column_stack(columns),
            step / fine,
            contact_N_m=contact if led is None else contact[0],
            led_rad=led,
            method=self.method,
        ).require()
        keep = slice(rows * (repeats - 1), None, fine)
        return replace(
            run,
            message=_settled(run, rows) if repeats > 1 else run.message,
            time_s=time,
            motor_rad=run.motor_rad[keep],
            motor_torque_N_m=run.motor_torque_N_m[keep],
            angle_rad=run.angle_rad[keep],
            torque_N_m=run.torque_N_m[keep],
            tension_N=run.tension_N[keep],
            drum_N=run.drum_N[keep],
            lowest_N=run.lowest_N[keep],
        )

    def reached(self, run: JointSimulation) -> FloatArray:
        """Quantity of the reference in a run, shape (rows,)."""
        if self.scenario.reference.quantity is JointQuantity.ANGLE:
            return run.angle_rad
        return run.torque_N_m - joint_load(self.mechanism, self.sampled, self.scenario.run.step_s)


def _settled(run: JointSimulation, rows: int) -> str:
    """The message of a run over cycles of so many rows, or by how much the last two differ."""
    apart = [
        (float(np.abs(each[-rows:] - each[-2 * rows : -rows]).max()), float(np.ptp(each[-rows:])), unit)
        for each, unit in ((run.angle_rad, "rad"), (run.torque_N_m, "N m"))
    ]
    change, whole, unit = max(apart, key=lambda each: each[0] / max(each[1], 1e-12))
    if change <= _STEADY * whole:
        return run.message
    share = 100 * change / max(whole, 1e-12)
    return f"{UNSETTLED} by {change:.2g} {unit} ({share:.2g} %) after {_SETTLING_CYCLES} periods"


def joint_load(mechanism: Mechanism, sampled: SampledJoint, step_s: float) -> FloatArray:
    """Torque that the joint itself takes while it moves as it does, its dry friction included [N m]."""
    joint, angle = mechanism.joint, sampled.angle_rad
    speed = np.gradient(angle, step_s)
    moving = joint.inertia_kg_m2 * np.gradient(speed, step_s) + joint.damping_N_m_s_per_rad * speed
    return moving + joint.coulomb_N_m * np.sign(speed) + joint.static_torque_N_m(angle)


def verifying_masses(mechanism: Mechanism | Finger) -> int:
    """Masses of each tendon of the mechanism that commands are judged on."""
    return max(VERIFYING_MASSES, *(2 * tendon.path.segments for tendon in mechanism.tendons))
