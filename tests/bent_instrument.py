"""A flexible instrument whose numbers are hidden: a pair of cables through a sheath that each file bends otherwise.

The plant is `finger_plant`; nothing that it integrates comes from the package. The sheath's own bristles go by its wrap
angle, friction coefficients of the two cables differ, and so does the bend from what is stated of it.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.models.joint.parameters import JointTendon, Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tests import finger_plant

Array = NDArray[np.float64]
ROW_S, COUNT_RAD, NOISE, START_N = 1e-3, 2 * np.pi / 4096, 0.01, 4.0
SHAFT_RAD, BENDS_RAD = 1.0, tuple(np.linspace(0.2, 3.0, 10).tolist())
CABLES = ("open", "close")

TEXT = f"""
schema = 1
name = "flexible instrument"

[joints.wrist]                        # a flexure, which springs back
kind = "driven"
inertia_kg_m2 = 2.0e-6
damping_N_m_s_per_rad = 1.0e-4
stiffness_N_m_per_rad = 0.05
coulomb_N_m = 1.0e-4

[joints.bend]                         # of the sheath; it stands still in each file
kind = "constant"
angle_rad = 1.0

[path]
segments = 8

[[path.sections]]
name = "shaft"
angle_rad = {SHAFT_RAD}
length_m = 0.3

[[path.sections]]
name = "sheath"
angle_rad = 0.0
length_m = 0.2
joint = "bend"
angle_per_rad = 1.0

[tendon]
mass_kg = 0.0005
stiffness_N_per_m = 4.0e4
relaxing_stiffness_N_per_m = 0.0
damping_N_s_per_m = 0.05

[friction]
mu_dynamic = 0.15
viscous_N_s_per_m = 0.0
bristle_stiffness_N_per_m = 2.0e6
soft_bristle_stiffness_N_per_m = 3.0e5

[[tendons]]
name = "open"
moment_arm_m = 0.0025

[[tendons]]
name = "close"
moment_arm_m = -0.0025

[drive]
kind = "pair"
drum_radius_m = 0.006
least_tension_N = 3.0
coulomb_N_m = 3.0e-3                  # no cell at a drum feels it

[reference]
quantity = "joint_angle"
kind = "sine"
amplitudes_rad = [0.6]
frequencies_Hz = [0.5]
duration_s = 4.0

[run]
step_s = 0.001
level = "presliding"
"""


def scenario() -> JointScenario:
    """Scenario as the user knows it."""
    return parse_joint_scenario(TEXT, "instrument.toml")


@dataclass(frozen=True, kw_only=True)
class BentInstrument:
    """An instrument.

    Attributes
    ----------
    mechanism : Mechanism
        As it truly is, at a bend of zero.
    truth : dict of str to float
        Its numbers by their keys.
    seed : int
    """

    mechanism: Mechanism
    truth: dict[str, float]
    seed: int

    @classmethod
    def drawn(cls, seed: int) -> "BentInstrument":
        """Friction and stiffness of each cable, and the spring of the wrist, drawn by a seed."""
        rng, truth, known = np.random.default_rng(seed), dict[str, float](), scenario().mechanism
        for cable in CABLES:
            truth[f"tendons.{cable}.friction.mu_dynamic"] = 0.15 * rng.uniform(0.7, 1.4)
            truth[f"tendons.{cable}.tendon.stiffness_N_per_m"] = 4e4 * rng.uniform(0.75, 1.3)
        truth["joints.wrist.stiffness_N_m_per_rad"] = 0.05 * rng.uniform(0.8, 1.25)
        return cls(mechanism=with_numbers(known, truth), truth=truth, seed=seed)

    def log(
        self, folder: Path, number: int, *, seconds: float = 12.0, masses: int = 10, step_s: float = 2e-6
    ) -> tuple[Path, str]:
        """Log of one of `BENDS_RAD` in a motion of its own, and its condition as it is stated, to 0.03 rad."""
        rng = np.random.default_rng([self.seed, number])
        time = np.arange(round(seconds / ROW_S) + 1) * ROW_S
        motor, found = self.turned(BENDS_RAD[number], *motion_of(rng, time), time, masses, step_s)
        columns = {"time_s": time}
        for name, angle, pulled in zip(CABLES, motor.T, found.drum_N.T, strict=True):
            tension = np.append(START_N, pulled)
            columns[f"motor_{name}_rad"] = np.round(angle / COUNT_RAD) * COUNT_RAD
            columns[f"tension_{name}_at_drum_N"] = tension + NOISE * np.ptp(tension) * rng.standard_normal(len(time))
        columns["joint_rad"] = np.round(np.append(0.0, found.angle_rad) / COUNT_RAD) * COUNT_RAD
        file = folder / f"bend_{number}.csv"
        write_csv(file, columns)
        return file, f"{file.name}:bend={BENDS_RAD[number] + 0.03 * rng.standard_normal():.4f}"

    def turned(
        self,
        bend_rad: float,
        wanted_rad: Array,
        level_N: Array,
        time_s: Array,
        masses: int = 10,
        step_s: float = 2e-6,
    ) -> tuple[Array, finger_plant.FingerResponse]:
        """Angles of motors that stretch the cables by lengths alone, and the plant's answer."""
        own = self.mechanism
        known, drum_m = scenario().mechanism, own.drum_radius_m[0]
        arms = np.array([cable.arm.moment_arm_m or 0.0 for cable in own.tendons])
        share_N = np.abs(arms[0] * wanted_rad[:, None]) * known.joint.stiffness_N_m_per_rad / arms[0] ** 2
        tension = level_N[:, None] + share_N * (arms * wanted_rad[:, None] > 0)
        motor = (arms * wanted_rad[:, None] + (tension - START_N) / known.tendons[0].tendon.stiffness_N_per_m) / drum_m
        cables = [_straight(cable, bend_rad) for cable in own.tendons]
        found = finger_plant.respond(
            own.joints, cables, drum_m * np.eye(2), motor, time_s[1], np.zeros(1), np.full(2, START_N),
            masses=masses, step_s=step_s,
        )  # fmt: skip
        return motor, found


def motion_of(rng: np.random.Generator, time_s: Array) -> tuple[Array, Array]:
    """Wanted angle, sines of three frequencies that begin at rest, and level of tension [N]."""
    fade = np.minimum(time_s / 1.5, 1.0) ** 2
    rates, phases = rng.uniform(0.15, 0.9, 3), rng.uniform(0, 2 * np.pi, 3)
    shape = sum(np.sin(2 * np.pi * f * time_s + p) / k for k, (f, p) in enumerate(zip(rates, phases, strict=True), 1))
    level = START_N + fade * (1 - np.cos(2 * np.pi * rng.uniform(0.08, 0.2) * time_s)) * rng.uniform(1.5, 3.0)
    return 0.7 * fade * shape / float(np.abs(shape).max()), level


def _straight(cable: JointTendon, bend_rad: float) -> JointTendon:
    """The cable with the wrap angle of its sheath put in, which brings its own bristles."""
    shaft, sheath = cable.path.sections
    bent = replace(sheath, angle_rad=bend_rad, joint=None, angle_per_rad=0.0)
    whole = replace(cable.path, total_angle_rad=SHAFT_RAD + bend_rad, sections=(shaft, bent))
    bristle = cable.friction.soft_bristle_stiffness_N_per_m * (SHAFT_RAD + bend_rad) / SHAFT_RAD
    return replace(cable, path=whole, friction=replace(cable.friction, soft_bristle_stiffness_N_per_m=bristle))
