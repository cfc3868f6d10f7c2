"""A loop whose numbers are hidden: the independent plant of `joint_plant` behind a motor that is read as servos are."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.motors.loop_routine import suggest_routine
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.models.joint.parameters import Mechanism
from tests.joint_plant import PlantResponse, respond

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).parents[1] / "examples"
FINE_S, ROW_S = 1e-3, 1e-2
TORQUE_CONSTANT, CURRENT_NOISE_A, COUNT_RAD = 0.5, 3e-3, 2 * np.pi / 4096


def scenario(*, stop: bool = True) -> JointScenario:
    """Scenario as the user knows it: the hand's joint, about where its stop is, and a data sheet of the motor."""
    text = (EXAMPLES / "hand_joint.toml").read_text("utf-8")
    if stop:
        stops = "gravity_zero_rad = 0.0\nstop_high_rad = 1.25\nstop_stiffness_N_m_per_rad = 100.0\n"
        text = text.replace("gravity_zero_rad = 0.0", stops)
    text = text.replace("pretension_N = 5.0", "pretension_N = 15.0")
    motor = f"gear_ratio = 1.0\ninertia_kg_m2 = 2e-4\ntorque_constant_N_m_per_A = {TORQUE_CONSTANT}\n"
    return parse_joint_scenario(text.replace("gear_ratio = 1.0", motor), EXAMPLES / "hand_joint.toml")


@dataclass(frozen=True, kw_only=True)
class HiddenLoop:
    """A loop and its motor.

    Attributes
    ----------
    mechanism : Mechanism
        As it truly is.
    scale : float
        Measured torque over true torque.
    slip_rad : float
        Way of the motor in which friction of its gear builds up.
    seed : int
        Of its noise.
    """

    mechanism: Mechanism
    scale: float
    slip_rad: float
    seed: int

    def follow(self, motor_rad: Array, *, masses: int = 40, step_s: float = 2e-6) -> PlantResponse:
        """Response of the independent plant to motor angles, every `FINE_S`."""
        tension = self.mechanism.drive.pretension_N or 0.0
        return respond(
            self.mechanism, motor_rad, FINE_S, 0.0, tensions_N=np.full(2, tension), masses=masses, step_s=step_s
        )

    def log(self, time_s: Array, motor_rad: Array, *, masses: int = 40, step_s: float = 2e-6) -> dict[str, Array]:
        """Columns of a log of motor angles, read at 100 Hz with 12 bits a turn from any zero."""
        fine = np.arange(round(time_s[-1] / FINE_S) + 1) * FINE_S
        motor = np.interp(fine, time_s, motor_rad)
        plant = self.follow(motor, masses=masses, step_s=step_s)
        drive, radii = self.mechanism.drive, np.array(self.mechanism.drum_radius_m)
        held = plant.drum_N @ (radii * np.array([1.0, -1.0]))
        way, state = np.zeros(len(motor)), 0.0
        for row, move in enumerate(np.diff(motor) / self.slip_rad, start=1):
            state = way[row] = (state + move) / (1 + abs(move))
        dry = drive.coulomb_N_m + (1 - drive.gear_efficiency) * np.abs(held)
        acceleration = np.gradient(np.gradient(motor, FINE_S), FINE_S)
        torque = self.scale * (held + drive.inertia_kg_m2 * acceleration + dry * way)
        rows = slice(None, None, round(ROW_S / FINE_S))
        draw = np.random.default_rng(self.seed)
        noise, zeros = CURRENT_NOISE_A * draw.standard_normal(len(fine[rows])), COUNT_RAD * draw.uniform(size=2)
        return {
            "time_s": fine[rows],
            "motor_rad": np.round((motor[rows] + zeros[0]) / COUNT_RAD) * COUNT_RAD,
            "motor_current_A": torque[rows] / TORQUE_CONSTANT + noise,
            "joint_rad": np.round((plant.angle_rad[rows] + zeros[1]) / COUNT_RAD) * COUNT_RAD,
        }


def hidden(seed: int) -> HiddenLoop:
    """A loop drawn about the known one: friction, tension, stiffness, gear, stop, torque constant."""
    draw = np.random.default_rng(seed)
    known = scenario().mechanism
    exponent, tension = draw.uniform(0.3, 1.1), draw.uniform(8.0, 25.0)
    stiffness, bristle = (float(np.exp(draw.uniform(*np.log(ends)))) for ends in ((1e4, 4e4), (5e4, 3e5)))
    mu = exponent / known.tendons[0].path.total_angle_rad
    stop, stop_stiffness = draw.uniform(1.15, 1.35), draw.uniform(60.0, 200.0)
    gear = draw.uniform(0.05, 0.3) * 2 * exponent * tension * known.drum_radius_m[0]
    efficiency = 1.0 if seed % 4 else draw.uniform(0.9, 0.97)
    tendons = tuple(
        replace(
            t,
            friction=replace(t.friction, mu_dynamic=mu, mu_static=mu, soft_bristle_stiffness_N_per_m=bristle),
            tendon=replace(t.tendon, stiffness_N_per_m=stiffness),
        )
        for t in known.tendons
    )
    joint = replace(
        known.joint,
        gravity_N_m=draw.uniform(0.012, 0.028),
        stop_high_rad=stop,
        stop_stiffness_N_m_per_rad=stop_stiffness,
    )
    drive = replace(known.drive, pretension_N=tension, coulomb_N_m=gear, gear_efficiency=efficiency)
    return HiddenLoop(
        mechanism=replace(known, joints=(joint,), tendons=tendons, drive=drive),
        scale=draw.uniform(0.9, 1.1),
        slip_rad=draw.uniform(1e-3, 6e-3),
        seed=seed,
    )


def write_log(loop: HiddenLoop, file: Path, *, encoder: bool, masses: int = 40, step_s: float = 2e-6) -> Path:
    """Log of the suggested routine on a hidden loop."""
    routine = suggest_routine(scenario())
    columns = loop.log(routine.time_s, routine.motor_rad, masses=masses, step_s=step_s)
    write_csv(file, columns if encoder else {k: v for k, v in columns.items() if k != "joint_rad"})
    return file
